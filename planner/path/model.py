"""The values every room of the planner meets: points, passes, the tool path.

Coordinates mm, work frame, tool axis +Z.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Method(Enum):
    """How a bound was established; the report says which."""

    PROVED = "proved"
    SAMPLED = "sampled"


class Cut(Enum):
    """Which way a pass runs against its driving plane's direction."""

    FORWARD = "forward"
    BACKWARD = "backward"


@dataclass(frozen=True, slots=True)
class DrivingPlane:
    """A plane that contains the tool axis: points origin + w direction + z (0, 0, 1).

    `angle_rad` is the direction of w in XY against +X; `offset_mm` the plane's distance from the work origin
    along its normal (-sin, cos, 0), so that passes of one operation share the angle and differ in the offset.
    """

    angle_rad: float
    offset_mm: float

    @property
    def direction(self) -> Array:
        """Unit vector of w in work coordinates, shape (3,)."""
        return np.array([np.cos(self.angle_rad), np.sin(self.angle_rad), 0.0])

    @property
    def normal(self) -> Array:
        """Unit normal of the plane, horizontal, shape (3,)."""
        return np.array([-np.sin(self.angle_rad), np.cos(self.angle_rad), 0.0])

    def to_work(self, plane_points: Array) -> Array:
        """Plane points (m, 2) of (w, z) as work points (m, 3), mm."""
        base = self.offset_mm * self.normal
        lift = np.array([0.0, 0.0, 1.0])
        return np.asarray(base + plane_points[:, :1] * self.direction + plane_points[:, 1:2] * lift)

    def to_plane(self, points: Array) -> Array:
        """Work points (m, 3) as plane points (m, 2) of (w, z), mm; the distance from the plane is dropped."""
        return np.stack([points @ self.direction, points[:, 2]], axis=1)


@dataclass(frozen=True, slots=True)
class PlaneSpline:
    """A clamped B-spline in a driving plane, in (w, z): the CL curve (ball centre) of one pass.

    `control_points` has shape (n, 2), mm; `knots` shape (n + degree + 1,), non-decreasing, scaled so that the whole
    length is about the curve's length in mm (facts on the control's PL word: rounding must not distort).
    """

    degree: int
    knots: Array
    control_points: Array


@dataclass(frozen=True, slots=True)
class Polyline:
    """Straight moves through these plane points (w, z), shape (n, 2), mm; vertices may lie off the exact curve."""

    points: Array


@dataclass(frozen=True, slots=True)
class ArcChain:
    """Arcs and lines in a driving plane: from `points[i]` to `points[i + 1]` about `centres[i]`.

    `points` (n + 1, 2), `centres` (n, 2), mm, (w, z); `turns` (n,): +1 counter-clockwise seen with w to the right and
    z up, -1 clockwise, 0 a straight line (its centre is ignored).
    """

    points: Array
    centres: Array
    turns: NDArray[np.int8]


Shape = PlaneSpline | Polyline | ArcChain


@dataclass(frozen=True, slots=True)
class Pass:
    """One traced curve of ball centres, as it will be written.

    `deviation_mm` bounds the distance between `shape` and the exact intersection of offset surface and plane, both
    ways; `method` says whether it is proved or sampled. `shape` runs the way the tool cuts. `break_points` (m, 2) are
    Lartigue's points of interpolation, empty where the fit uses none.
    """

    plane: DrivingPlane
    shape: Shape
    deviation_mm: float
    method: Method
    break_points: Array
    length_mm: float


@dataclass(frozen=True, slots=True)
class ToolPath:
    """The ordered passes of one operation with one ball of this radius.

    `pick_feeds_mm` (passes - 1,) are the distances between neighbouring driving planes; `scallops_mm` (passes - 1,)
    the largest scallop height of each gap, measured between the two real passes.
    """

    passes: tuple[Pass, ...]
    radius_mm: float
    pick_feeds_mm: Array
    scallops_mm: Array
    scallop_method: Method
