"""Spline spans as polynomials: B-splines from control points and knots, Akima and cubic splines through points.

Pure functions of points (mm). Sources: the blossom for B-splines (Ramshaw), Akima 1970 for ASPLINE, the tridiagonal
system of the C2 cubic for CSPLINE; parameters of both run with the chord length.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from sim.interpreter.canon import Vector
from sim.interpreter.frames import add, norm, scaled, subtract


@dataclass(frozen=True, slots=True)
class Curve:
    """One span, p from 0 to `length`; the fields mean what canon.Polynomial says."""

    coefficients: tuple[Vector, ...]
    denominator: tuple[float, ...]
    length: float
    end: Vector


def bspline_span(points: Sequence[Vector], weights: Sequence[float], knots: Sequence[float]) -> Curve:
    """The span of a B-spline that these degree + 1 control points and 2 degree knots around it determine.

    The span runs from knots[degree - 1] to knots[degree]; weights all 1 give a denominator of (1.0,).
    """
    degree = len(points) - 1
    left, right = knots[degree - 1], knots[degree]
    length = right - left
    is_rational = any(weight != 1.0 for weight in weights)
    shares = _shares(knots, degree)
    columns = [[point[axis] * weight for point, weight in zip(points, weights, strict=True)] for axis in range(3)]
    bezier = [_bezier(column, shares) for column in columns]
    last = _bezier(list(weights), shares) if is_rational else [1.0] * (degree + 1)
    powers = [_powers(column, length, last[0]) for column in bezier]
    coefficients = tuple((powers[0][k], powers[1][k], powers[2][k]) for k in range(degree + 1))
    denominator = tuple(_powers(last, length, last[0])) if is_rational else (1.0,)
    end = (bezier[0][-1] / last[-1], bezier[1][-1] / last[-1], bezier[2][-1] / last[-1])
    return Curve(coefficients, denominator, length, end)


Shares = list[list[list[float]]]


def _shares(knots: Sequence[float], degree: int) -> Shares:
    """How each step of the blossoms at `degree - k` times the left end and k times the right divides its intervals."""
    found = []
    for k in range(degree + 1):
        steps = []
        for step in range(1, degree + 1):
            at = knots[degree] if step <= k else knots[degree - 1]
            ends = ((knots[i + step - 1], knots[i + degree]) for i in range(degree + 1 - step))
            steps.append([(at - left) / (right - left) for left, right in ends])
        found.append(steps)
    return found


def _bezier(values: list[float], shares: Shares) -> list[float]:
    """Bezier values of the span: its blossoms, one for each k."""
    found = []
    for steps in shares:
        row = values
        for step in steps:
            row = [
                a if share == 0.0 else b if share == 1.0 else (1.0 - share) * a + share * b
                for a, b, share in zip(row, row[1:], step, strict=False)
            ]
        found.append(row[0])
    return found


def _powers(bezier: list[float], length: float, unit: float) -> list[float]:
    """Power coefficients on [0, length] of Bezier values, divided by `unit`."""
    degree, row, found = len(bezier) - 1, list(bezier), []
    for k in range(degree + 1):
        found.append(math.comb(degree, k) * row[0] / (length**k * unit))
        row = [b - a for a, b in pairwise(row)]
    return found


def hermite_span(start: Vector, end: Vector, leaving: Vector, arriving: Vector, length: float) -> Curve:
    """The cubic with these ends and derivatives with respect to p on [0, length]."""
    slope = scaled(subtract(end, start), 1.0 / length)
    second = scaled(subtract(scaled(slope, 3.0), add(scaled(leaving, 2.0), arriving)), 1.0 / length)
    third = scaled(subtract(add(leaving, arriving), scaled(slope, 2.0)), 1.0 / length**2)
    return Curve((start, leaving, second, third), (1.0,), length, end)


def akima_tangent(before: Vector, left: Vector, right: Vector, after: Vector) -> Vector:
    """Derivative at a point from the four slopes around it (Akima 1970), with norms in place of absolute values."""
    on_left, on_right = norm(subtract(after, right)), norm(subtract(left, before))
    total = on_left + on_right
    if total <= 1e-14 * (norm(left) + norm(right)):
        return scaled(add(left, right), 0.5)
    return add(scaled(left, on_left / total), scaled(right, on_right / total))


def mirrored(slope: Vector, next_slope: Vector) -> Vector:
    """The slope that stands beyond an end so that the parabola through it goes on (Akima's rule)."""
    return subtract(scaled(slope, 2.0), next_slope)


def c2_tangents(
    slopes: Sequence[Vector], chords: Sequence[float], start: Vector | str, end: Vector | str
) -> list[Vector]:
    """Derivatives at all points of the C2 cubic whose spans have these mean slopes and chord lengths.

    `start` and `end` are a derivative (tangent given), "NAT" (no curvature) or "AUTO" (third derivative continuous at
    the first or last inner joint). One more tangent than spans.
    """
    count = len(slopes)
    if count == 2 and start == end == "AUTO":
        return _parabola(slopes, chords)
    rows = [_end_row(slopes, chords, start, is_start=True)]
    for k in range(1, count):
        before, after = chords[k - 1], chords[k]
        right = scaled(add(scaled(slopes[k - 1], after), scaled(slopes[k], before)), 3.0)
        rows.append((after, 2.0 * (before + after), before, right))
    rows.append(_end_row(slopes, chords, end, is_start=False))
    return _tridiagonal(rows)


Row = tuple[float, float, float, Vector]


def _end_row(slopes: Sequence[Vector], chords: Sequence[float], condition: Vector | str, *, is_start: bool) -> Row:
    first, second = (0, 1) if is_start else (-1, -2)
    slope = slopes[first]
    if not isinstance(condition, str):
        diagonal, beside, right = 1.0, 0.0, condition
    elif condition == "NAT" or len(slopes) == 1:
        diagonal, beside, right = 2.0, 1.0, scaled(slope, 3.0)
    else:
        near, far = chords[first], chords[second]
        total = near + far
        diagonal, beside = far, total
        mixed = add(scaled(slope, far * (2 * far + 3 * near)), scaled(slopes[second], near**2))
        right = scaled(mixed, 1.0 / total)
    return (0.0, diagonal, beside, right) if is_start else (beside, diagonal, 0.0, right)


def _parabola(slopes: Sequence[Vector], chords: Sequence[float]) -> list[Vector]:
    total = chords[0] + chords[1]
    middle = add(scaled(slopes[0], chords[1] / total), scaled(slopes[1], chords[0] / total))
    return [subtract(scaled(slopes[0], 2.0), middle), middle, subtract(scaled(slopes[1], 2.0), middle)]


def _tridiagonal(rows: list[Row]) -> list[Vector]:
    """Thomas' algorithm; the systems here are diagonally dominant but for AUTO ends, which stay regular."""
    uppers: list[float] = []
    rights: list[Vector] = []
    for lower, diagonal, upper, right in rows:
        if uppers:
            diagonal -= lower * uppers[-1]
            right = subtract(right, scaled(rights[-1], lower))
        uppers.append(upper / diagonal)
        rights.append(scaled(right, 1.0 / diagonal))
    solved = [rights[-1]]
    for upper, right in zip(reversed(uppers[:-1]), reversed(rights[:-1]), strict=True):
        solved.append(subtract(right, scaled(solved[-1], upper)))
    return solved[::-1]
