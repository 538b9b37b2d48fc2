"""What the screen is made of: all that is known of job and machine at one moment, and its values as text. Pure."""

from __future__ import annotations

from dataclasses import dataclass, field

from dnc.console.alarms import AlarmLine
from dnc.console.forecast import Forecast
from dnc.status.job import JobReading
from dnc.status.ledger import MachineStatus, Quality


@dataclass(frozen=True, slots=True)
class Known:
    """What is known at one moment; `clock` is the time of day, `question` waits for a second key."""

    clock: str
    end_clock: str = ""
    machine_name: str = ""
    job: JobReading | None = None
    machine: MachineStatus | None = None
    is_machine_simulated: bool = False
    forecast: Forecast | None = None
    alarms: tuple[AlarmLine, ...] = field(default_factory=tuple)
    question: str = ""
    notice: str = ""
    is_help: bool = False


def planned(known: Known) -> tuple[float, float] | None:
    """Planned seconds done and in all; None without a forecast, or when all is sent and nobody reads the machine."""
    if known.forecast is None or known.job is None:
        return None
    is_seen = known.machine is not None and known.machine.value("execution") is not None
    if known.job.snapshot.get("state") == "SENT" and not is_seen:
        return None
    doubt = known.job.snapshot.get("in_doubt")
    block = known.machine.value("block") if known.machine is not None else None
    number = int(block) if isinstance(block, int) and block > 0 else None
    done_s = known.forecast.done_s(doubt[0] if doubt else None, number)
    if known.machine is not None and known.machine.value("execution") == "PROGRAM_COMPLETED":
        done_s = known.forecast.total_s
    return None if done_s is None else (done_s, known.forecast.total_s)


def is_other_mill(job: JobReading | None, port: int) -> bool:
    """Whether the rehearsal that is shown runs on another virtual mill than the one that is read at this port."""
    own = str(job.snapshot.get("mill_modbus") or "") if job is not None and job.is_attached else ""
    return own != "" and own.rpartition(":")[2] != str(port)


def span_of_time(seconds: float) -> str:
    """Minutes and seconds, hours where there are any.

    >>> span_of_time(3725.4), span_of_time(65), span_of_time(0.4)
    ('1:02:05', '1:05', '0:00')
    """
    whole = int(seconds)
    hours, minutes, rest = whole // 3600, whole // 60 % 60, whole % 60
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def aged(known: Known, name: str) -> str:
    """A value of the machine as text: `--` without one, its age after it when it is not fresh."""
    reading = known.machine.readings.get(name) if known.machine is not None else None
    if reading is None or reading.value is None:
        return "--"
    if reading.quality is Quality.GOOD:
        return str(reading.value)
    return f"{reading.value} ({reading.age_s or 0.0:.0f} s old)"


def fresh(known: Known, name: str) -> str:
    """A value of the machine as text, `--` unless it is fresh: for what misleads when it is old."""
    reading = known.machine.readings.get(name) if known.machine is not None else None
    return str(reading.value) if reading is not None and reading.quality is Quality.GOOD else "--"


def number(known: Known, name: str, decimals: int) -> str:
    """A number of the machine with so many decimals, `--` without one."""
    value = known.machine.value(name) if known.machine is not None else None
    return "--" if value is None or isinstance(value, str) else f"{value:.{decimals}f}"
