"""What can be said of a job afterwards: the window sent / in doubt / executed, the report, the append-only record."""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dnc.events import Alarm
from dnc.handshake import Cause
from dnc.lookahead import first_unsure_line
from dnc.profile import Control
from dnc.sender import Sender
from dnc.tape import Tape

_UNTOLD = (Cause.CONTROL_ALARM, Cause.CONTROL_RESET)
UNLESS_LOST = "if the control took all that was sent and was not switched off since"
SCHEMA = "dripmill.send"
VERSION = 1
_BLOCK_NUMBER = re.compile(rb"^\s*/?\d?\s*([N:]\s*\d+)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class InDoubt:
    """Physical lines that the control may or may not have executed; all before `first` are done.

    That is certain if `is_proven`; else as far as the control took all that was sent.
    """

    first: int
    last: int
    last_offset: int
    is_proven: bool = False


def in_doubt(
    tape: Tape, sent_bytes: int, inflight_bytes: int, control: Control, proven_bytes: int | None = None
) -> InDoubt | None:
    """The window after these bytes: at most the control's buffer, its look-ahead and the line can be undone.

    None while nothing of the program has left. The window always contains the block being executed; it can be far too
    wide, never too narrow, for a control that holds no more than its profile says. Where bytes may have been lost it
    begins no later than at `proven_bytes`, up to which the control's own XON tells that it had executed.
    """
    sent_bytes = min(sent_bytes, tape.trailer_from)
    if sent_bytes <= tape.leader_bytes:
        return None
    done_bytes = sent_bytes - inflight_bytes - control.receive_buffer_bytes
    if proven_bytes is not None:
        done_bytes = min(done_bytes, proven_bytes)
    first = first_unsure_line(tape, max(tape.leader_bytes, done_bytes), control.lookahead_blocks)
    last = tape.lines.line_at(tape, sent_bytes - 1)
    return InDoubt(first, last, sent_bytes - 1, proven_bytes is not None)


def doubt_of(sender: Sender, control: Control) -> InDoubt | None:
    """The window of a job as it stands, or as it has ended.

    After an alarm or a reset nobody knows how much of what was sent the control took: its buffer may have run over.
    What it had executed when it last said XON is certain, unless noise came too: an XON may have been noise.
    """
    inflight_bytes, proven_bytes = sender.clock.pace.beyond_recall_bytes, None
    if sender.last_cause in _UNTOLD:
        proven_bytes = (sender.tally.xon_offset_bytes or 0) - control.xon_fill_bytes - inflight_bytes
    found = in_doubt(sender.tape, sender.offset_bytes, inflight_bytes, control, proven_bytes)
    is_noisy = sender.tally.noise_bytes > 0 or sender.tally.unasked_xon_count > 0
    return replace(found, is_proven=False) if found is not None and is_noisy else found


def block_number(text: bytes) -> str | None:
    """The N word that begins a block, or None.

    >>> block_number(b"N120 G1 X3"), block_number(b"X4")
    ('N120', None)
    """
    found = _BLOCK_NUMBER.match(text)
    return found[1].decode("ascii").replace(" ", "").upper() if found else None


def line_text(tape: Tape, line: int, limit_bytes: int = 200) -> bytes:
    """The bytes of one physical line, without its end."""
    return tape.peek(tape.lines.offset_of(tape, line), limit_bytes).split(tape.lines.mark, 1)[0].strip(b"\r\n")


def doubt_words(tape: Tape, doubt: InDoubt | None, restart: Mapping[str, Any] | None = None) -> str:
    """The window as a sentence for the operator, in lines of the program's own file after a `restart` too."""
    if doubt is None:
        return "nothing of the program was sent"
    first, last = (_place(tape, line, restart) for line in (doubt.first, doubt.last))
    unless = "" if doubt.is_proven else f", {UNLESS_LOST}"
    done = f"what lies before {first} was executed{unless}; " if doubt.first > 1 else ""
    return f"{done}in doubt from {first} to {last}; nothing behind it was sent whole"


def own_line(line: int, restart: Mapping[str, Any] | None) -> int | None:
    """The line of the program's file that is this line of the tape; None in the preamble of a restart."""
    before = 0 if restart is None else int(restart["lines_before"])
    if line <= before:
        return None
    return line if restart is None else line - before + int(restart["line"]) - 1


def _place(tape: Tape, line: int, restart: Mapping[str, Any] | None) -> str:
    """A line of the tape as the operator finds it."""
    own = own_line(line, restart)
    if own is None:
        return f"line {line} of the restart's preamble"
    number = block_number(line_text(tape, line))
    return f"line {own} ({number})" if number else f"line {own}"


def send_report(
    sender: Sender, control: Control, *, baud: int, simulated: bool, now_s: float, alarms: list[Alarm], **more: object
) -> dict[str, Any]:
    """The report of `dnc send` (docs/schemas/send.schema.json)."""
    tally, tape = sender.tally, sender.tape
    doubt = doubt_of(sender, control)
    numbers = [block_number(line_text(tape, line)) for line in (doubt.first, doubt.last)] if doubt else None
    state = sender.state.value
    return {
        "schema": SCHEMA,
        "version": VERSION,
        "outcome": "NOT_STARTED" if state == "LOADED" else state,
        "cause": sender.last_cause.value,
        "note": sender.note,
        "bytes_sent": tally.bytes_sent,
        "bytes_total": tape.size_bytes,
        "sha256": tape.sha256,
        "program_sha256": tape.program_sha256,
        "baud": baud,
        "elapsed_s": round(now_s - tally.first_s, 6) if tally.first_s is not None else 0.0,
        "xoff_count": tally.xoff_count,
        "held_s": round(tally.held_now_s(now_s), 6),
        "inflight_at_xoff_bytes_max": tally.inflight_at_xoff_bytes_max,
        "inflight_max_bytes": sender.clock.pace.inflight_max_bytes,
        "utilisation": round(tally.utilisation(now_s), 6),
        "utilisation_median": tally.utilisation_median(),
        "masked_xoff_count": tally.masked_xoff_count,
        "unasked_xon_count": tally.unasked_xon_count,
        "noise_bytes": tally.noise_bytes,
        "in_doubt": [doubt.first, doubt.last] if doubt else None,
        "in_doubt_numbers": numbers,
        "is_block_cut": sender.may_be_cut,
        "simulated": simulated,
        "alarms": [alarm_values(alarm) for alarm in alarms],
        **more,
    }


def alarm_values(alarm: Alarm) -> dict[str, str]:
    """One alarm for a report or a snapshot."""
    return {"id": alarm.id, "severity": alarm.severity.value, "text": alarm.text, "remedy": alarm.remedy}


def append_record(folder: Path, record: dict[str, Any]) -> None:
    """Add one job to `records.jsonl`; each line carries the hash of the line before, so that gaps show.

    A line torn by a power cut or a full disk is taken away, here or by the next job. Jobs on other ports that end at
    the same moment wait for each other. Raises OSError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "records.jsonl"
    with path.open("ab", buffering=0) as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # let go of by closing
        previous = last_line(path)
        chained = {**record, "previous": hashlib.sha256(previous).hexdigest() if previous else ""}
        whole_bytes = _whole_bytes(path)
        file.truncate(whole_bytes)
        line = json.dumps(chained).encode() + b"\n"
        try:
            if file.write(line) < len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError:
            file.truncate(whole_bytes)
            raise


def _whole_bytes(path: Path) -> int:
    """Up to where a file consists of whole lines."""
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        begin = max(0, size - (1 << 20))
        file.seek(begin)
        return begin + file.read().rfind(b"\n") + 1


def last_line(path: Path) -> bytes:
    """The last whole line of a file; empty if there is none."""
    try:
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - (1 << 20)))
            lines = file.read().split(b"\n")
    except OSError:
        return b""
    return lines[-2] if len(lines) > 1 else b""
