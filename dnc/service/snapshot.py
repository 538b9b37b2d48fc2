"""One look at a running job as plain values; reads the sender's figures without ever stopping it."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from dnc.eventlog import EventLog
from dnc.events import JobState, LinkState
from dnc.handshake import Cause
from dnc.names import JobNames
from dnc.port import Port
from dnc.profile import MachineProfile
from dnc.record import InDoubt, alarm_values, block_number, doubt_of, line_text, own_line
from dnc.sender import Sender

SCHEMA = "dripmill.job"
VERSION = 1
_LINES_BEFORE = 6
_LINES_AFTER = 6


@dataclass(frozen=True, slots=True)
class JobView:
    """Everything a snapshot is made of."""

    sender: Sender
    port: Port
    profile: MachineProfile
    names: JobNames
    events: EventLog

    def snapshot(self) -> dict[str, Any]:
        """The values that the console shows; keys as in PROTOCOL.md."""
        sender, tape = self.sender, self.sender.tape
        now_s = time.monotonic()
        offset, tally = sender.offset_bytes, sender.tally
        doubt = doubt_of(sender, self.profile.control)
        line = doubt.last if doubt else 0
        elapsed_s = now_s - tally.first_s if tally.first_s is not None else 0.0
        return {
            "schema": SCHEMA,
            "version": VERSION,
            "job": self.names.job_id,
            "state": sender.state.value,
            "cause": sender.last_cause.value,
            "is_pausing": sender.is_pausing,
            "link": (LinkState.LOST if sender.last_cause is Cause.LOST else LinkState.OPEN).value,
            "program": self.names.program,
            "machine": self.names.machine,
            "sha256": tape.sha256,
            "port": self.port.name,
            "baud": self.profile.link.baud,
            "simulated": self.port.is_simulated,
            "mill_modbus": self.names.mill_modbus,
            "bytes_total": tape.size_bytes,
            "bytes_sent": offset,
            "blocks_total": tape.lines.count,
            "block_sent": block_number(line_text(tape, line)) if line else None,
            "line_sent": self._own_line(line),
            "in_doubt": [self._own_line(doubt.first), self._own_line(doubt.last)] if doubt else None,
            "window": self._window(doubt, line),
            "held_s": round(tally.held_now_s(now_s), 3),
            "held_now_s": round(now_s - sender.held_since_s, 3) if sender.state is JobState.HELD else 0.0,
            "xoff_count": tally.xoff_count,
            "inflight_at_xoff_bytes_max": tally.inflight_at_xoff_bytes_max,
            "inflight_max_bytes": sender.clock.pace.inflight_max_bytes,
            "utilisation": round(tally.utilisation(now_s), 4),
            "elapsed_s": round(elapsed_s, 3),
            "alarms": [alarm_values(alarm) for alarm in list(self.events.alarms)],
        }

    def _window(self, doubt: InDoubt | None, line_sent: int) -> list[dict[str, object]]:
        """The lines around the end of what was sent: done, in doubt, just sent, next."""
        tape = self.sender.tape
        rows: list[dict[str, object]] = []
        for line in range(max(1, line_sent - _LINES_BEFORE), line_sent + _LINES_AFTER + 1):
            if line > tape.lines.count + 1:
                break
            text = line_text(tape, line).decode("latin-1")
            if not text and line > tape.lines.count:
                break
            rows.append({"line": own_line(line, self.names.restart), "text": text, "zone": _zone(line, doubt)})
        return rows

    def _own_line(self, line: int) -> int:
        """The line of the program's file; the preamble of a restart counts as the line that it leads to."""
        restart = self.names.restart
        return line if restart is None else own_line(line, restart) or int(restart["line"])


def _zone(line: int, doubt: InDoubt | None) -> str:
    if doubt is None or line > doubt.last:
        return "next"
    if line < doubt.first:
        return "executed"
    return "sent" if line == doubt.last else "doubt"
