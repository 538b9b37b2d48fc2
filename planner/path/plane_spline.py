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
    rows = np.arange(knots.shape[0])[:, None] * knots.shape[1]
    near = knots.reshape(-1)[rows + spans + np.arange(-2, 4)[:, None, None]]
    values = [np.ones((1, *parameters.shape))]
    for degree in (1, 2, 3):
        low, high = near[3 - degree : 3], near[3 : 3 + degree]
        part = values[-1] / (high - low)
        values.append(_apart((high - parameters) * part, (parameters - low) * part))
    inner = values[1] / (near[3:5] - near[1:3])
    slopes = values[2] / (near[3:6] - near[0:3])
    bends = _apart(-2 * inner, 2 * inner) / (near[3:6] - near[0:3])
    return values[3], _apart(-3 * slopes, 3 * slopes), _apart(-3 * bends, 3 * bends)


def _apart(lower: Array, upper: Array) -> Array:
    """Sums (k + 1, ...) of `lower` (k, ...) in its places and `upper` one place on."""
    total = np.empty((len(lower) + 1, *lower.shape[1:]))
    total[:-1], total[-1] = lower, 0.0
    total[1:] += upper
    return total


def combine(weights: Array, control_points: Array, spans: Index) -> Array:
    """Sum of four weights (4, p, m) times the control points (2, p, n) they belong to: (2, p, m)."""
    _, rows, count = control_points.shape
    legs = np.arange(rows)[:, None] * count + spans + np.arange(-3, 1)[:, None, None]
    return np.asarray((control_points.reshape(2, -1)[:, legs] * weights).sum(axis=1))


def evaluate(spline: PlaneSpline, parameters: Array) -> tuple[Array, Array, Array]:
    """Points, first and second derivatives (m, 2) of one cubic spline at parameters (m,)."""
    knots, at = spline.knots[None, :], parameters[None, :]
    spans = find_spans(knots, at)
    values, slopes, bends = basis(knots, at, spans)
    points = np.ascontiguousarray(spline.control_points.T)[:, None, :]
    first, second, third = (combine(part, points, spans)[:, 0].T for part in (values, slopes, bends))
    return first, second, third


def rounded(spline: PlaneSpline, decimals: int) -> PlaneSpline:
    """The spline with knots and control points rounded to this many decimals, as a program would write it."""
    return PlaneSpline(spline.degree, np.round(spline.knots, decimals), np.round(spline.control_points, decimals))


def span_count(spline: PlaneSpline) -> int:
    """Number of knot spans."""
    return int(spline.control_points.shape[0] - spline.degree)
