"""What fitting and bounding need to know of an exact plane curve, and a dense copy of it to fit against.

Plane coordinates (w, z), mm. The curve is parametrised by its arc length; curvature is d(angle)/ds, 1/mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from planner.path.arc_length import quintic_coefficients
from planner.path.model import Array
from planner.path.trace import TracedCurve, refine_many


class Samples(Protocol):
    """Exact values at chosen arc lengths: points (k, 2), unit tangents (k, 2), signed curvatures (k,)."""

    @property
    def points(self) -> Array:
        """Points (k, 2), mm."""

    @property
    def tangents(self) -> Array:
        """Unit tangents (k, 2)."""

    @property
    def curvatures(self) -> Array:
        """Signed curvatures (k,), 1/mm, positive where the curve turns from w towards z."""


class ExactCurve(Samples, Protocol):
    """A curve known exactly at any arc length, with samples at increasing `arc_mm`, both ends included."""

    @property
    def arc_mm(self) -> Array:
        """Arc lengths (m,) of the samples, mm, increasing."""

    def refine(self, arc_mm: Array) -> Samples:
        """The exact curve at these arc lengths (k,)."""


@dataclass(frozen=True, slots=True)
class Exact:
    """Exact values at places of several curves: `points` (k, 2), `tangents` (k, 2), `curvatures` (k,)."""

    points: Array
    tangents: Array
    curvatures: Array


def exact_at(curves: Sequence[ExactCurve], rows: NDArray[np.intp], arc_mm: Array) -> Exact:
    """The exact curves[rows[i]] at arc length arc_mm[i] from its start; traced curves are solved in one go."""
    order = np.argsort(rows, kind="stable")
    asked, starts = np.unique(rows[order], return_index=True)
    chosen = [curves[row] for row in asked]
    arcs = [part + curve.arc_mm[0] for curve, part in zip(chosen, np.split(arc_mm[order], starts[1:]), strict=True)]
    traced = [curve for curve in chosen if isinstance(curve, TracedCurve)]
    if len(traced) == len(chosen) and all(curve.surface is traced[0].surface for curve in traced):
        found: Sequence[Samples] = refine_many(traced, arcs)
    else:
        found = [curve.refine(arc) for curve, arc in zip(chosen, arcs, strict=True)]
    back = np.argsort(order, kind="stable")
    return Exact(
        np.concatenate([part.points for part in found])[back],
        np.concatenate([part.tangents for part in found])[back],
        np.concatenate([part.curvatures for part in found])[back],
    )


class CurveTable:
    """Many curves end to end in flat arrays, to be read at any places in one go by quintic Hermite interpolation.

    Agrees with position, tangent and curvature at the curves' own samples; for fitting only, no bound rests on it.
    `lengths_mm` (p,) are the lengths of the curves.
    """

    def __init__(self, curves: Sequence[ExactCurve]) -> None:
        counts = np.array([curve.arc_mm.size for curve in curves])
        self.lengths_mm = np.array([curve.arc_mm[-1] - curve.arc_mm[0] for curve in curves])
        self._first = np.cumsum(counts) - counts
        # A gap of 1 mm between the curves keeps their places apart in the one flat list of keys.
        self._base = np.cumsum(self.lengths_mm + 1.0) - self.lengths_mm
        self._arcs = [curve.arc_mm - curve.arc_mm[0] for curve in curves]
        self._keys = np.concatenate([arc + base for arc, base in zip(self._arcs, self._base, strict=True)])
        self._points = np.concatenate([curve.points for curve in curves])
        self._tangents = np.concatenate([curve.tangents for curve in curves])
        self._curvatures = np.concatenate([curve.curvatures for curve in curves])
        self._crowding = [_crowding(arc, curve.curvatures) for arc, curve in zip(self._arcs, curves, strict=True)]

    def places(self, rows: Sequence[int], count: int) -> Array:
        """Arc lengths (p, count) from end to end of these curves, closer together where the curvature changes."""
        shares = np.linspace(0.0, 1.0, count)
        return np.stack([np.interp(shares, self._crowding[row], self._arcs[row]) for row in rows])

    @cached_property
    def ends(self) -> Array:
        """The first and the last point of every curve, (2, 2, p): end, coordinate, curve."""
        last = np.append(self._first[1:], len(self._keys)) - 1
        return np.stack([self._points[self._first].T, self._points[last].T])

    @cached_property
    def _coefficients(self) -> Array:
        """Quintics (6, 2, m - 1) of rising powers of the share between a sample and the next."""
        width = np.diff(self._keys)
        at = np.arange(len(width))
        return quintic_coefficients(self._state(at, width), self._state(at + 1, width)).transpose(0, 2, 1).copy()

    def read(self, rows: NDArray[np.intp], arc_mm: Array) -> tuple[Array, Array]:
        """Points and unit tangents, each (2, k, s), at arc lengths (k, s) of curve rows[i] in column i."""
        keys = (arc_mm + self._base[rows]).T.ravel()
        at = np.maximum(np.searchsorted(self._keys, keys) - 1, np.repeat(self._first[rows], len(arc_mm)))
        shape = (2, *arc_mm.shape[::-1])
        start, width = self._keys[at], self._keys[at + 1] - self._keys[at]
        x = (keys - start) / width
        c0, c1, c2, c3, c4, c5 = self._coefficients[:, :, at]
        points = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))))
        ahead = c1 + x * (2 * c2 + x * (3 * c3 + x * (4 * c4 + x * 5 * c5)))
        tangents = ahead / np.sqrt(ahead[0] ** 2 + ahead[1] ** 2)
        return points.reshape(shape).swapaxes(1, 2).copy(), tangents.reshape(shape).swapaxes(1, 2).copy()

    def _state(self, at: NDArray[np.intp], width: Array) -> Array:
        """Position, first and second derivative (3, k, 2) at samples, by shares of these widths."""
        wide = width[:, None]
        bend = self._curvatures[at][:, None] * wide**2
        return np.stack([self._points[at], self._tangents[at] * wide, _bend(self._tangents[at]) * bend])


def _bend(tangents: Array) -> Array:
    """Unit normals to the left of tangents (k, 2)."""
    return np.stack([-tangents[:, 1], tangents[:, 0]], axis=1)


def _crowding(arc_mm: Array, curvatures: Array) -> Array:
    """Rising shares (m,) from 0 to 1: half by length, half by the fourth root of the curvature's change, (F4)."""
    widths = np.diff(arc_mm)
    change = np.sqrt(np.sqrt(np.abs(np.diff(curvatures)) / widths))
    padded = np.pad(change, 1, mode="edge")
    change = np.maximum(np.maximum(padded[:-2], padded[2:]), change)
    mean = (change * widths).sum() / arc_mm[-1]
    density = 0.5 + 0.5 * change / mean if mean > 0.0 else np.ones_like(change)
    rising = np.append(0.0, np.cumsum(density * widths))
    return np.asarray(rising / rising[-1])
