"""Uniform square bins in plan: which pieces of the sweep can reach a place.

A piece is listed in every cell that comes within `reach_mm` (the tool's radius and a margin) of its chord in plan.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.sweep import Sweep

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Bins:
    """Cells of `cell_mm` from corner (x0, y0), `shape` of them; cell k lists items[starts[k] : starts[k + 1]]."""

    x0_mm: float
    y0_mm: float
    cell_mm: float
    shape: tuple[int, int]
    starts: Ints
    items: NDArray[np.int32]


def bins_of(sweep: Sweep, *, reach_mm: float, cell_mm: float) -> Bins:
    """The bins of a sweep; work and memory grow with pieces times cells a piece reaches."""
    begins, ends = sweep.coefficients[:, 0, :2], sweep.ends[:, :2]
    grown = reach_mm + sweep.sag_mm[:, None]
    low, high = np.minimum(begins, ends) - grown, np.maximum(begins, ends) + grown
    corner = low.min(axis=0) if len(low) else np.zeros(2)
    size = np.ceil((high.max(axis=0) - corner) / cell_mm).astype(int) if len(low) else np.zeros(2, dtype=int)
    shape = (int(size[0]) + 1, int(size[1]) + 1)
    first = ((low - corner) / cell_mm).astype(np.int64)
    last = ((high - corner) / cell_mm).astype(np.int64)
    cells, items = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int32)]
    for part in np.array_split(np.arange(len(low)), max(1, len(low) // 20_000)):
        cell, item = _pairs(part, first, last, shape[1])
        near = _is_near(begins[item], ends[item], cell, shape[1], corner, cell_mm, grown[item, 0])
        cells.append(cell[near])
        items.append(item[near].astype(np.int32))
    cell, item = np.concatenate(cells), np.concatenate(items)
    order = np.argsort(cell, kind="stable")
    starts = np.searchsorted(cell[order], np.arange(shape[0] * shape[1] + 1))
    return Bins(
        float(corner[0]), float(corner[1]), cell_mm, shape, starts.astype(np.int64), item[order].astype(np.int32)
    )


def _pairs(part: Ints, first: Ints, last: Ints, columns: int) -> tuple[Ints, Ints]:
    """Every (cell, piece) of the pieces' bounding rectangles."""
    wide, high = (last[part] - first[part] + 1).T
    counts = wide * high
    item = np.repeat(part, counts)
    rank = np.arange(len(item)) - np.repeat(np.cumsum(counts) - counts, counts)
    row, column = rank // np.repeat(high, counts), rank % np.repeat(high, counts)
    return (first[item, 0] + row) * columns + first[item, 1] + column, item


def _is_near(
    begins: Floats, ends: Floats, cell: Ints, columns: int, corner: Floats, cell_mm: float, grown: Floats
) -> NDArray[np.bool_]:
    centre = corner + (np.stack([cell // columns, cell % columns], axis=1) + 0.5) * cell_mm
    along = ends - begins
    length = np.einsum("ij,ij->i", along, along)
    t = np.einsum("ij,ij->i", centre - begins, along) / np.where(length > 0, length, 1.0)
    gap = centre - begins - np.clip(t, 0.0, 1.0)[:, None] * along
    return np.asarray(np.einsum("ij,ij->i", gap, gap) <= (grown + cell_mm * np.sqrt(0.5)) ** 2)
