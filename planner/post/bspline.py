"""Cubic B-splines as BSPLINE blocks: a control point and a knot interval (PL) in every block.

Rule `nx` (a vendor's post): the point before BSPLINE is P0, the blocks carry P1 ... Pn-1 with PL(i) = U(i+2) - U(i+1),
so the first and the last PL are 0. Rule `genua` writes P0 too, with PL(i) = U(i+3) - U(i+2). Only the ratios of the
knots matter, so each pass has its own scale, on which all intervals are short and mostly whole numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from planner.gcode.words import decimal_text
from planner.path.model import Array, Pass, PlaneSpline
from planner.path.spans import bezier_points, in_work, joints_of, power_form
from planner.post.digits import Digits, fewest_digits
from planner.post.numbers import rounded_mm, to_units
from planner.post.passtext import AXES, PassText, Point, is_constant
from planner.post.rounding import SpanChain, path_bound_mm

KnotRule = Literal["nx", "genua"]
_KNOT_DIGITS = 8
_WHOLE_DIGITS = 4  # the largest interval written: PL is read up to 99999.9999


@dataclass(frozen=True, slots=True)
class _Curve:
    """One pass: its spline, its control points in work coordinates (n, 3) and its exact spans."""

    spline: PlaneSpline
    points: Array
    exact: SpanChain
    is_still: NDArray[np.bool_]


def bspline_passes(
    passes: Sequence[Pass],
    drop_z_mm: float,
    budgets_mm: Array,
    fine: Digits,
    most_decimals: int,
    *,
    knot_rule: KnotRule,
    min_blocks: int,
) -> list[PassText]:
    """Every pass as BSPLINE blocks with the fewest digits that keep its path within `budgets_mm`.

    Knots are inserted until a pass has `min_blocks` blocks. Raises ValueError for splines that are not cubic.
    """
    curves = [_curve_of(one, drop_z_mm, min_blocks) for one in passes]
    finest = np.minimum(fine + 1, most_decimals)
    least = np.stack([fine, fine, np.full(len(curves), _WHOLE_DIGITS)], axis=1)
    knot_digits = min(_KNOT_DIGITS, _WHOLE_DIGITS + most_decimals)
    most = np.stack([finest, finest, np.full(len(curves), knot_digits)], axis=1)
    ends = fine.tolist()

    def bound_mm(digits: Digits) -> Array:
        return np.array([_bound_mm(curve, row, end) for curve, row, end in zip(curves, digits, ends, strict=True)])

    digits, bounds = fewest_digits(least, most, np.array([1.0, 1.1, 0.9]), bound_mm, budgets_mm)
    return [
        _pass_text(curve, row, end, bound, knot_rule)
        for curve, row, end, bound in zip(curves, digits, ends, bounds.tolist(), strict=True)
    ]


def with_blocks(spline: PlaneSpline, least_points: int) -> PlaneSpline:
    """The same curve with at least so many control points: the widest span is halved until there are enough."""
    while len(spline.control_points) < least_points:
        inner = spline.knots[spline.degree : len(spline.control_points) + 1]
        widest = int(np.argmax(np.diff(inner)))
        spline = _with_knot(spline, (inner[widest] + inner[widest + 1]) / 2.0)
    return spline


def _with_knot(spline: PlaneSpline, knot: float) -> PlaneSpline:
    """Boehm's insertion of one knot: the curve stays, one control point is added."""
    degree, knots, points = spline.degree, spline.knots, spline.control_points
    span = int(np.searchsorted(knots, knot, side="right")) - 1
    moved = np.arange(span - degree + 1, span + 1)
    share = ((knot - knots[moved]) / (knots[moved + degree] - knots[moved]))[:, None]
    between = (1.0 - share) * points[moved - 1] + share * points[moved]
    grown = np.concatenate([points[: span - degree + 1], between, points[span:]])
    return PlaneSpline(degree, np.insert(knots, span + 1, knot), grown)


def _curve_of(one: Pass, drop_z_mm: float, min_blocks: int) -> _Curve:
    assert isinstance(one.shape, PlaneSpline)
    if one.shape.degree != 3:
        raise ValueError("BSPLINE blocks are written for cubics")
    spline = with_blocks(one.shape, min_blocks + 1)
    work = in_work(one.plane, bezier_points([spline]), drop_z_mm)
    number = np.arange(len(work))
    exact = SpanChain.of(power_form(work), np.diff(joints_of(spline)), number == 0, number == len(work) - 1)
    return _Curve(spline, in_work(one.plane, spline.control_points, drop_z_mm), exact, is_constant(one.plane))


def _intervals(spline: PlaneSpline, digits: int) -> NDArray[np.int64]:
    """Knot intervals U(i+1) - U(i), whole numbers on a scale where the longest span has so many digits.

    No span that is not empty may vanish, and equal spans stay equal.
    """
    steps = np.diff(spline.knots)
    units = to_units(steps * 10.0**digits / steps.max(), 0)
    return np.where((steps > 0.0) & (units == 0), 1, units)


def _point_decimals(curve: _Curve, digits: Digits, fine: int) -> Digits:
    decimals = np.tile(np.array([digits[0], digits[0], digits[1]]), (len(curve.points), 1))
    decimals[[0, -1]] = fine
    decimals[:, curve.is_still] = fine
    return decimals


def _bound_mm(curve: _Curve, digits: Digits, fine: int) -> float:
    points = rounded_mm(curve.points, _point_decimals(curve, digits, fine))
    knots = np.concatenate([[0.0], np.cumsum(_intervals(curve.spline, int(digits[2])))])
    written = power_form(bezier_points([PlaneSpline(3, knots.astype(np.float64), points)]))
    return float(path_bound_mm(curve.exact, written).max())


def _pass_text(curve: _Curve, digits: Digits, fine: int, bound_mm: float, knot_rule: KnotRule) -> PassText:
    decimals = _point_decimals(curve, digits, fine)
    units = to_units(curve.points, decimals)
    texts = [
        [decimal_text(unit, place) for unit, place in zip(row, places, strict=True)]
        for row, places in zip(units.tolist(), decimals.tolist(), strict=True)
    ]
    intervals = _interval_texts(curve.spline, int(digits[2]))
    first, offset = (1, 1) if knot_rule == "nx" else (0, 2)
    blocks = []
    for number in range(first, len(texts)):
        before = texts[max(number - 1, 0)]
        words = "".join(AXES[axis] + texts[number][axis] for axis in range(3) if texts[number][axis] != before[axis])
        blocks.append(f"{words}PL={intervals[number + offset]}")
    if knot_rule == "genua":
        blocks[0] = "".join(AXES[axis] + texts[0][axis] for axis in (0, 2)) + blocks[0]
    blocks[0] = f"BSPLINE {blocks[0]}"
    return PassText(Point.of(curve.points[0], fine), Point.of(curve.points[-1], fine), tuple(blocks), bound_mm)


def _interval_texts(spline: PlaneSpline, digits: int) -> list[str]:
    """The intervals as PL says them: divided by their greatest common divisor, with decimals where they are long."""
    units = _intervals(spline, digits)
    units = units // max(int(np.gcd.reduce(units)), 1)
    decimals = max(len(str(units.max())) - _WHOLE_DIGITS - 1, 0)
    return [decimal_text(unit, decimals) for unit in units.tolist()]
