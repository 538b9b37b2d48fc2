"""Cubic B-splines in a plane, many at once: basis values, points, derivatives, rounding.

Batches hold one spline a row: `knots` (p, n + 4), `control_points` (p, n, 2), parameters (p, m). All knots of the
interior are simple, the ends clamped. Equations (F1) to (F4) of EQUATIONS-fitting.md.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planner.path.model import Array, PlaneSpline

Index = NDArray[np.intp]


def find_spans(knots: Array, parameters: Array) -> Index:
    """Index i with knots[i] <= t < knots[i + 1] for every t (p, m); outside the range the end span."""
    inner = knots[:, 4:-4]
    found = np.full(parameters.shape, 3, dtype=np.intp)
    for column in range(inner.shape[1]):
        found += parameters >= inner[:, column, None]
    return found


def basis(knots: Array, parameters: Array, spans: Index) -> tuple[Array, Array, Array]:
    """Values, first and second derivatives of the four cubic basis functions alive at each parameter.

    Shapes (4, p, m), for control points i - 3 ... i of span i. Source: (F1), the recurrence of Cox and de Boor.
    """
    rows = np.arange(knots.shape[0])[:, None]
    near = [knots[rows, spans + offset] for offset in range(-2, 4)]
    left = [parameters - near[2 - j] for j in range(3)]
    right = [near[3 + j] - parameters for j in range(3)]
    values: list[Array] = [np.ones_like(parameters)]
    lower: list[list[Array]] = [values]
    for degree in (1, 2, 3):
        grown = [np.zeros_like(parameters) for _ in range(degree + 1)]
        for r in range(degree):
            part = values[r] / (right[r] + left[degree - 1 - r])
            grown[r] = grown[r] + right[r] * part
            grown[r + 1] = left[degree - 1 - r] * part
        values = grown
        lower.append(values)
    linear, quadratic = lower[1], lower[2]
    weights = [quadratic[r] / (right[r] + left[2 - r]) for r in range(3)]
    slopes = [-3 * weights[0], 3 * (weights[0] - weights[1]), 3 * (weights[1] - weights[2]), 3 * weights[2]]
    bend = [linear[r] / (right[r] + left[1 - r]) for r in range(2)]
    # Second derivatives of the cubic are first derivatives of its quadratic slopes.
    inner = [-2 * bend[0], 2 * (bend[0] - bend[1]), 2 * bend[1]]
    scaled = [inner[r] / (right[r] + left[2 - r]) for r in range(3)]
    bends = [-3 * scaled[0], 3 * (scaled[0] - scaled[1]), 3 * (scaled[1] - scaled[2]), 3 * scaled[2]]
    return np.stack(values), np.stack(slopes), np.stack(bends)


def combine(weights: Array, control_points: Array, spans: Index) -> Array:
    """Sum of four weights (4, p, m) times the control points they belong to: (p, m, 2)."""
    rows = np.arange(control_points.shape[0])[:, None]
    total = weights[0][..., None] * control_points[rows, spans - 3]
    for j in (1, 2, 3):
        total += weights[j][..., None] * control_points[rows, spans - 3 + j]
    return np.asarray(total)


def evaluate(spline: PlaneSpline, parameters: Array) -> tuple[Array, Array, Array]:
    """Points, first and second derivatives (m, 2) of one cubic spline at parameters (m,)."""
    knots, at = spline.knots[None, :], parameters[None, :]
    spans = find_spans(knots, at)
    values, slopes, bends = basis(knots, at, spans)
    points = spline.control_points[None, :, :]
    return combine(values, points, spans)[0], combine(slopes, points, spans)[0], combine(bends, points, spans)[0]


def rounded(spline: PlaneSpline, decimals: int) -> PlaneSpline:
    """The spline with knots and control points rounded to this many decimals, as a program would write it."""
    return PlaneSpline(spline.degree, np.round(spline.knots, decimals), np.round(spline.control_points, decimals))


def span_count(spline: PlaneSpline) -> int:
    """Number of knot spans."""
    return int(spline.control_points.shape[0] - spline.degree)
