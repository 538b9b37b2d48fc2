"""What can be said of a job afterwards: the window sent / in doubt / executed, the report, the append-only record."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dnc.events import Alarm
from dnc.profile import Control
from dnc.sender import Sender
from dnc.tape import Tape

SCHEMA = "dripmill.send"
VERSION = 1
_BLOCK_NUMBER = re.compile(rb"^\s*/?\d?\s*([N:]\s*\d+)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class InDoubt:
    """Physical lines that the control may or may not have executed; all before `first` are done."""

    first: int
    last: int
    last_offset: int


def in_doubt(tape: Tape, sent_bytes: int, inflight_bytes: int, control: Control) -> InDoubt | None:
    """The window after these bytes: at most the control's buffer, its look-ahead and the line can be undone.

    None while nothing has left. The window always contains the block being executed; it can be far too wide, never
    too narrow, for a control that holds no more than its profile says.
    """
    if sent_bytes <= tape.leader_bytes:
        return None
    last_offset = min(sent_bytes, tape.size_bytes) - 1
    last = tape.lines.line_at(tape, last_offset)
    held_back = inflight_bytes + control.receive_buffer_bytes
    first = tape.lines.line_at(tape, max(tape.leader_bytes, sent_bytes - held_back)) - control.lookahead_blocks
    first = max(1, first)
    return InDoubt(first, last, last_offset)


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


def doubt_words(tape: Tape, doubt: InDoubt | None) -> str:
    """The window as a sentence for the operator."""
    if doubt is None:
        return "nothing was sent"
    names = []
    for line in (doubt.first, doubt.last):
        number = block_number(line_text(tape, line))
        names.append(f"line {line} ({number})" if number else f"line {line}")
    done = f"lines before {doubt.first} were executed; " if doubt.first > 1 else ""
    return f"{done}in doubt from {names[0]} to {names[1]}; nothing after line {doubt.last} was sent whole"


def send_report(
    sender: Sender, control: Control, *, baud: int, simulated: bool, now_s: float, alarms: list[Alarm], **more: object
) -> dict[str, Any]:
    """The report of `dnc send` (docs/schemas/send.schema.json)."""
    tally, tape = sender.tally, sender.tape
    doubt = in_doubt(tape, sender.offset_bytes, sender.clock.pace.inflight_max_bytes, control)
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
        "is_block_cut": sender.is_cut,
        "simulated": simulated,
        "alarms": [alarm_values(alarm) for alarm in alarms],
        **more,
    }


def alarm_values(alarm: Alarm) -> dict[str, str]:
    """One alarm for a report or a snapshot."""
    return {"id": alarm.id, "severity": alarm.severity.value, "text": alarm.text, "remedy": alarm.remedy}


def append_record(folder: Path, record: dict[str, Any]) -> None:
    """Add one job to `records.jsonl`; each line carries the hash of the line before, so that gaps show.

    A line torn by a power cut or a full disk is taken away, here or by the next job. Raises OSError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "records.jsonl"
    previous = last_line(path)
    chained = {**record, "previous": hashlib.sha256(previous).hexdigest() if previous else ""}
    with path.open("ab", buffering=0) as file:
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
