"""How fast the curvature of exact curves can change between two places: proved where possible, else from samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from planner.path.curve import ExactCurve
from planner.path.interval import Range
from planner.path.model import Array, Method
from planner.path.offset import OffsetSurface
from planner.path.plane_spline import Index
from planner.path.roll import RolledSurface
from planner.path.slope_table import MOST_CELLS, SlopeTable, slope_table
from planner.path.trace import TracedCurve

WIDENINGS = 2
SPARE = 1.5  # times the margin that the speeds ask for, because a wider box holds higher ones


class SlopeSource(Protocol):
    """Bounds on d(curvature)/d(arc length) of several curves."""

    method: Method

    def enclose(self, rows: Index, left_mm: Array, right_mm: Array) -> tuple[Array, Array, Array]:
        """Lower and upper bounds (k,), 1/mm2, on curve rows[i] between arc lengths left_mm[i] and right_mm[i].

        They hold but for jumps of the curvature, whose bounds (k,), 1/mm, come third.
        """


@runtime_checkable
class EnclosedCurve(Protocol):
    """A curve that can bound the change of its own curvature."""

    def slope_range(self, left_mm: Array, right_mm: Array) -> tuple[Array, Array]:
        """Lower and upper bounds (k,) of d(curvature)/d(arc length) between these arc lengths, 1/mm2."""


def slope_source(curves: Sequence[ExactCurve], table: SlopeTable | None = None) -> SlopeSource:
    """The best source for these curves; `table` saves building that of their patch again."""
    traced = _on_one_patch(curves)
    if traced:
        return PatchSlopes(traced, table or _table_for(traced))
    own = [curve for curve in curves if isinstance(curve, EnclosedCurve)]
    if len(own) == len(curves):
        return OwnSlopes(own)
    return SampledSlopes(curves)


def patch_table(curves: Sequence[ExactCurve]) -> SlopeTable | None:
    """The table of the patch that all these curves lie on, None if there is no such patch."""
    traced = _on_one_patch(curves)
    return _table_for(traced) if traced else None


def _table_for(curves: Sequence[TracedCurve]) -> SlopeTable:
    """The coarsest table that bounds the curves between all their nodes, or the finest there is.

    A coarse cell of a steep patch holds directions that no pass can have, and then bounds nothing.
    """
    counts = [curve.arc_mm.size - 1 for curve in curves]
    rows = np.repeat(np.arange(len(curves)), counts)
    left = np.concatenate([curve.arc_mm[:-1] for curve in curves])
    right = np.concatenate([curve.arc_mm[1:] for curve in curves])
    boxes = [_boxes(curve.surface, curve.parameters[:-1].T, curve.parameters[1:].T)[1:] for curve in curves]
    reach = (
        np.min([low.min(axis=1) for low, _ in boxes], axis=0),
        np.max([high.max(axis=1) for _, high in boxes], axis=0),
    )
    finer = 1
    while True:
        table = slope_table(curves[0].surface, finer, reach)
        low, high, _ = PatchSlopes(curves, table).enclose(rows, left, right)
        # One refinement is worth more cells: a long patch has many of them at the coarsest.
        most_cells = MOST_CELLS if finer > 1 else 4 * MOST_CELLS
        if np.isfinite(high - low).all() or 4 * table.cells > most_cells:
            return table
        finer *= 2


def _on_one_patch(curves: Sequence[ExactCurve]) -> list[TracedCurve]:
    """The curves themselves, or none if they do not all lie on one patch."""
    traced = [curve for curve in curves if isinstance(curve, TracedCurve)]
    if not traced or len(traced) < len(curves):
        return []
    surface = traced[0].surface
    if isinstance(surface, RolledSurface):
        return []
    return traced if all(curve.surface is surface for curve in traced) else []


def _boxes(surface: OffsetSurface, start: Array, stop: Array) -> tuple[Array, Array, Array]:
    """Boxes of (u, v) in which curves from `start` to `stop` (2, k) should stay: margin, least, largest (2, k)."""
    sizes = np.diff(surface.patch.domain)
    room = 0.6 * np.abs(stop - start) + 0.25 * sizes * (np.abs(stop - start) / sizes).max(axis=0)
    return room, np.minimum(start, stop) - room, np.maximum(start, stop) + room


def _needed(speeds: Range, width: Array) -> Array:
    """Margins (2, k) that a curve cannot cross: every point of it is within half the width (k,) of a node."""
    return np.maximum(np.abs(speeds.low), np.abs(speeds.high)) * 0.51 * width


class PatchSlopes:
    """Traced curves of one patch, enclosed through the patch's own derivatives, (F14) and (F15)."""

    method = Method.PROVED

    def __init__(self, curves: Sequence[TracedCurve], table: SlopeTable) -> None:
        self._table, self._surface = table, curves[0].surface
        lengths = np.array([curve.arc_mm[-1] for curve in curves])
        self._base = np.cumsum(lengths + 1.0) - lengths
        counts = np.array([curve.arc_mm.size for curve in curves])
        self._first, self._last = np.cumsum(counts) - counts, np.cumsum(counts) - 2
        self._keys = np.concatenate([curve.arc_mm + base for curve, base in zip(curves, self._base, strict=True)])
        self._parameters = np.concatenate([curve.parameters for curve in curves]).T

    def enclose(self, rows: Index, left_mm: Array, right_mm: Array) -> tuple[Array, Array, Array]:
        """The range over the patch where the curve can be between these places; all numbers where that is unknown."""
        middle = 0.5 * (left_mm + right_mm) + self._base[rows]
        node = np.clip(np.searchsorted(self._keys, middle, side="right") - 1, self._first[rows], self._last[rows])
        start, stop = self._parameters[:, node], self._parameters[:, node + 1]
        width = self._keys[node + 1] - self._keys[node]
        room, speeds, is_inside = self._kept_in(start, stop, width)
        least, most = np.where(is_inside, speeds.low, 0.0), np.where(is_inside, speeds.high, 0.0)
        on = np.stack([left_mm + self._base[rows] - self._keys[node], right_mm + self._base[rows] - self._keys[node]])
        back = width - on
        low = np.maximum(
            (start + np.minimum(least * on[0], least * on[1])), stop - np.maximum(most * back[0], most * back[1])
        )
        high = np.minimum(
            start + np.maximum(most * on[0], most * on[1]), stop - np.minimum(least * back[0], least * back[1])
        )
        slack = 1e-3 * room
        slope = self._table.over(self._table.slope, low - slack, high + slack)
        jumps = self._table.jumps(low - slack, high + slack, right_mm - left_mm)
        return np.where(is_inside, slope.low, -np.inf), np.where(is_inside, slope.high, np.inf), jumps

    def _kept_in(self, start: Array, stop: Array, width: Array) -> tuple[Array, Range, NDArray[np.bool_]]:
        """Margins (2, k) of boxes from `start` to `stop`, the speeds in them, and whether no curve can leave them."""
        room, low, high = _boxes(self._surface, start, stop)
        speeds = self._table.over(self._table.speeds, low, high)
        needed = _needed(speeds, width)
        # On a patch much longer than wide a small share of both is too little across it: what the speeds ask for, then.
        for _ in range(WIDENINGS):
            tight = np.flatnonzero((needed > room).any(axis=0) & np.isfinite(needed).all(axis=0))
            if not len(tight):
                break
            room[:, tight] = np.maximum(room[:, tight], SPARE * needed[:, tight])
            low, high = np.minimum(start, stop)[:, tight], np.maximum(start, stop)[:, tight]
            wider = self._table.over(self._table.speeds, low - room[:, tight], high + room[:, tight])
            speeds.low[:, tight], speeds.high[:, tight] = wider.low, wider.high
            needed[:, tight] = _needed(wider, width[tight])
        return room, speeds, np.asarray((needed <= room).all(axis=0))


class OwnSlopes:
    """Curves that bound themselves: the bound is proved as far as theirs is."""

    method = Method.PROVED

    def __init__(self, curves: Sequence[EnclosedCurve]) -> None:
        self._curves = curves

    def enclose(self, rows: Index, left_mm: Array, right_mm: Array) -> tuple[Array, Array, Array]:
        """Each curve's own bounds."""
        low, high = np.empty(len(rows)), np.empty(len(rows))
        for row in np.unique(rows):
            at = rows == row
            low[at], high[at] = self._curves[row].slope_range(left_mm[at], right_mm[at])
        return low, high, np.zeros(len(rows))


class SampledSlopes:
    """The slopes between the samples themselves, widened by how much they differ from their neighbours'."""

    method = Method.SAMPLED

    def __init__(self, curves: Sequence[ExactCurve]) -> None:
        lengths = np.array([curve.arc_mm[-1] for curve in curves])
        self._base = np.cumsum(lengths + 1.0) - lengths
        self._keys = np.concatenate([curve.arc_mm + base for curve, base in zip(curves, self._base, strict=True)])
        low, high = [], []
        for curve in curves:
            slope = np.diff(curve.curvatures) / np.diff(curve.arc_mm)
            near = np.pad(slope, 1, mode="edge")
            least = np.minimum(np.minimum(near[:-2], near[2:]), slope)
            most = np.maximum(np.maximum(near[:-2], near[2:]), slope)
            spread = most - least
            # The gap after a curve belongs to its last interval.
            low.append(np.append(least - spread, (least - spread)[-1]))
            high.append(np.append(most + spread, (most + spread)[-1]))
        self._low, self._high = np.concatenate(low), np.concatenate(high)

    def enclose(self, rows: Index, left_mm: Array, right_mm: Array) -> tuple[Array, Array, Array]:
        """The widened slopes of the sampled interval in which the middle lies."""
        at = np.searchsorted(self._keys, 0.5 * (left_mm + right_mm) + self._base[rows], side="right") - 1
        return self._low[at], self._high[at], np.zeros(len(rows))
