"""The cubic basis functions of B-splines, many splines at once.

Batches hold one spline a row: `knots` (p, n + 4), parameters (p, m). All knots of the interior are simple, the ends
clamped. Equation (F1) of EQUATIONS-fitting.md.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planner.path.model import Array

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
