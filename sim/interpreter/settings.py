"""What the interpreter needs to know about the control beside the program; every key has a default."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from types import MappingProxyType

from sim.interpreter.canon import Vector


class KnotRule(Enum):
    """How PL words of BSPLINE blocks give knots: in the block of the leg's end, or one block earlier (cubics)."""

    NX = "nx"
    GENUA = "genua"


class G28(Enum):
    """What G28, an ISO-dialect code, does in a SINUMERIK program."""

    ISO = "iso"
    ALARM = "alarm"
    IGNORE = "ignore"


@dataclass(frozen=True, slots=True)
class Tool:
    """One tool of the table: the radius that G41 and G42 compensate."""

    radius_mm: float


@dataclass(frozen=True, slots=True)
class Settings:
    """The control's side of interpreting.

    Canonical positions are machine positions minus the offset of `reference_offset`, so they are work coordinates
    while that offset is active, and stay continuous when another one is. `work_offsets_mm` gives machine positions of
    the work origins (default zero). `start_mm` is where the machine stands before the first block, in canonical
    coordinates. `poly_degree` is the highest degree of polynomials. `skip_levels` are the levels selected at the panel.
    `travel_mm` is least and greatest machine position of X, Y and Z; None where nothing watches them.
    `unknown_radius_mm` is that of tools which `tools` does not list; where it is None, compensating them is an alarm.
    `backward_jump_alarm` is what a drip-fed program raises when it jumps back. `is_inch` is the basic system: the unit
    until a code sets one, and that of feeds under G70 and G71. `max_repeats` bounds every loop: jumps and blocks that
    run again, added up. Radii at the two ends of an arc may differ by `arc_tolerance_mm` or by `arc_tolerance_share` of
    the radius, whichever is more (MD21000, MD21010); places nearer than `same_place_mm` are one.
    """

    knot_rule: KnotRule = KnotRule.NX
    poly_degree: int = 5
    g28: G28 = G28.ISO
    skip_levels: frozenset[int] = frozenset()
    is_drip_fed: bool = False
    subprogram_folder: Path | None = None
    tools: Mapping[int, Tool] = field(default_factory=lambda: MappingProxyType({}))
    unknown_radius_mm: float | None = None
    has_tool_changer: bool = True
    is_inch: bool = False
    reference_offset: str = "G54"
    work_offsets_mm: Mapping[str, Vector] = field(default_factory=lambda: MappingProxyType({}))
    reference_point_mm: Vector = (0.0, 0.0, 0.0)
    fixed_points_mm: Mapping[int, Vector] = field(default_factory=lambda: MappingProxyType({}))
    start_mm: Vector = (0.0, 0.0, 500.0)
    travel_mm: tuple[tuple[float, float], ...] | None = None
    spindle_max_rpm: float = 100_000.0
    arc_tolerance_mm: float = 0.01
    arc_tolerance_share: float = 0.001
    same_place_mm: float = 1e-9
    accepted_m_codes: frozenset[int] = frozenset()
    backward_jump_alarm: int = 14000
    r_parameters: int = 1000
    max_repeats: int = 50_000
    max_call_depth: int = 11
    max_array_elements: int = 10_000
