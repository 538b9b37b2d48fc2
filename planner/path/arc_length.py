"""Arc length along solved points of a plane curve, reading between them, and where they stand too far apart for it.

Plane coordinates (w, z), mm; the curves run in +w. Equations (9) to (11) of EQUATIONS.md.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planner.path.model import Array

Flags = NDArray[np.bool_]


def lengths_between(run_mm: Array, tangents: tuple[Array, Array], curvatures: tuple[Array, Array]) -> Array:
    """Arc lengths (k,) of stretches this long in w, from tangents (k, 2) and curvatures (k,) at both ends, (9)."""
    speed = [1 / tangent[:, 0] for tangent in tangents]
    change = [curvatures[end] * tangents[end][:, 1] * speed[end] ** 3 for end in (0, 1)]
    return np.asarray(run_mm / 2 * (speed[0] + speed[1]) + run_mm**2 / 12 * (change[0] - change[1]))


def quintic_coefficients(left: Array, right: Array) -> Array:
    """Coefficients (6, ...) of rising powers of the share, from value, first and second derivative (3, ...) at 0 and 1.

    Equation (10), its derivatives by the share.
    """
    p0, t0, k0 = left
    gap, slope, turn = right[0] - p0 - t0 - k0 / 2, right[1] - t0 - k0, right[2] - k0
    c3 = 10 * gap - 4 * slope + turn / 2
    c4 = -15 * gap + 7 * slope - turn
    c5 = 6 * gap - 3 * slope + turn / 2
    return np.stack([p0, t0, k0 / 2, c3, c4, c5])


def quintic(share: Array, span: Array, left: list[Array], right: list[Array]) -> Array:
    """Hermite interpolation of value, slope and bend at both ends of a span, (10)."""
    scale = (np.ones_like(span), span, span**2)
    ends = (np.stack([value * by for value, by in zip(end, scale, strict=True)]) for end in (left, right))
    c0, c1, c2, c3, c4, c5 = quintic_coefficients(*ends)
    return np.asarray(c0 + share * (c1 + share * (c2 + share * (c3 + share * (c4 + share * c5)))))


def wide_gaps(
    owner: NDArray[np.intp], points: Array, tangents: Array, curvatures: Array, *, accuracy_mm: float
) -> Flags:
    """Which gaps (m - 1,) between following points (m, 2) are too wide to be read within `accuracy_mm`, (11).

    Every point is compared with what its two neighbours alone would give for it; `owner` (m,) is the curve of each
    point. Halving a gap divides the error of reading by 8 and the relative one of the arc length by 4, even where the
    curvature has a kink, so four times the error is allowed. An arc length may be wrong by 1e-4 of itself.
    """
    is_wide = np.zeros(len(owner) - 1, dtype=bool)
    at = np.flatnonzero(owner[2:] == owner[:-2]) + 1
    before, after = at - 1, at + 1

    def length(first: NDArray[np.intp], last: NDArray[np.intp]) -> Array:
        run = points[last, 0] - points[first, 0]
        return lengths_between(run, (tangents[first], tangents[last]), (curvatures[first], curvatures[last]))

    begun, rest = length(before, at), length(at, after)
    whole = begun + rest
    ends = [
        [points[i], tangents[i], curvatures[i, None] * np.stack([-tangents[i, 1], tangents[i, 0]], axis=1)]
        for i in (before, after)
    ]
    read = quintic((begun / whole)[:, None], whole[:, None], ends[0], ends[1])
    off = np.abs((read - points[at])[:, 1] * tangents[at, 0] - (read - points[at])[:, 0] * tangents[at, 1])
    is_off = (off > 4 * accuracy_mm) | (np.abs(length(before, after) - whole) > 4e-4 * whole)
    is_wide[before[is_off]] = is_wide[at[is_off]] = True
    return is_wide
