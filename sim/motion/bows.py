"""Rounded corners between straight moves, thousands at a time.

The rounding is C + d(-u1 a(t) + u2 a(1 - t)), a(t) = 1 - 2t + 2t^3 - t^4, 0 <= t <= 1: it leaves the first leg at d
before the corner C and joins the second at d after it, without a jump of direction or curvature. With w = 6t^2 - 4t^3
its derivative is d((2 - w) u1 + w u2), so length, curvature and the rest depend on the turn alone and scale with d;
they are tabulated over the turn once. Derivation and check: sim/motion/MODEL.md, section 4.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.motion.columns import with_room

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SHARPEST = 0.95
"""Largest sin(theta/2) that is rounded; beyond it (144 degrees) the path turns back and must stop."""

INTERVALS = 32
_TURNS = 512
_FINE = 2049


@dataclass(frozen=True, slots=True)
class BowTable:
    """Over turns (m,), rad, for d = 1: length, greatest curvature and |r'''|, and t (m, 33) at equal steps of arc."""

    turns: Array
    length: Array
    curvature: Array
    third: Array
    parameters: Array


@functools.cache
def bow_table() -> BowTable:
    """The shapes of all roundings, from the straight one to the sharpest."""
    turns = np.linspace(0.0, 2.0 * np.arcsin(SHARPEST), _TURNS)
    t = np.linspace(0.0, 1.0, _FINE)
    w = t * t * (6.0 - 4.0 * t)
    length, curvature, third = np.empty(_TURNS), np.empty(_TURNS), np.empty(_TURNS)
    parameters = np.empty((_TURNS, INTERVALS + 1))
    for k, turn in enumerate(turns):
        half = np.sin(turn / 2.0)
        speed = 2.0 * np.sqrt(1.0 - half**2 * w * (2.0 - w))
        arc = np.concatenate([[0.0], np.cumsum((speed[:-1] + 4.0 * _between(speed) + speed[1:]) / 6.0 / (_FINE - 1))])
        bend = 24.0 * t * (1.0 - t) * np.sin(turn) / speed**3
        length[k], curvature[k] = arc[-1], np.max(bend)
        third[k] = np.max(np.hypot(np.gradient(bend, t) / speed, bend**2))
        parameters[k] = np.interp(np.linspace(0.0, arc[-1], INTERVALS + 1), arc, t)
    return BowTable(turns, length, curvature, third, parameters)


def _between(values: Array) -> Array:
    """Midpoint values by four-point interpolation; at the ends from three points."""
    middle = (values[:-1] + values[1:]) / 2.0
    curve = np.zeros_like(values)
    curve[1:-1] = values[2:] - 2.0 * values[1:-1] + values[:-2]
    curve[0], curve[-1] = curve[1], curve[-2]
    return np.asarray(middle - (curve[:-1] + curve[1:]) / 16.0)


class Bows:
    """The roundings of a path: corners (n, 3), legs scaled by the reach (n, 3), reaches mm and turns rad (n,)."""

    def __init__(self) -> None:
        self.count = 0
        self._corner = np.zeros((0, 3))
        self._before = np.zeros((0, 3))
        self._after = np.zeros((0, 3))
        self._reach = np.zeros(0)
        self._turn = np.zeros(0)
        self._length = np.zeros(0)

    def append(
        self, corner: Array, u1: Array, u2: Array, reach: Array
    ) -> tuple[Array, tuple[Array, Array, Array], Array]:
        """Add roundings of corners with unit legs u1, u2 (n, 3) and these reaches mm (n,).

        Returns lengths mm (n,), bounds (n, 3) on each axis' first three derivatives by arc length, sin(theta/2) (n,).
        """
        table = bow_table()
        bend = u2 - u1
        size = np.sqrt(np.einsum("ij,ij->i", bend, bend))
        turn = 2.0 * np.arcsin(np.minimum(size / 2.0, SHARPEST))
        length = np.interp(turn, table.turns, table.length) * reach
        middle = u1 + u2
        plane = np.sqrt(
            (bend / np.maximum(size, 1e-300)[:, None]) ** 2 + middle**2 / np.einsum("ij,ij->i", middle, middle)[:, None]
        )
        curvature = np.interp(turn, table.turns, table.curvature) / reach
        third = np.interp(turn, table.turns, table.third) / reach**2
        bounds = plane, curvature[:, None] * plane, third[:, None] * plane
        new = self.count + len(reach)
        for name, rows in (
            ("_corner", corner),
            ("_before", u1 * reach[:, None]),
            ("_after", u2 * reach[:, None]),
            ("_reach", reach),
            ("_turn", turn),
            ("_length", length),
        ):
            column = with_room(getattr(self, name), self.count, new)
            column[self.count : new] = rows
            setattr(self, name, column)
        self.count = new
        return length, bounds, size / 2.0

    def parameter(self, index: Indices, arc_mm: Array) -> Array:
        """Parameters t (n,) of the roundings `index` (n,) at these arc lengths, cubic between table entries."""
        h = self._length[index] / INTERVALS
        cell = np.clip((arc_mm / h).astype(np.int64), 0, INTERVALS - 1)
        t = arc_mm / h - cell
        p0, m0 = self._entry(index, cell)
        p1, m1 = self._entry(index, cell + 1)
        m0, m1, rise = m0 * h, m1 * h, p1 - p0
        return np.asarray(p0 + t * (m0 + t * (3.0 * rise - 2.0 * m0 - m1 + t * (m0 + m1 - 2.0 * rise))))

    def _entry(self, index: Indices, cell: Indices) -> tuple[Array, Array]:
        """Parameter t and dt/ds at this entry of the table of each rounding."""
        parameters = bow_table().parameters
        turn = self._turn[index]
        at = turn * ((_TURNS - 1) / (2.0 * np.arcsin(SHARPEST)))
        low = np.minimum(at.astype(np.int64), _TURNS - 2)
        share = at - low
        t = parameters[low, cell] * (1.0 - share) + parameters[low + 1, cell] * share
        w = t * t * (6.0 - 4.0 * t)
        return t, 0.5 / (self._reach[index] * np.sqrt(1.0 - np.sin(turn / 2.0) ** 2 * w * (2.0 - w)))

    def points(self, index: Indices, arc_mm: Array) -> Array:
        """Points (n, 3), mm."""
        t = self.parameter(index, arc_mm)[:, None]
        before = 1.0 - 2.0 * t + t**3 * (2.0 - t)
        after = t**3 * (2.0 - t)
        return np.asarray(self._corner[index] - before * self._before[index] + after * self._after[index])

    def parts(self, index: Indices, to_mm: Array) -> Iterator[tuple[list[list[float]], float, list[float]]]:
        """The roundings `index` (n,) up to these arc lengths (n,): coefficients, parameter and point of the end.

        Coefficients are five vectors in mm, lowest power first, of a parameter that begins at 0.
        """
        corner, b, turn = self._corner[index], self._before[index], self._after[index] - self._before[index]
        whole = to_mm >= self._length[index]
        lengths = np.where(whole, 1.0, self.parameter(index, to_mm))
        rows = np.stack([corner - b, 2.0 * b, np.zeros_like(b), 2.0 * turn, -turn], axis=1)
        ends = np.zeros_like(b)
        for k in range(4, -1, -1):
            ends = ends * lengths[:, None] + rows[:, k]
        return zip(rows.tolist(), lengths.tolist(), ends.tolist(), strict=True)
