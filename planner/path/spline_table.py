"""Many splines of one degree in flat arrays: points anywhere on them, and how fast their curvature changes.

Places are pairs of a row (which spline) and a parameter. Equations (F3) and (F12) of EQUATIONS-fitting.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import comb

import numpy as np
from numpy.typing import NDArray

from planner.path.model import Array, PlaneSpline
from planner.path.plane_spline import Index
from planner.path.spans import bezier_points, joints_of, power_form


class SplineTable:
    """The pieces of all splines in one list; a parameter plus the row's base finds its piece."""

    def __init__(self, splines: Sequence[PlaneSpline]) -> None:
        self.first_knot = np.array([spline.knots[0] for spline in splines])
        self.last_knot = np.array([spline.knots[-1] for spline in splines])
        width = self.last_knot - self.first_knot
        self._base = np.cumsum(width + 1.0) - width - self.first_knot
        joints = [joints_of(spline) for spline in splines]
        counts = np.array([len(places) - 1 for places in joints])
        self._first = np.cumsum(counts) - counts
        self._last = np.cumsum(counts) - 1
        self._starts = np.concatenate([places[:-1] for places in joints])
        self._ends = np.concatenate([places[1:] for places in joints])
        self._keys = self._starts + np.repeat(self._base, counts)
        powers = power_form(bezier_points(splines)).transpose(1, 0, 2)
        scale = (self._ends - self._starts) ** np.arange(len(powers))[:, None]
        # Rising powers first, counted from the start of the piece, (F3).
        self._coefficients = powers / scale[:, :, None]

    def piece_of(self, rows: Index, parameters: Array) -> Index:
        """The piece (k,) of each place; beyond the ends the end piece."""
        at = np.searchsorted(self._keys, parameters + self._base[rows], side="right") - 1
        return np.asarray(np.clip(at, self._first[rows], self._last[rows]))

    def evaluate(self, rows: Index, parameters: Array) -> tuple[Array, Array, Array]:
        """Points, first and second derivatives, each (k, 2)."""
        at = self.piece_of(rows, parameters)
        *lower, value = self._coefficients[:, at]
        x = (parameters - self._starts[at])[:, None]
        slope, bend = np.zeros_like(value), np.zeros_like(value)
        for coefficient in reversed(lower):
            bend = slope + x * bend
            slope = value + x * slope
            value = coefficient + x * value
        return value, slope, 2 * bend

    def parameters_at(self, rows: Index, arc_mm: Array) -> Array:
        """Parameters (k,) at about these arc lengths of the splines, by the chords of 16 points a piece."""
        shares = np.arange(16) / 16
        steps = self._ends - self._starts
        fine = (self._starts[:, None] + steps[:, None] * shares).ravel()
        owner = np.repeat(np.arange(len(self._first)), 16 * (self._last - self._first + 1))
        ends = np.cumsum(16 * (self._last - self._first + 1))
        fine, owner = np.insert(fine, ends, self.last_knot), np.insert(owner, ends, np.arange(len(ends)))
        points = self.evaluate(owner, fine)[0]
        chord = np.hypot(*np.diff(points, axis=0).T) * (np.diff(owner) == 0)
        walked = np.append(0.0, np.cumsum(chord))
        begin = np.append(0, ends[:-1] + np.arange(1, len(ends)))
        # Rows are kept apart by one more than the longest arc length asked for.
        gap_mm = float(arc_mm.max()) + 1.0
        walked = walked + owner * gap_mm - 0.0
        wanted = np.minimum(walked[begin][rows] + arc_mm, walked[ends + np.arange(len(ends))][rows])
        return np.asarray(np.interp(wanted, walked, fine))

    def slope_range(self, rows: Index, left: Array, right: Array) -> tuple[Array, Array]:
        """Lower and upper bounds (k,) of d(curvature)/d(arc length), 1/mm2, between two parameters each, (F12)."""
        start, stop = self.piece_of(rows, left), self.piece_of(rows, right)
        low, high = self._piece_range(start, left, right)
        for ahead in range(1, int((stop - start).max(initial=0)) + 1):
            more = np.flatnonzero(start + ahead <= stop)
            piece = start[more] + ahead
            some_low, some_high = self._piece_range(piece, np.maximum(left[more], self._starts[piece]), right[more])
            low[more] = np.minimum(low[more], some_low)
            high[more] = np.maximum(high[more], some_high)
        return low, high

    def _piece_range(self, piece: Index, left: Array, right: Array) -> tuple[Array, Array]:
        right = np.where(
            piece < self._last[np.searchsorted(self._last, piece)], np.minimum(right, self._ends[piece]), right
        )
        width = (right - left)[:, None]
        taylor = _shifted(list(self._coefficients[:, piece]), (left - self._starts[piece])[:, None])
        first = [k * part * width ** (k - 1) for k, part in enumerate(taylor) if k >= 1]
        second = [k * (k - 1) * part * width ** (k - 2) for k, part in enumerate(taylor) if k >= 2]
        third = [k * (k - 1) * (k - 2) * part * width ** (k - 3) for k, part in enumerate(taylor) if k >= 3]
        speed2 = _dot(first, first)
        turn = _cross(first, second)
        numerator = _minus(
            _times(_cross(first, third), speed2), [3 * part for part in _times(turn, _dot(first, second))]
        )
        low, high = _bernstein_range(numerator)
        slow, fast = _bernstein_range(speed2)
        # d(kappa)/d(sigma) = numerator / speed^6; a lower bound takes the factor that makes it lower. A speed that is
        # not bounded away from zero leaves the quotient open.
        least, most = _reciprocal_cubes(fast), _reciprocal_cubes(slow)
        return low * np.where(low < 0, most, least), high * np.where(high > 0, most, least)


def _shifted(powers: list[Array], x: Array) -> list[Array]:
    """Coefficients of rising powers about the places x, from those about 0, by repeated division."""
    for low in range(len(powers) - 1):
        for k in range(len(powers) - 2, low - 1, -1):
            powers[k] = powers[k] + x * powers[k + 1]
    return powers


def _reciprocal_cubes(squares: Array) -> Array:
    """1 / x^3 (k,), infinite where x is not clearly positive."""
    infinite = np.full_like(squares, np.inf)
    return np.divide(1.0, squares**3, out=infinite, where=squares > np.cbrt(np.finfo(float).tiny))


def _dot(left: list[Array], right: list[Array]) -> list[Array]:
    return _sums(left, right, lambda a, b: a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1])


def _cross(left: list[Array], right: list[Array]) -> list[Array]:
    return _sums(left, right, lambda a, b: a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _times(left: list[Array], right: list[Array]) -> list[Array]:
    return _sums(left, right, lambda a, b: a * b)


def _sums(left: list[Array], right: list[Array], product) -> list[Array]:  # type: ignore[no-untyped-def]
    """Coefficients of the product of two polynomials of rising powers, for this product of coefficients."""
    total: list[Array | None] = [None] * (len(left) + len(right) - 1)
    for i, a in enumerate(left):
        for j, b in enumerate(right):
            part = product(a, b)
            before = total[i + j]
            total[i + j] = part if before is None else before + part
    return [part for part in total if part is not None]


def _minus(left: list[Array], right: list[Array]) -> list[Array]:
    size = max(len(left), len(right))
    zero = np.zeros_like(left[0])
    return [(left[i] if i < len(left) else zero) - (right[i] if i < len(right) else zero) for i in range(size)]


def _bernstein_range(powers: list[Array]) -> tuple[Array, Array]:
    """Bounds of polynomials on [0, 1] by their Bernstein coefficients."""
    stacked: NDArray[np.float64] = np.stack(powers)
    coefficients = _bernstein_of_powers(len(powers) - 1) @ stacked
    return coefficients.min(axis=0), coefficients.max(axis=0)


@cache
def _bernstein_of_powers(degree: int) -> Array:
    """Row i: the ith Bernstein coefficient on [0, 1] of a polynomial given by rising powers."""
    order = range(degree + 1)
    return np.array([[comb(i, k) / comb(degree, k) for k in order] for i in order])
