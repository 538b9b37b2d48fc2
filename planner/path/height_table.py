"""Many curves as heights z(w), to be read at any place w in one go; for fitting only, no bound rests on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planner.path.arc_length import quintic_coefficients
from planner.path.curve import ExactCurve
from planner.path.model import Array


class HeightTable:
    """Curves that run on in w, by quintic Hermite interpolation between their own samples.

    `begins` and `ends` (p,) are the places w of the curves' ends, mm.
    """

    def __init__(self, curves: Sequence[ExactCurve]) -> None:
        counts = np.array([curve.arc_mm.size for curve in curves])
        self.begins = np.array([curve.points[0, 0] for curve in curves])
        self.ends = np.array([curve.points[-1, 0] for curve in curves])
        self._first = np.cumsum(counts) - counts
        # A gap of 1 mm between the curves keeps their places apart in the one flat list of keys.
        widths = self.ends - self.begins
        self._base = np.cumsum(widths + 1.0) - widths - self.begins
        points = np.concatenate([curve.points for curve in curves])
        tangents = np.concatenate([curve.tangents for curve in curves])
        curvatures = np.concatenate([curve.curvatures for curve in curves])
        self._keys = points[:, 0] + np.repeat(self._base, counts)
        self._widths = np.diff(self._keys)
        state = np.stack([points[:, 1], tangents[:, 1] / tangents[:, 0], curvatures / tangents[:, 0] ** 3])
        scale = self._widths ** np.arange(3)[:, None]
        self._coefficients = quintic_coefficients(state[:, :-1] * scale, state[:, 1:] * scale)

    def read(self, rows: NDArray[np.intp], places: Array) -> tuple[Array, Array, Array]:
        """Heights, slopes and second derivatives, each (k, s), at places w (k, s) of curve rows[i] in column i."""
        keys = places + self._base[rows]
        at = np.maximum(np.searchsorted(self._keys, keys) - 1, self._first[rows])
        width = self._widths[at]
        x = (keys - self._keys[at]) / width
        c0, c1, c2, c3, c4, c5 = self._coefficients[:, at]
        height = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))))
        slope = c1 + x * (2 * c2 + x * (3 * c3 + x * (4 * c4 + x * 5 * c5)))
        bend = 2 * c2 + x * (6 * c3 + x * (12 * c4 + x * 20 * c5))
        return height, slope / width, bend / width**2
