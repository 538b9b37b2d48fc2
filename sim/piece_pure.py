"""Lines against the cutter swept along pieces, in numpy: the twin of `sim.piece_fast`, many pairs at a time.

p, n are (m, 3) arrays of pairs: probe points and unit normals, mm; k (m,) the pieces. A test holds both twins to the
same figures.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim import blunt

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Edge = tuple[float] | tuple[float, float]


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("ij,ij->i", a, b))


def _at(c: Floats, k: Ints, s: Floats) -> Floats:
    """Points of the pieces k at parameters s."""
    t = s[:, None]
    return np.asarray(c[k, 0] + t * (c[k, 1] + t * (c[k, 2] + t * c[k, 3])))


def gap2(x: Floats, chords: Floats, k: Ints) -> Floats:
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


def is_beyond(x: Floats, n: Floats, half: Floats, chords: Floats, k: Ints, edge: tuple[float, float]) -> Flags:
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


def piece_entry(
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


def contains(p: Floats, c: Floats, chords: Floats, k: Ints, s: Floats, edge: Edge) -> Flags:
    """Whether points are in the cutter swept along pieces: in ball or shank at s, else in the sweep of the chord."""
    if len(edge) == 2:
        cases = zip(p.tolist(), c[k].reshape(-1, 12).tolist(), chords[k, 6].tolist(), strict=True)
        return np.array([blunt.contains(tuple(a), tuple(b), sag, edge) for a, b, sag in cases], dtype=bool)
    radius = edge[0]
    q = _at(c, k, s) - p
    q[:, 2] = np.maximum(q[:, 2], 0.0)
    in_ball = _dot(q, q) <= radius * radius * (1.0 + 1e-12)
    return np.asarray(in_ball | (gap2(p, chords, k) <= radius * radius))
