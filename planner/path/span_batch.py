"""Many splines in one batch, their spans end to end, and the linear equations that tie neighbouring spans together.

Arrays run over all S spans last. A spline of s spans has s + 5 groups of unknowns; its ith span knows groups i to
i + w - 1, its window.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from planner.path.model import Array
from planner.path.plane_spline import Index

BLOCK_UNKNOWNS = 24


@dataclass(frozen=True, slots=True)
class SpanIndex:
    """Which span is whose: `counts` (p,) of the splines' spans, their `firsts` and `lasts` (p,) among all S spans;
    for each span its spline `owners` (S,) and its place `ranks` (S,) within it.
    """

    counts: Index
    firsts: Index
    lasts: Index
    owners: Index
    ranks: Index

    @staticmethod
    def of(counts: Index) -> SpanIndex:
        """Splines with these numbers of spans."""
        ends = np.cumsum(counts)
        owners = np.repeat(np.arange(len(counts)), counts)
        return SpanIndex(counts, ends - counts, ends - 1, owners, np.arange(len(owners)) - (ends - counts)[owners])

    def spans_of(self, rows: Index) -> Index:
        """The spans of these splines, which rise."""
        is_chosen = np.zeros(len(self.counts), np.bool_)
        is_chosen[rows] = True
        return np.flatnonzero(is_chosen[self.owners])

    def largest(self, values: Array) -> Array:
        """The largest value (p,) of each spline, from values (S,)."""
        return np.asarray(np.maximum.reduceat(values, self.firsts))

    def total(self, values: Array) -> Array:
        """The sum (p,) over each spline, from values (S,)."""
        return np.asarray(np.add.reduceat(values, self.firsts))


@dataclass(frozen=True, slots=True)
class SpanFits:
    """Fits of a batch: `errors_mm` (p,) are their largest distances.

    A kind of fit adds arrays that run over spans last; a class's own slots are what it adds.
    """

    index: SpanIndex
    errors_mm: Array

    def take(self, rows: Index) -> Self:
        """These fits only; the rows rise."""
        spans = self.index.spans_of(rows)
        own = {name: getattr(self, name)[..., spans] for name in self.__slots__}
        return replace(self, index=SpanIndex.of(self.index.counts[rows]), errors_mm=self.errors_mm[rows], **own)

    def put(self, rows: Index, other: Self) -> None:
        """Overwrite these rows, which rise, by the other's."""
        spans = self.index.spans_of(rows)
        for name in self.__slots__:
            getattr(self, name)[..., spans] = getattr(other, name)
        self.errors_mm[rows] = other.errors_mm


def solve_spans(blocks: Array, right: Array, index: SpanIndex, damping: Array) -> Array:
    """The unknowns of every span's window (w, g, q, S), of equations that are sums of the spans' own.

    `blocks` (w, g, w, g, S) are symmetric and their sums not negative, `right` (w, g, q, S) the right sides; `damping`
    (p,) is the share by which a spline's diagonal is raised. Groups are eliminated a block at a time, (F9), so that the
    work grows linearly with the number of spans.
    """
    windows, group, beside, _ = right.shape
    size = max(windows - 1, BLOCK_UNKNOWNS // group)
    rows, number = len(index.counts), -(-(int(index.counts.max()) + windows - 1) // size)
    at = index.owners * (number * size) + index.ranks
    band = np.zeros((rows * number * size, windows, group, group))
    load = np.zeros((rows * number * size, group, beside))
    for leg in range(windows):
        load[at + leg] += right[leg].transpose(2, 0, 1)
        for ahead in range(windows - leg):
            band[at + leg, ahead] += blocks[leg, :, leg + ahead].transpose(2, 0, 1)
    diagonal = np.einsum("naa->na", band[:, 0]).reshape(rows, -1)
    raised = diagonal * (1.0 + damping[:, None]) + 1e-9 * diagonal.max(axis=1, keepdims=True)
    np.einsum("naa->na", band[:, 0])[:] = raised.reshape(-1, group)
    found = _solve_blocks(
        *_in_blocks(band.reshape(rows, number, size, windows, group, group)), load.reshape(rows, number, -1, beside)
    )
    seen = found.reshape(-1, group, beside)[at + np.arange(windows)[:, None]]
    return np.asarray(seen.transpose(0, 2, 3, 1))


def _in_blocks(band: Array) -> tuple[Array, Array]:
    """Square blocks (p, b, n, n) on the diagonal and the blocks (p, b, n, m) that tie each to the next.

    From the parts (p, b, size, w, g, g) between a group and those up to w - 1 further on.
    """
    rows, number, size, windows, group, _ = band.shape
    within = np.zeros((rows, number, size, group, size, group))
    across = np.zeros((rows, number, size, group, windows - 1, group))
    for ahead in range(windows):
        part = band[:, :, :, ahead].transpose(2, 0, 1, 3, 4)
        near, far = np.arange(size - ahead), np.arange(size - ahead, size)
        within[:, :, near + ahead, :, near] = part[near].transpose(0, 1, 2, 4, 3)
        within[:, :, near, :, near + ahead] = part[near]
        across[:, :, far, :, far + ahead - size] = part[far]
    return within.reshape(rows, number, size * group, -1), across.reshape(rows, number, size * group, -1)


def _solve_blocks(within: Array, across: Array, load: Array) -> Array:
    """Gauss's elimination block by block; all arguments are used up."""
    number, links = within.shape[1], across.shape[3]
    solved = np.empty((*across.shape[:3], links + load.shape[3]))
    for block in range(number):
        solved[:, block] = np.linalg.solve(within[:, block], np.concatenate([across[:, block], load[:, block]], axis=2))
        if block + 1 < number:
            carried = across[:, block].transpose(0, 2, 1) @ solved[:, block]
            within[:, block + 1, :links, :links] -= carried[..., :links]
            load[:, block + 1, :links] -= carried[..., links:]
    found = solved[..., links:]
    for block in range(number - 2, -1, -1):
        found[:, block] -= solved[:, block, :, :links] @ found[:, block + 1, :links]
    return np.asarray(found)
