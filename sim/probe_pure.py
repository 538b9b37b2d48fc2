"""Probes against the swept cutter in numpy: the twin of `sim.probe_fast`, many (probe, piece) pairs at a time.

`layers` and a grid are told in `sim.probe_fast`, the geometry of one piece is `sim.piece_pure`; a test holds both
twins to the same figures.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.piece_pure import Edge, Flags, Floats, Ints, contains, gap2, is_beyond, piece_entry

Items = NDArray[np.int32]
Layers = tuple[Floats, Ints, Floats, Floats, Items]
Grid = tuple[float, float, float, int, int]

_CHUNK = 500


def heights(
    points: Floats,
    normals: Floats,
    layers: Layers,
    starts: Ints,
    grid: Grid,
    edge: Edge,
    reach: float,
    margin: float,
    out: Floats,
    owners: Ints,
    places: Floats,
) -> None:
    """Height along every normal at which the cutter's way begins (inf beyond `reach`), the piece that cut, its s."""
    for begin in range(0, len(points), _CHUNK):
        part = slice(begin, begin + _CHUNK)
        block = _Block(points[part], normals[part], layers, starts, grid, edge, reach, margin)
        block.search()
        out[part] = np.where(block.owner >= 0, block.best, np.inf)
        owners[part], places[part] = block.owner, block.where


class _Block:
    """A handful of probes and what each has found so far: best height, owner, place on it."""

    def __init__(
        self,
        points: Floats,
        normals: Floats,
        layers: Layers,
        starts: Ints,
        grid: Grid,
        edge: Edge,
        reach: float,
        margin: float,
    ) -> None:
        self.p, self.n, self.layers, self.starts, self.grid = points, normals, layers, starts, grid
        self.edge, self.radius, self.margin = edge, sum(edge), margin
        self.best = np.full(len(points), reach)
        self.owner = np.full(len(points), -1, dtype=np.int64)
        self.where = np.zeros(len(points))

    def search(self) -> None:
        level = np.hypot(self.n[:, 0], self.n[:, 1])
        with np.errstate(divide="ignore"):
            step = np.where(level > 0, self.margin / level, np.inf)
        at = np.zeros(len(self.p))
        while len(active := np.flatnonzero((self.best > 0) & (at < self.best))):
            self._outward(active, at[active])
            at[active] += step[active]
        active = np.flatnonzero(self.best <= 0)
        while len(active):
            before = self.best[active]
            self._inward(active)
            active = active[self.best[active] < before]

    def _outward(self, active: Ints, at: Floats) -> None:
        """First entries above height `at`, or, where there is a cut at the surface, any piece that holds it."""
        probe, strand = self._listed(active, at)
        height = at[np.searchsorted(active, probe)]
        for chosen in self._likely_first(probe, strand):
            still = chosen[self.best[probe[chosen]] > 0]
            self._take(probe[still], strand[still], height[still], np.zeros(len(still)))

    def _inward(self, active: Ints) -> None:
        """The cut followed further in through every piece that holds the point reached so far."""
        probe, strand = self._listed(active, self.best[active])
        for chosen in self._likely_first(probe, strand):
            reached = self.best[probe[chosen]]
            self._take(probe[chosen], strand[chosen], reached, reached)

    def _likely_first(self, probe: Ints, strand: Ints) -> tuple[Ints, Ints]:
        """Which pairs to try, in two turns: the strand nearest to where the tool would touch each probe, then all."""
        n = self.n[probe]
        level = np.hypot(n[:, 0], n[:, 1])
        aside = sum(self.edge[1:]) / np.where(level > 0, level, 1.0)
        ideal = self.p[probe] + self.edge[0] * n + aside[:, None] * n * (1.0, 1.0, 0.0)
        order = np.lexsort((gap2(ideal, self.layers[0], strand), probe))
        return order[np.flatnonzero(np.diff(probe[order], prepend=-1))], np.arange(len(probe))

    def _take(self, probe: Ints, strand: Ints, at: Floats, held: Floats) -> None:
        """The lowest entries into these strands above `at`; below the surface, into pieces that hold height `held`."""
        strands, _, chords, pieces, _ = self.layers
        near = self._may_matter(probe, strand, at, strands)
        which, k = self._pieces_of(strand[near])
        pair = np.flatnonzero(near)[which]
        near = self._may_matter(probe[pair], k, at[pair], chords)
        pair, k = pair[near], k[near]
        probe, held = probe[pair], held[pair]
        p, n = self.p[probe], self.n[probe]
        entry, s = piece_entry(p, n, pieces, chords, k, self.edge, self.best[probe])
        counts = (entry < self.best[probe]) & np.isfinite(entry)
        x = p[counts] + held[counts, None] * n[counts]
        counts[counts] = (entry[counts] > 0) | contains(x, pieces, chords, k[counts], s[counts], self.edge)
        self._keep(probe[counts], entry[counts], k[counts], s[counts])

    def _keep(self, probe: Ints, entry: Floats, k: Ints, s: Floats) -> None:
        """The lowest new entry of every probe becomes its best."""
        order = np.lexsort((entry, probe))
        first = order[np.flatnonzero(np.diff(probe[order], prepend=-1))]
        self.best[probe[first]], self.owner[probe[first]], self.where[probe[first]] = entry[first], k[first], s[first]

    def _listed(self, active: Ints, at: Floats) -> tuple[Ints, Ints]:
        """Pairs (probe, strand) from the bins over the points at heights `at`."""
        x0, y0, cell_mm, rows, columns = self.grid
        x = self.p[active] + at[:, None] * self.n[active]
        i, j = np.floor((x[:, 0] - x0) / cell_mm), np.floor((x[:, 1] - y0) / cell_mm)
        inside = (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
        cell = (i[inside] * columns + j[inside]).astype(np.int64)
        which, place = _expanded(self.starts[cell], self.starts[cell + 1])
        return active[inside][which], self.layers[4][place].astype(np.int64)

    def _pieces_of(self, strand: Ints) -> tuple[Ints, Ints]:
        """(index of the strand in the list, piece) for every piece of the strands."""
        firsts = self.layers[1]
        return _expanded(firsts[strand], firsts[strand + 1])

    def _may_matter(self, probe: Ints, k: Ints, at: Floats, chords: Floats) -> Flags:
        """Whether a chord comes near enough to the stretch of the ray that is still open."""
        middle, half = 0.5 * (at + self.best[probe]), 0.5 * (self.best[probe] - at)
        x = self.p[probe] + middle[:, None] * self.n[probe]
        if len(self.edge) == 2:
            return ~is_beyond(x, self.n[probe], half, chords, k, self.edge)
        return np.asarray(gap2(x, chords, k) <= (self.radius + half + chords[k, 6]) ** 2)


def _expanded(begins: Ints, ends: Ints) -> tuple[Ints, Ints]:
    """(index of the range, value) for every value of the half-open ranges."""
    counts = ends - begins
    which = np.repeat(np.arange(len(counts)), counts)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts - begins, counts)
