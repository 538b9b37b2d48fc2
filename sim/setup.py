"""What a mill is started with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from sim.faults import Faults
from sim.profile import MillProfile


@dataclass(frozen=True, slots=True)
class Setup:
    """For the control's process; paths are absent where nothing is wanted. `probe_pitch_mm` is the verdict's."""

    profile: MillProfile
    faults: Faults
    speed: float
    modbus_host: str
    modbus_port: int
    is_port_fixed: bool
    nominal: Path | None
    motion: Path | None
    probe_pitch_mm: float
    plot: Path | None = None
