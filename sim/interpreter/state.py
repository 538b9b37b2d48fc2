"""The modal state of the control between two blocks: one small record per channel, copied for every snapshot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from sim.interpreter.canon import Motion, Vector
from sim.interpreter.frames import Frame
from sim.interpreter.tangents import end_tangent

INCH_MM = 25.4


@dataclass(slots=True)
class State:
    """What earlier blocks left behind; codes are spelled as the language does.

    `position_mm` is canonical (work coordinates of the reference offset). `feed` is the F word in the unit of
    `feed_type`; None until one is programmed. `spindle_direction` is +1 (M3), -1 (M4) or 0;
    `is_spindle_placed` says that it was led to an angle since (SPOS, M19, M70). `last_motion` is
    the move before, whose end direction CT and BTAN take up. `spline_start` and `spline_end` are group 19 and
    20. `feed_axes` are the axes of FGROUP, None for all. `unmodelled` are words accepted without effect that last on a
    real control, as they are written; it is replaced, never changed.
    """

    position_mm: Vector
    motion: str = "G1"
    plane: str = "G17"
    dimension: str = "G90"
    units: str = "G71"
    is_machine_inch: bool = False
    feed_type: str = "G94"
    feed: float | None = None
    work_offset: str = "G500"
    frame: Frame = field(default_factory=Frame)
    path_mode: str = "G64"
    rounding_distance_mm: float = 0.0
    contour_tolerance_mm: float | None = None
    compensation: str = "G40"
    corner: str = "G450"
    feed_correction: str = "CFC"
    acceleration: str = "BRISK"
    spline_start: str = "BTAN"
    spline_end: str = "ETAN"
    spline_degree: int = 3
    feed_axes: tuple[int, ...] | None = None
    tool_selected: int = 0
    tool_selected_name: str = ""
    tool: int = 0
    tool_name: str = ""
    edge: int = 1
    spindle_rpm: float = 0.0
    spindle_direction: int = 0
    is_spindle_placed: bool = False
    is_flood: bool = False
    is_mist: bool = False
    area_min_mm: tuple[float | None, float | None, float | None] = (None, None, None)
    area_max_mm: tuple[float | None, float | None, float | None] = (None, None, None)
    is_area_limited: bool = True
    spindle_min_rpm: float = 0.0
    spindle_max_rpm: float = 0.0
    machine_max_rpm: float = math.inf
    last_motion: Motion | None = None
    unmodelled: Mapping[str, str] = field(default_factory=dict)
    message: str = ""
    is_ended: bool = False

    @property
    def tangent(self) -> Vector | None:
        """Unit direction in which the last move arrived, or None."""
        return None if self.last_motion is None else end_tangent(self.last_motion)

    @property
    def is_plain(self) -> bool:
        """Whether G1 blocks with X, Y, Z and F mean straight cuts at F mm/min to these coordinates, shifted at most."""
        return (
            (self.motion, self.dimension, self.feed_type, self.compensation) == ("G1", "G90", "G94", "G40")
            and not self.is_inch
            and not self.is_feed_inch
            and self.feed is not None
            and self.feed_axes is None
            and self.frame.is_identity_matrix
            and self.area_min_mm == self.area_max_mm == (None, None, None)
        )

    @property
    def limited_rpm(self) -> float:
        """The speed S asks for, within G25, G26 and what the machine turns."""
        upper = min(self.spindle_max_rpm or self.machine_max_rpm, self.machine_max_rpm)
        return min(max(self.spindle_rpm, self.spindle_min_rpm), upper)

    @property
    def is_inch(self) -> bool:
        """Whether dimensions are inches (G70, G700)."""
        return self.units in ("G70", "G700")

    @property
    def is_feed_inch(self) -> bool:
        """Whether feeds are inches too: G700, and on an inch machine whatever is not G710."""
        return self.units == "G700" or (self.is_machine_inch and self.units != "G710")

    @property
    def plane_axes(self) -> tuple[int, int, int]:
        """Indices of the first and second axis of the working plane, and of its normal."""
        return {"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)}[self.plane]
