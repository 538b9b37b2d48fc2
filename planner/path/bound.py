"""How far written splines can be from their exact curves: bounds over the whole pass, both ways, ends included.

At exact nodes of the curve the distance to the spline and its slope are known; between them its second derivative is
the difference of two curvatures, (F10), whose change is enclosed. A cubic Hermite interpolant and a remainder then
bound the distance everywhere, (F11). Nodes are added where the remainder is a large part of the bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.path.curve import ExactCurve
from planner.path.model import Array, Method, PlaneSpline
from planner.path.plane_spline import Index
from planner.path.slope_range import SlopeSource, slope_source
from planner.path.spline_table import SplineTable

ROUNDS = 6
LARGEST_SLOPE = 0.2


@dataclass(frozen=True, slots=True)
class _Marks:
    """Exact nodes of all curves in one list: `rows` (k,), `arc_mm`, `points` (k, 2), `tangents`, `curvatures`."""

    rows: Index
    arc_mm: Array
    points: Array
    tangents: Array
    curvatures: Array


@dataclass(frozen=True, slots=True)
class _Parts:
    """What bounds each interval between marks of one row: `first` (k,) is its left mark."""

    first: Index
    peak_mm: Array
    rest_mm: Array


def certify(curve: ExactCurve, spline: PlaneSpline) -> tuple[float, Method]:
    """An upper bound (mm) on the distance between spline and exact curve, each from the other, and how it is known."""
    return certify_all([curve], [spline])[0]


def certify_all(curves: Sequence[ExactCurve], splines: Sequence[PlaneSpline]) -> list[tuple[float, Method]]:
    """A bound for every pair of curve and spline, worked through together; infinite where none could be given.

    PROVED rests on (F10) to (F13), to the rounding of doubles; SAMPLED estimates the change of curvature from nodes.
    """
    table, source = SplineTable(splines), slope_source(curves)
    marks = _own_marks(curves)
    for _ in range(ROUNDS):
        parts, ends_mm = _bound_parts(table, source, marks)
        worst_peak = np.zeros(len(curves))
        owner = marks.rows[parts.first]
        np.maximum.at(worst_peak, owner, parts.peak_mm)
        is_loose = parts.rest_mm > 0.1 * worst_peak[owner] + 1e-9
        # Only an interval that could be the worst of its row is worth another node.
        is_loose &= parts.peak_mm + parts.rest_mm > 1.03 * worst_peak[owner]
        if not is_loose.any():
            break
        marks = _add_marks(curves, marks, parts.first[is_loose])
    total = np.zeros(len(curves))
    np.maximum.at(total, owner, parts.peak_mm + parts.rest_mm)
    total = np.maximum(total, ends_mm)
    return [(float(value), source.method) for value in total]


def _own_marks(curves: Sequence[ExactCurve]) -> _Marks:
    return _Marks(
        np.repeat(np.arange(len(curves)), [curve.arc_mm.size for curve in curves]),
        np.concatenate([curve.arc_mm for curve in curves]),
        np.concatenate([curve.points for curve in curves]),
        np.concatenate([curve.tangents for curve in curves]),
        np.concatenate([curve.curvatures for curve in curves]),
    )


def _add_marks(curves: Sequence[ExactCurve], marks: _Marks, first: Index) -> _Marks:
    """The marks with one more half-way after each of these, exact."""
    rows, arc = marks.rows[first], 0.5 * (marks.arc_mm[first] + marks.arc_mm[first + 1])
    fresh = [curves[row].refine(arc[rows == row]) for row in np.unique(rows)]
    place = first + 1
    return _Marks(
        np.insert(marks.rows, place, rows),
        np.insert(marks.arc_mm, place, arc),
        np.insert(marks.points, place, np.concatenate([part.points for part in fresh]), axis=0),
        np.insert(marks.tangents, place, np.concatenate([part.tangents for part in fresh]), axis=0),
        np.insert(marks.curvatures, place, np.concatenate([part.curvatures for part in fresh])),
    )


def _bound_parts(table: SplineTable, source: SlopeSource, marks: _Marks) -> tuple[_Parts, Array]:
    """The parts of the bound for every interval, and what the ends (p,) add, mm."""
    feet = _feet(table, marks)
    points, velocity, bend = table.evaluate(marks.rows, feet)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    ahead = velocity / speed[:, None]
    gap = marks.points - points
    height = gap[:, 1] * ahead[:, 0] - gap[:, 0] * ahead[:, 1]
    slope = ahead[:, 0] * marks.tangents[:, 1] - ahead[:, 1] * marks.tangents[:, 0]
    spline_bend = (velocity[:, 0] * bend[:, 1] - velocity[:, 1] * bend[:, 0]) / speed**3
    first = np.flatnonzero(np.diff(marks.rows) == 0)
    rows, step = marks.rows[first], marks.arc_mm[first + 1] - marks.arc_mm[first]
    peak = hermite_peaks(height[first], height[first + 1], slope[first] * step, slope[first + 1] * step)
    curve_low, curve_high = source.enclose(rows, marks.arc_mm[first], marks.arc_mm[first + 1])
    spline_low, spline_high = table.slope_range(rows, feet[first], feet[first + 1])
    mean = (marks.curvatures - spline_bend)[first + 1] - (marks.curvatures - spline_bend)[first]
    # The two curvatures cannot drift apart faster than this, nor closer; (F11) bounds what that can hide.
    stretch = 1e-3 * np.maximum(np.abs(spline_low), np.abs(spline_high))
    low, high = curve_low - spline_high - stretch, curve_high - spline_low + stretch
    low, high = np.minimum(low, mean / step), np.maximum(high, mean / step)
    hidden = (high * step - mean) * (mean - low * step) / np.maximum((high - low) * step, np.finfo(float).tiny)
    drift = np.maximum(np.abs(slope[first]), np.abs(slope[first + 1])) + hidden * step + np.abs(mean) * step
    lift = np.maximum(np.abs(height[first]), np.abs(height[first + 1])) + drift * step
    largest_bend = np.maximum(np.abs(spline_bend[first]), np.abs(spline_bend[first + 1])) + step * np.maximum(
        np.abs(spline_low), np.abs(spline_high)
    )
    tilt = 1.1 * (drift + np.abs(slope[first]))
    small = largest_bend * (2 * tilt**2 + 2 * largest_bend * lift)
    rest = step**2 / 16 * (hidden + small)
    is_sound = (tilt < LARGEST_SLOPE) & (largest_bend * lift < LARGEST_SLOPE) & (feet[first + 1] > feet[first])
    rest = np.where(is_sound, rest, np.inf)
    return _Parts(first, peak, rest), _end_gaps(table, marks)


def _end_gaps(table: SplineTable, marks: _Marks) -> Array:
    """Distances (p,) between the ends of curves and splines, the larger of both ends."""
    rows = np.arange(len(table.first_knot))
    starts = np.searchsorted(marks.rows, rows)
    stops = np.append(starts[1:], len(marks.rows)) - 1
    begin = table.evaluate(rows, table.first_knot)[0] - marks.points[starts]
    end = table.evaluate(rows, table.last_knot)[0] - marks.points[stops]
    return np.asarray(np.maximum(np.hypot(begin[:, 0], begin[:, 1]), np.hypot(end[:, 0], end[:, 1])))


def _feet(table: SplineTable, marks: _Marks) -> Array:
    """Parameters (k,) of the spline points whose normals pass through the marks; end pieces go on beyond the ends."""
    starts = np.searchsorted(marks.rows, np.arange(len(table.first_knot)))
    feet = table.parameters_at(marks.rows, marks.arc_mm - marks.arc_mm[starts][marks.rows])
    for _ in range(12):
        points, velocity, bend = table.evaluate(marks.rows, feet)
        gap = points - marks.points
        miss = (gap * velocity).sum(axis=1)
        square = (velocity**2).sum(axis=1)
        feet = feet - miss / np.maximum(square + (gap * bend).sum(axis=1), 0.1 * square)
        if (np.abs(miss) <= 1e-13 * np.sqrt(square)).all():
            break
    return np.asarray(feet)


def hermite_peaks(y0: Array, y1: Array, d0: Array, d1: Array) -> Array:
    """Largest size (k,) on [0, 1] of the cubic with these end values and end slopes."""
    c2, c3 = 3 * (y1 - y0) - 2 * d0 - d1, 2 * (y0 - y1) + d0 + d1
    peaks = np.maximum(np.abs(y0), np.abs(y1))
    root = np.sqrt(np.maximum(c2**2 - 3 * c3 * d0, 0.0))
    # The two stationary points without cancellation; a vanishing cubic gives an infinity that is not inside.
    pivot = -(c2 + np.copysign(root, c2))
    with np.errstate(divide="ignore", invalid="ignore"):
        for place in (pivot / (3 * c3), d0 / pivot):
            inside = np.where((place > 0) & (place < 1), place, 0.0)
            peaks = np.maximum(peaks, np.abs(y0 + inside * (d0 + inside * (c2 + inside * c3))))
    return np.asarray(peaks)
