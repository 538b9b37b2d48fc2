"""What a mill is started with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from sim.faults import Faults
from sim.profile import MillProfile


@dataclass(frozen=True, slots=True)
class Setup:
    """For the control's process; paths are absent where nothing is wanted. `probe_pitch_mm` is the verdict's.

    `tool_radii_mm` is by tool number, for G41 and G42; `subprogram_folder` holds what the control has in its memory.
    """

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
    tool_radii_mm: Mapping[int, float] = field(default_factory=dict)
    subprogram_folder: Path | None = None
