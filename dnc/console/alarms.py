"""The alarms of job and machine as one list, first out first, with what the operator has acknowledged. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from dnc.status.job import JobReading
from dnc.status.ledger import MachineStatus


@dataclass(frozen=True, slots=True)
class AlarmLine:
    """One alarm: a fixed id, note, warning or alarm, what it means, what to do."""

    id: str
    severity: str
    text: str
    remedy: str
    is_acknowledged: bool = False


class AlarmList:
    """Keeps the order in which alarms came and what was acknowledged; an alarm that is gone and acknowledged leaves."""

    def __init__(self) -> None:
        self._lines: dict[str, AlarmLine] = {}

    def update(self, present: Sequence[AlarmLine]) -> bool:
        """Take note of what stands now; True if something new needs a look."""
        fresh = [alarm for alarm in present if alarm.id not in self._lines]
        now = {alarm.id: alarm for alarm in present}
        for known in list(self._lines.values()):
            if known.id not in now and known.is_acknowledged:
                del self._lines[known.id]
            elif known.id in now:
                self._lines[known.id] = replace(now[known.id], is_acknowledged=known.is_acknowledged)
        self._lines |= {alarm.id: alarm for alarm in fresh}
        return any(alarm.severity != "note" for alarm in fresh)

    def acknowledge(self, seen: Sequence[AlarmLine]) -> None:
        """The operator has seen these; what there was no room to show waits for its turn."""
        for alarm in seen:
            self._lines[alarm.id] = replace(alarm, is_acknowledged=True)

    def lines(self) -> tuple[AlarmLine, ...]:
        """First out first."""
        return tuple(self._lines.values())


def present_alarms(job: JobReading | None, machine: MachineStatus | None) -> list[AlarmLine]:
    """What stands now, of the job and of the machine."""
    found: list[AlarmLine] = []
    for alarm in (job.snapshot.get("alarms") or []) if job is not None else []:
        name, severity, text, remedy = (str(alarm.get(key, "")) for key in ("id", "severity", "text", "remedy"))
        found.append(AlarmLine(name, severity, text, remedy))
    number = machine.value("alarm_number") if machine is not None else None
    if number:
        found.append(AlarmLine(f"CNC-{number}", "alarm", "the control shows an alarm", "read it at the control"))
    lost = machine.value("overrun_bytes") if machine is not None else None
    if lost:
        what = f"the control lost {lost} bytes: its program is damaged"
        found.append(AlarmLine("DNC-L3", "alarm", what, "stop the control, reset it, restart with dnc send --resume"))
    if machine is not None and "map mismatch" in machine.problem:
        found.append(AlarmLine("DNC-M004", "warning", machine.problem, "name the right profile with --machine"))
    elif machine is not None and "heartbeat" in machine.problem:
        found.append(AlarmLine("DNC-M006", "warning", machine.problem, "do not trust the position shown"))
    return found
