"""How far written splines can be from their exact curves: bounds over the whole pass, both ways, ends included.

At exact nodes of the curve the distance to the spline and its slope are known; between them its second derivative is
the difference of two curvatures, (F10), whose change is enclosed. A cubic Hermite interpolant and a remainder then
bound the distance everywhere, (F11). Nodes are added where the remainder is a large part of the bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from planner.path.curve import Exact, ExactCurve, exact_at
from planner.path.model import Array, Method, PlaneSpline
from planner.path.plane_spline import Index
from planner.path.slope_range import SampledSlopes, SlopeSource, slope_source
from planner.path.slope_table import SlopeTable
from planner.path.spline_table import SplineTable
from planner.path.trace import TracedCurve

ROUNDS = 4
FOOT_STEPS = 8
PARTS = 4  # of an interval whose bound is loose
CLOSE_ENOUGH = 1.05
HALVINGS = 2  # of the nodes' distance, before a bound is taken from samples


@dataclass(frozen=True, slots=True)
class _Marks:
    """Exact nodes (k,) of all curves, each with its place `feet` on its spline, and the distance there.

    `height` is the signed distance along the spline's normal, mm, `slope` its derivative by the curve's arc length,
    `drift` the curve's curvature less the spline's, `bend` the spline's.
    """

    rows: Index
    arc_mm: Array
    feet: Array
    height: Array
    slope: Array
    drift: Array
    bend: Array

    def take(self, chosen: Index) -> _Marks:
        """These marks."""
        return _Marks(*(getattr(self, field.name)[chosen] for field in fields(_Marks)))

    def joined(self, more: _Marks) -> _Marks:
        """These marks and then others."""
        return _Marks(*(np.append(getattr(self, field.name), getattr(more, field.name)) for field in fields(_Marks)))


def certify_all(
    curves: Sequence[ExactCurve], splines: Sequence[PlaneSpline], table: SlopeTable | None = None
) -> list[tuple[float, Method]]:
    """A bound for every pair of curve and spline, worked through together; infinite where none could be given.

    PROVED rests on (F10) to (F15), to the rounding of doubles; SAMPLED estimates the change of curvature from nodes.
    `table` is `patch_table(curves)` if the caller has it.
    """
    source = slope_source(curves, table)
    found = [(float(bound), source.method) for bound in _bounds(curves, splines, source)]
    closer = list(curves)
    for turn in range(HALVINGS + 1):
        open_ = [row for row, (bound_mm, method) in enumerate(found) if method is Method.PROVED and np.isinf(bound_mm)]
        if not open_:
            break
        # Between nodes too far apart no box is known to hold the curve.
        for row in open_:
            curve = closer[row]
            closer[row] = curve.halved() if isinstance(curve, TracedCurve) else curve
        some = [closer[row] for row in open_]
        again = slope_source(some, table) if turn < HALVINGS else SampledSlopes(some)
        for row, bound in zip(open_, _bounds(some, [splines[row] for row in open_], again), strict=True):
            found[row] = float(bound), again.method
    return found


def _bounds(curves: Sequence[ExactCurve], splines: Sequence[PlaneSpline], source: SlopeSource) -> Array:
    """Bounds (p,), mm, with nodes added where they make a bound smaller."""
    table = SplineTable(splines)
    marks = _mark_nodes(table, curves)
    first = np.flatnonzero(np.diff(marks.rows) == 0)
    left, right = marks.take(first), marks.take(first + 1)
    total, highest = _end_gaps(table, curves), np.zeros(len(curves))
    for turn in range(ROUNDS + 1):
        peak, rest = _bound_intervals(table, source, left, right)
        np.maximum.at(highest, left.rows, peak)
        # Only an interval that could be the worst of its row is worth another node.
        so_far = np.maximum(highest, total)[left.rows]
        is_loose = (peak + rest > CLOSE_ENOUGH * so_far) & (rest > 1e-10) & (turn < ROUNDS)
        # What parts do not bound either, smaller parts hardly ever do, and there would be very many of them.
        is_loose &= np.isfinite(rest) | (turn <= 1)
        np.maximum.at(total, left.rows[~is_loose], (peak + rest)[~is_loose])
        if not is_loose.any():
            break
        chosen = np.flatnonzero(is_loose)
        left, right = left.take(chosen), right.take(chosen)
        shares = np.arange(1, PARTS)[:, None] / PARTS
        rows = np.tile(left.rows, PARTS - 1)
        arc = (left.arc_mm + shares * (right.arc_mm - left.arc_mm)).ravel()
        near = (left.feet + shares * (right.feet - left.feet)).ravel()
        inner = _mark(table, rows, arc, near, exact_at(curves, rows, arc))
        left, right = left.joined(inner), inner.joined(right)
    return total


def node_distances(curves: Sequence[ExactCurve], splines: Sequence[PlaneSpline]) -> Array:
    """The largest distance (p,), mm, of each curve's own nodes from its spline: no bound, but quickly had."""
    marks = _mark_nodes(SplineTable(splines), curves)
    largest = np.zeros(len(curves))
    np.maximum.at(largest, marks.rows, np.abs(marks.height))
    return largest


def _mark_nodes(table: SplineTable, curves: Sequence[ExactCurve]) -> _Marks:
    """Marks at the curves' own nodes."""
    rows = np.repeat(np.arange(len(curves)), [curve.arc_mm.size for curve in curves])
    arc = np.concatenate([curve.arc_mm - curve.arc_mm[0] for curve in curves])
    known = Exact(*(np.concatenate([getattr(curve, field.name) for curve in curves]) for field in fields(Exact)))
    return _mark(table, rows, arc, table.parameters_at(rows, arc), known)


def _mark(table: SplineTable, rows: Index, arc_mm: Array, near: Array, exact: Exact) -> _Marks:
    """Marks at these places of the exact curves, from parameters near their feet, (F10)."""
    feet = near
    for _ in range(FOOT_STEPS):
        points, velocity, bend = table.evaluate(rows, feet)
        gap = points - exact.points
        square = (velocity**2).sum(axis=1)
        change = np.maximum(square + (gap * bend).sum(axis=1), 0.1 * square)
        step = (gap * velocity).sum(axis=1) / change
        feet = feet - step
        if np.abs(step).max(initial=0.0) < 1e-9:
            break
    points, velocity, bend = table.evaluate(rows, feet)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    ahead, gap = velocity / speed[:, None], exact.points - points
    spline_bend = (velocity[:, 0] * bend[:, 1] - velocity[:, 1] * bend[:, 0]) / speed**3
    return _Marks(
        rows,
        arc_mm,
        feet,
        height=gap[:, 1] * ahead[:, 0] - gap[:, 0] * ahead[:, 1],
        slope=ahead[:, 0] * exact.tangents[:, 1] - ahead[:, 1] * exact.tangents[:, 0],
        drift=exact.curvatures - spline_bend,
        bend=spline_bend,
    )


def _bound_intervals(table: SplineTable, source: SlopeSource, left: _Marks, right: _Marks) -> tuple[Array, Array]:
    """The peak (k,) of the Hermite interpolant between two marks each, mm, and the remainder beside it, (F11)."""
    step = right.arc_mm - left.arc_mm
    peak = hermite_peaks(left.height, right.height, left.slope * step, right.slope * step)
    curve_low, curve_high, jumps = source.enclose(left.rows, left.arc_mm, right.arc_mm)
    spline_low, spline_high = table.slope_range(left.rows, left.feet, right.feet)
    steepest = np.maximum(np.abs(spline_low), np.abs(spline_high))
    # A mm of the curve is a mm of the spline to better than a thousandth, which the soundness below ensures.
    low, high = curve_low - spline_high - 1e-3 * steepest, curve_high - spline_low + 1e-3 * steepest
    rise = right.drift - left.drift
    low, high = np.minimum(low, rise / step), np.maximum(high, rise / step)
    # An open-ended enclosure makes everything after it not a number, which is not sound.
    with np.errstate(invalid="ignore", over="ignore"):
        hidden = (high * step - rise) * (rise - low * step) / np.maximum((high - low) * step, np.finfo(float).tiny)
        # What is no jump turns with an unknown mean slope; a jump leaves the chord by no more than itself, (F23).
        hidden = np.where(jumps > 0, (high - low) * step / 4 + jumps, hidden)
        pull = np.maximum(np.abs(left.drift), np.abs(right.drift)) + hidden
        tilt = np.maximum(np.abs(left.slope), np.abs(right.slope)) + 1.1 * pull * step
        lift = np.maximum(np.abs(left.height), np.abs(right.height)) + 1.1 * tilt * step
        bend = np.maximum(np.abs(left.bend), np.abs(right.bend)) + steepest * step
        neglected = (bend + pull) * (tilt**2 + 2 * bend * lift)
        is_sound = (tilt**2 + 2 * bend * lift < 1e-3) & (right.feet > left.feet)
        # The second term is for arc lengths that are wrong by 1e-4 of a step.
        rest = 1.001 * step**2 / 16 * (hidden + 2 * neglected) + 3e-5 * tilt * step
    return peak, np.where(is_sound, rest, np.inf)


def _end_gaps(table: SplineTable, curves: Sequence[ExactCurve]) -> Array:
    """Distances (p,) between the ends of curves and splines, the larger of both ends, (F13)."""
    rows = np.arange(len(curves))
    begin = table.evaluate(rows, table.first_knot)[0] - np.array([curve.points[0] for curve in curves])
    end = table.evaluate(rows, table.last_knot)[0] - np.array([curve.points[-1] for curve in curves])
    return np.asarray(np.maximum(np.hypot(begin[:, 0], begin[:, 1]), np.hypot(end[:, 0], end[:, 1])))


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
