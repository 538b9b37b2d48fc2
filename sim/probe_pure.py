"""Probes against the swept cutter in numpy: the twin of `sim.probe_fast`, many (probe, piece) pairs at a time.

p, n are (m, 3) arrays of pairs: probe points and unit normals, mm; k (m,) the pieces. `layers` and a grid are told in
`sim.probe_fast`; a test holds both to the same figures.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim import blunt

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Items = NDArray[np.int32]
Layers = tuple[Floats, Ints, Floats, Floats, Items]
Grid = tuple[float, float, float, int, int]
Edge = tuple[float] | tuple[float, float]

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
        order = np.lexsort((_gap2(ideal, self.layers[0], strand), probe))
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
        entry, s = _piece_entry(p, n, pieces, chords, k, self.edge, self.best[probe])
        counts = (entry < self.best[probe]) & np.isfinite(entry)
        x = p[counts] + held[counts, None] * n[counts]
        counts[counts] = (entry[counts] > 0) | _contains(x, pieces, chords, k[counts], s[counts], self.edge)
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
            return ~_is_beyond(x, self.n[probe], half, chords, k, self.edge)
        return np.asarray(_gap2(x, chords, k) <= (self.radius + half + chords[k, 6]) ** 2)


def _expanded(begins: Ints, ends: Ints) -> tuple[Ints, Ints]:
    """(index of the range, value) for every value of the half-open ranges."""
    counts = ends - begins
    which = np.repeat(np.arange(len(counts)), counts)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts - begins, counts)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("ij,ij->i", a, b))


def _at(c: Floats, k: Ints, s: Floats) -> Floats:
    """Points of the pieces k at parameters s."""
    t = s[:, None]
    return np.asarray(c[k, 0] + t * (c[k, 1] + t * (c[k, 2] + t * c[k, 3])))


def _gap2(x: Floats, chords: Floats, k: Ints) -> Floats:
    """Squared distance from points to the chords with all that stands above them: the axis of the swept cutter."""
    r, d = x - chords[k, :3], chords[k, 3:6]
    plan, along = _dot(d[:, :2], d[:, :2]), _dot(r[:, :2], d[:, :2])
    s = np.where(plan > 0, along / np.where(plan > 0, plan, 1.0), np.where(d[:, 2] >= 0, 0.0, 1.0))
    s = np.clip(s, 0.0, 1.0)
    beside = r - s[:, None] * d
    length = plan + d[:, 2] ** 2
    t = np.where(length > 0, (along + r[:, 2] * d[:, 2]) / np.where(length > 0, length, 1.0), s)
    below = r - np.clip(t, 0.0, 1.0)[:, None] * d
    return np.where(beside[:, 2] >= 0, _dot(beside[:, :2], beside[:, :2]), _dot(below, below))


def _is_beyond(x: Floats, n: Floats, half: Floats, chords: Floats, k: Ints, edge: tuple[float, float]) -> Flags:
    """Whether the stretches x - half n to x + half n surely miss the tool, as `sim.blunt.is_beyond` tells it."""
    r, d = x - chords[k, :3], chords[k, 3:6]
    plan = _dot(d[:, :2], d[:, :2])
    s = np.where(plan > 0, _dot(r[:, :2], d[:, :2]) / np.where(plan > 0, plan, 1.0), np.where(d[:, 2] >= 0, 0.0, 1.0))
    s = np.clip(s, 0.0, 1.0)
    q = r - s[:, None] * d
    rho = np.hypot(q[:, 0], q[:, 1])
    out, down = np.maximum(rho - edge[1], 0.0), np.minimum(q[:, 2], 0.0)
    distance = np.hypot(out, down)
    safe = np.where(distance > 0, distance, 1.0)
    level = np.where(rho > 0, out / (safe * np.where(rho > 0, rho, 1.0)), 0.0)
    g = np.column_stack([level * q[:, 0], level * q[:, 1], down / safe])
    along = _dot(g, d)
    nearer = np.maximum(-s * along, (1.0 - s) * along) + half * np.abs(_dot(g, n))
    return np.asarray(distance - nearer > edge[0] + chords[k, 6] + 1e-12)


def _entry(q: Floats, n: Floats, radius: Floats | float) -> Floats:
    """Where the lines s n first meet the balls about q (with all z zero: their circles in plan); inf if they do not."""
    a, b = _dot(n, n), _dot(q, n)
    inner = b * b - a * (_dot(q, q) - radius * radius)
    hits = (inner >= 0) & (a >= 1e-24)
    return np.where(hits, (b - np.sqrt(np.where(hits, inner, 0.0))) / np.where(hits, a, 1.0), np.inf)


def _start(p: Floats, n: Floats, chords: Floats, k: Ints, radius: Floats | float, up: Floats) -> Floats:
    """Parameters of the spheres by which the lines enter the capsules about chords (up = 0 in z: in plan)."""
    d, n, q = chords[k, 3:6] * up, n * up, (chords[k, :3] - p) * up
    length = _dot(d, d)
    safe = np.where(length > 0, length, 1.0)
    nd, qd = _dot(n, d) / safe, _dot(q, d) / safe
    entry = _entry(q - qd[:, None] * d, n - nd[:, None] * d, radius)
    hits = np.isfinite(entry)
    s = np.where(hits, np.where(hits, entry, 0.0) * nd - qd, np.where(nd > 0, 0.0, 1.0))
    return np.where(length > 0, np.clip(s, 0.0, 1.0), 0.0)


def _lower_end(p: Floats, n: Floats, c: Floats, k: Ints, radius: float, up: Floats) -> Floats:
    """The ends of pieces, s = 0 or 1, at which the lines enter the ball lower (up = 0 in z: in plan)."""
    ends = [_entry((_at(c, k, np.full(len(k), s)) - p) * up, n, radius) for s in (0.0, 1.0)]
    return np.where(ends[0] <= ends[1], 0.0, 1.0)


def _lowest(
    p: Floats, n: Floats, c: Floats, k: Ints, start: Floats, radius: float, up: Floats
) -> tuple[Floats, Floats]:
    """(entry, s): the lowest entries over all balls of the pieces, by Newton from `start` (up = 0 in z: in plan).

    From the lower end again where that would be a highest entry, or none.
    """
    s, entry, active, n = start.copy(), np.full(len(k), np.inf), np.arange(len(k)), n * up
    is_again = np.zeros(len(k), dtype=bool)
    for _ in range(12):
        here, t = k[active], s[active][:, None]
        q, m = (_at(c, here, s[active]) - p[active]) * up, n[active]
        found = _entry(q, m, radius)
        entry[active] = found
        g = np.where(np.isfinite(found), found, 0.0)[:, None] * m - q
        v = up * (c[here, 1] + t * (2.0 * c[here, 2] + 3.0 * t * c[here, 3]))
        bend = up * (2.0 * c[here, 2] + 6.0 * t * c[here, 3])
        pull, facing = _dot(g, v), _dot(g, m)
        slope = pull / np.where(facing != 0, facing, 1.0) * _dot(m, v) - _dot(v, v) + _dot(g, bend)
        falls = np.isfinite(found) & (slope < 0)
        following = np.clip(s[active] - pull / np.where(falls, slope, 1.0), 0.0, 1.0)
        turned = np.flatnonzero(~falls & ~is_again[active])
        following[turned] = _lower_end(p[active[turned]], n[active[turned]], c, here[turned], radius, up)
        goes_on = (falls | ~is_again[active]) & (facing != 0) & (np.abs(following - s[active]) >= 1e-10)
        is_again[active[turned]] = True
        s[active[goes_on]] = following[goes_on]
        active = active[goes_on]
        if not len(active):
            break
    return entry, s


def _piece_entry(
    p: Floats, n: Floats, c: Floats, chords: Floats, k: Ints, edge: Edge, best: Floats
) -> tuple[Floats, Floats]:
    """(entry, s) of the lines into the cutter swept along the pieces, end and shank; none below `best` for a miss."""
    if len(edge) == 2:
        cases = zip(*(each.tolist() for each in (p, n, c[k].reshape(-1, 12), chords[k, 6], best)), strict=True)
        found = [blunt.entry(tuple(a), tuple(b), tuple(piece), sag, edge, low) for a, b, piece, sag, low in cases]
        both = np.array(found).reshape(-1, 2)
        return both[:, 0], both[:, 1]
    radius = edge[0]
    space = np.ones(3)
    grown = radius + chords[k, 6]
    start = _start(p, n, chords, k, grown, space)
    centre = chords[k, :3] + start[:, None] * chords[k, 3:6]
    bound = _entry(centre - p, n, grown)
    entry, s = np.full(len(k), np.inf), start.copy()
    ball = np.flatnonzero(bound < best)
    entry[ball], s[ball] = _lowest(p[ball], n[ball], c, k[ball], start[ball], radius, space)
    is_below = _meets_below(p, n, entry, _at(c, k, s))
    shank = np.flatnonzero(~is_below & ~((bound >= best) & _meets_below(p, n, bound, centre)))
    entry[shank], s[shank] = _shank_entry(p[shank], n[shank], c, chords, k[shank], radius)
    return entry, s


def _meets_below(p: Floats, n: Floats, entry: Floats, centres: Floats) -> Flags:
    """Whether the lines meet balls about these centres, and no higher than the equator, where the shank begins."""
    hits = np.isfinite(entry)
    return np.asarray(hits & (p[:, 2] + np.where(hits, entry, 0.0) * n[:, 2] <= centres[:, 2]))


def _shank_entry(p: Floats, n: Floats, c: Floats, chords: Floats, k: Ints, radius: float) -> tuple[Floats, Floats]:
    """(entry, s) through the upright side of the swept shank; inf where the lines meet it below the ball's equator."""
    plan = np.array([1.0, 1.0, 0.0])
    start = _start(p, n, chords, k, radius, plan)
    is_upright = (chords[k, 3] == 0) & (chords[k, 4] == 0)
    start = np.where(is_upright, np.where(chords[k, 5] >= 0, 0.0, 1.0), start)
    entry, s = _lowest(p, n, c, k, start, radius, plan)
    hits = np.isfinite(entry)
    hits &= p[:, 2] + np.where(hits, entry, 0.0) * n[:, 2] >= _at(c, k, s)[:, 2]
    return np.where(hits, entry, np.inf), s


def _contains(p: Floats, c: Floats, chords: Floats, k: Ints, s: Floats, edge: Edge) -> Flags:
    """Whether points are in the cutter swept along pieces: in ball or shank at s, else in the sweep of the chord."""
    if len(edge) == 2:
        cases = zip(p.tolist(), c[k].reshape(-1, 12).tolist(), chords[k, 6].tolist(), strict=True)
        return np.array([blunt.contains(tuple(a), tuple(b), sag, edge) for a, b, sag in cases], dtype=bool)
    radius = edge[0]
    q = _at(c, k, s) - p
    q[:, 2] = np.maximum(q[:, 2], 0.0)
    in_ball = _dot(q, q) <= radius * radius * (1.0 + 1e-12)
    return np.asarray(in_ball | (_gap2(p, chords, k) <= radius * radius))
