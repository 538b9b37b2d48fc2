"""Strands and bins: which pieces of the sweep can reach a place.

Consecutive pieces that stay near one chord make a strand; a strand is listed in every square cell of the plan that
comes within `reach_mm` (the tool's radius and a margin) of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array

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


@dataclass(frozen=True, slots=True)
class Strands:
    """Runs of pieces: strand k holds pieces firsts[k] to firsts[k + 1] - 1; chords (n, 8): begin, vector, sag,
    half its length, mm.
    """

    firsts: Ints
    chords: Floats


def strands_of(sweep: Sweep, *, sag_mm: float, length_mm: float) -> Strands:
    """Runs of joined pieces no longer than about `length_mm` that no part leaves by more than about `sag_mm`.

    The way is cut at every gap and wherever the length reached so far enters a new stretch of `length_mm`; runs that
    bend more than `sag_mm` are taken apart again into their pieces.
    """
    begins, ends = sweep.coefficients[:, 0], sweep.ends
    if not len(begins):
        return Strands(np.zeros(1, dtype=np.int64), np.empty((0, 8)))
    length = np.linalg.norm(ends - begins, axis=1)
    stretch = ((np.cumsum(length) - length) / length_mm).astype(np.int64)
    is_new = np.ones(len(begins) + 1, dtype=bool)
    is_new[1:-1] = (stretch[1:] != stretch[:-1]) | (np.abs(begins[1:] - ends[:-1]).max(axis=1) > 1e-3 * length_mm)
    firsts = np.flatnonzero(is_new)
    sag = _strand_chords(sweep, firsts)[:, 6]
    is_new[:-1] |= np.repeat(sag > sag_mm, np.diff(firsts))
    firsts = np.flatnonzero(is_new)
    return Strands(firsts.astype(np.int64), _strand_chords(sweep, firsts))


def _strand_chords(sweep: Sweep, firsts: Ints) -> Floats:
    """Chords of runs with the largest distance of a piece's ends from them, its own sag added."""
    counts = np.diff(firsts)
    begins, vectors = (
        sweep.coefficients[firsts[:-1], 0],
        sweep.ends[firsts[1:] - 1] - sweep.coefficients[firsts[:-1], 0],
    )
    square = np.einsum("ij,ij->i", vectors, vectors)
    a, d, l2 = (np.repeat(each, counts, axis=0) for each in (begins, vectors, np.where(square > 0, square, 1.0)))
    away = np.zeros(len(a))
    for points in (sweep.coefficients[:, 0], sweep.ends):
        t = np.clip(np.einsum("ij,ij->i", points - a, d) / l2, 0.0, 1.0)
        away = np.maximum(away, np.linalg.norm(points - a - t[:, None] * d, axis=1))
    sag = np.maximum.reduceat(away + sweep.sag_mm, firsts[:-1])
    return np.concatenate([begins, vectors, sag[:, None], np.sqrt(square)[:, None] / 2], axis=1)


def bins_of(strands: Strands, *, reach_mm: float, cell_mm: float) -> Bins:
    """The bins of a sweep; work and memory grow with strands times cells a strand reaches."""
    begins, ends = strands.chords[:, :2], strands.chords[:, :2] + strands.chords[:, 3:5]
    grown = reach_mm + strands.chords[:, 6:7]
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
    table = coo_array((np.ones(len(cell), dtype=np.int8), (cell, item)), shape=(shape[0] * shape[1], len(low)))
    table.has_canonical_format = True  # no cell lists a strand twice, so nothing need be sorted or summed
    sorted_table = table.tocsr()
    return Bins(
        float(corner[0]),
        float(corner[1]),
        cell_mm,
        shape,
        sorted_table.indptr.astype(np.int64),
        sorted_table.indices.astype(np.int32),
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
