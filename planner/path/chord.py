"""Lartigue's rule for break points, and the interpolating spline through them: the paper's way, kept to compare.

Source: Lartigue, Thiebaut, Maekawa, Computer-Aided Design 33 (2001) 307-319; see EQUATIONS-fitting.md.
"""

from __future__ import annotations

from enum import Enum

import numpy as np

from planner.path.bound import certify_all, node_distances
from planner.path.curve import ExactCurve
from planner.path.model import Array, PlaneSpline
from planner.path.plane_spline import basis, find_spans
from planner.path.slope_table import SlopeTable
from planner.path.spline import FittedSpline

CIRCLE_FACTOR = 30.0
LONGEST_STEP_IN_RADII = 4.0


class EndRule(Enum):
    """What the interpolating spline obeys at its ends."""

    TANGENT = "the exact tangents of the curve"
    NATURAL = "no curvature"


def paper_break_points(curve: ExactCurve, tolerance_mm: float, radius_mm: float) -> Array:
    """Arc lengths (k,) of the break points, mm, both ends included.

    From each break point the curve is taken for its osculating circle, and the next one lies where the chord is 30
    tolerances off that circle, at most four ball radii away.
    """
    sag_mm, longest_mm = CIRCLE_FACTOR * tolerance_mm, LONGEST_STEP_IN_RADII * radius_mm
    places, end_mm = [float(curve.arc_mm[0])], float(curve.arc_mm[-1])
    while places[-1] < end_mm:
        bend = abs(float(np.interp(places[-1], curve.arc_mm, curve.curvatures)))
        step_mm = longest_mm
        if bend * sag_mm < 1.0 and bend > 0.0:
            step_mm = min(longest_mm, 4.0 * float(np.arcsin(np.sqrt(0.5 * bend * sag_mm))) / bend)
        places.append(min(places[-1] + step_mm, end_mm))
    return np.array(places)


def paper_spline(
    curve: ExactCurve,
    tolerance_mm: float,
    radius_mm: float,
    ends: EndRule = EndRule.TANGENT,
    table: SlopeTable | None = None,
) -> tuple[FittedSpline, Array]:
    """The cubic B-spline through the break points, with its bound, and the break points (k, 2).

    The rule does not keep its tolerance: `deviation_mm` says what it really reaches. `table` is the patch's, where
    many curves of one patch are fitted in turn.
    """
    spline, points = through_break_points(curve, tolerance_mm, radius_mm, ends)
    ((deviation_mm, method),) = certify_all([curve], [spline], table)
    return FittedSpline(spline, deviation_mm, method), points


def paper_spline_within(
    curve: ExactCurve, tolerance_mm: float, radius_mm: float, table: SlopeTable | None, steps: int = 60
) -> tuple[FittedSpline, Array] | None:
    """The same with break points closer and closer together until the bound keeps the tolerance; None if it never does.

    Only what keeps it at the curve's own nodes is worth a proof.
    """
    asked_mm = tolerance_mm
    for _ in range(steps):
        spline, points = through_break_points(curve, asked_mm, radius_mm, EndRule.TANGENT)
        if node_distances([curve], [spline])[0] <= tolerance_mm:
            ((deviation_mm, method),) = certify_all([curve], [spline], table)
            if deviation_mm <= tolerance_mm:
                return FittedSpline(spline, deviation_mm, method), points
        asked_mm *= 0.7
    return None


def through_break_points(
    curve: ExactCurve, tolerance_mm: float, radius_mm: float, ends: EndRule
) -> tuple[PlaneSpline, Array]:
    """The cubic B-spline through the break points, its parameter the arc length, and the break points (k, 2)."""
    arc = paper_break_points(curve, tolerance_mm, radius_mm)
    samples = curve.refine(arc)
    return interpolate(arc - arc[0], samples.points, samples.tangents[[0, -1]], ends), samples.points


def interpolate(parameters: Array, points: Array, end_tangents: Array, ends: EndRule) -> PlaneSpline:
    """The cubic spline through points (k, 2) at parameters (k,), which are its knots."""
    knots = np.concatenate([np.repeat(parameters[:1], 3), parameters, np.repeat(parameters[-1:], 3)])
    spans = find_spans(knots[None, :], parameters[None, :])
    values, slopes, bends = (part[:, 0, :] for part in basis(knots[None, :], parameters[None, :], spans))
    count = len(parameters) + 2
    matrix, right = np.zeros((count, count)), np.zeros((count, 2))
    for row, place in enumerate(spans[0]):
        matrix[row + 1, place - 3 : place + 1] = values[:, row]
    right[1:-1] = points
    condition = slopes if ends is EndRule.TANGENT else bends
    for row, at in ((0, 0), (count - 1, len(parameters) - 1)):
        matrix[row, spans[0, at] - 3 : spans[0, at] + 1] = condition[:, at]
        right[row] = end_tangents[0 if row == 0 else 1] if ends is EndRule.TANGENT else 0.0
    return PlaneSpline(3, knots, np.asarray(np.linalg.solve(matrix, right), dtype=np.float64))
