"""Probes against the swept cutter, compiled: one ray after the other, exact on the curve of every piece that counts.

The geometry is told in `sim/MODEL.md`; `sim.probe_pure` gives the same figures where numba is not installed. Scalars
are mm; p is the probe's point, n its unit normal. A chord is (ax, ay, az, dx, dy, dz, sag). `layers` is (chords of
strands, first piece of each, chords of pieces, cubic pieces, strands listed in the bins); a grid is (x0, y0, cell
width, rows, columns); what is found is (height, piece, parameter on the piece). An edge is (R,) for a ball, else
(corner radius, radius of the flat end); numba makes code for the kind in use alone.
"""

from __future__ import annotations

import math

import numba  # noqa: F401  (its absence chooses sim.probe_pure)
import numpy as np
from numpy.typing import NDArray

from sim import blunt
from sim.compiled import compiled

blunt_entry, blunt_contains, is_beyond = blunt.entry, blunt.contains, blunt.is_beyond  # numba asks for plain names

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Items = NDArray[np.int32]
Layers = tuple[Floats, Ints, Floats, Floats, Items]
Vector = tuple[float, float, float]
Edge = tuple[float] | tuple[float, float]
Found = tuple[float, int, float]
Grid = tuple[float, float, float, int, int]


@compiled
def _gap2(x: Vector, chords: Floats, k: int) -> float:
    """Squared distance from a point to the chord with all that stands above it: the axis of the swept cutter."""
    rx, ry, rz = x[0] - chords[k, 0], x[1] - chords[k, 1], x[2] - chords[k, 2]
    dx, dy, dz = chords[k, 3], chords[k, 4], chords[k, 5]
    plan = dx * dx + dy * dy
    along = rx * dx + ry * dy
    s = min(1.0, max(0.0, along / plan)) if plan > 0.0 else (0.0 if dz >= 0.0 else 1.0)
    ex, ey = rx - s * dx, ry - s * dy
    if rz >= s * dz:
        return float(ex * ex + ey * ey)
    length = plan + dz * dz
    if length > 0.0:
        s = min(1.0, max(0.0, (along + rz * dz) / length))
    ex, ey, ez = rx - s * dx, ry - s * dy, rz - s * dz
    return float(ex * ex + ey * ey + ez * ez)


@compiled
def _is_apart(x: Vector, n: Vector, half: float, chords: Floats, k: int, edge: Edge) -> bool:
    """Whether the stretch of a line to either side of x surely misses the cutter swept along a chord and its sag."""
    if len(edge) == 2:
        return is_beyond(x, n, half, chords, k, edge)
    return bool(_gap2(x, chords, k) > (edge[0] + half + chords[k, 6]) ** 2)


@compiled
def _is_far(x: Vector, strands: Floats, k: int, room: float) -> bool:
    """Whether a ball about the middle of a strand, with all above it, is out of reach: a quick way to say no."""
    dx = x[0] - strands[k, 0] - 0.5 * strands[k, 3]
    dy = x[1] - strands[k, 1] - 0.5 * strands[k, 4]
    dz = min(0.0, x[2] - strands[k, 2] - 0.5 * strands[k, 5])
    bound = room + strands[k, 6] + strands[k, 7]
    return bool(dx * dx + dy * dy + dz * dz > bound * bound)


@compiled
def _entry(qx: float, qy: float, qz: float, nx: float, ny: float, nz: float, radius: float) -> float:
    """Where the line s n first meets the ball about q (with all z zero: its circle in plan); inf if it does not."""
    a = nx * nx + ny * ny + nz * nz
    b = qx * nx + qy * ny + qz * nz
    inner = b * b - a * (qx * qx + qy * qy + qz * qz - radius * radius)
    if inner < 0.0 or a < 1e-24:
        return math.inf
    return (b - math.sqrt(inner)) / a


@compiled
def _start(p: Vector, n: Vector, chords: Floats, k: int, radius: float, up: float) -> float:
    """Parameter in [0, 1] of the sphere by which the line enters the capsule about a chord (up = 0: in plan)."""
    dx, dy, dz = chords[k, 3], chords[k, 4], up * chords[k, 5]
    nx, ny, nz = n[0], n[1], up * n[2]
    qx, qy, qz = chords[k, 0] - p[0], chords[k, 1] - p[1], up * (chords[k, 2] - p[2])
    length = dx * dx + dy * dy + dz * dz
    if length == 0.0:
        return 0.0
    nd = (nx * dx + ny * dy + nz * dz) / length
    qd = (qx * dx + qy * dy + qz * dz) / length
    entry = _entry(qx - qd * dx, qy - qd * dy, qz - qd * dz, nx - nd * dx, ny - nd * dy, nz - nd * dz, radius)
    if entry == math.inf:
        return 0.0 if nd > 0.0 else 1.0
    return float(min(1.0, max(0.0, entry * nd - qd)))


@compiled
def _lower_end(p: Vector, n: Vector, c: Floats, k: int, radius: float, up: float) -> float:
    """The end of a piece, s = 0 or 1, at which the line enters the ball lower (up = 0: circles in plan)."""
    x, y, z = c[k, 0, 0] - p[0], c[k, 0, 1] - p[1], up * (c[k, 0, 2] - p[2])
    first = _entry(x, y, z, n[0], n[1], up * n[2], radius)
    x += c[k, 1, 0] + c[k, 2, 0] + c[k, 3, 0]
    y += c[k, 1, 1] + c[k, 2, 1] + c[k, 3, 1]
    z += up * (c[k, 1, 2] + c[k, 2, 2] + c[k, 3, 2])
    return 0.0 if first <= _entry(x, y, z, n[0], n[1], up * n[2], radius) else 1.0


@compiled
def _lowest(p: Vector, n: Vector, c: Floats, k: int, start: float, radius: float, up: float) -> tuple[float, float]:
    """(entry, s): the lowest entry over all balls of a piece, by Newton from `start` (up = 0: circles in plan).

    Stationary where the vector from the ball's centre to the entry is square to the tangent of the curve. Where that
    would be a highest entry, over a bend sharper than the ball, or no entry, it starts again from the lower end.
    """
    s = start
    entry = math.inf
    is_again = False
    for _ in range(12):
        x = c[k, 0, 0] + s * (c[k, 1, 0] + s * (c[k, 2, 0] + s * c[k, 3, 0])) - p[0]
        y = c[k, 0, 1] + s * (c[k, 1, 1] + s * (c[k, 2, 1] + s * c[k, 3, 1])) - p[1]
        z = up * (c[k, 0, 2] + s * (c[k, 1, 2] + s * (c[k, 2, 2] + s * c[k, 3, 2])) - p[2])
        entry = _entry(x, y, z, n[0], n[1], up * n[2], radius)
        gx, gy, gz = entry * n[0] - x, entry * n[1] - y, up * entry * n[2] - z
        facing = gx * n[0] + gy * n[1] + gz * up * n[2]
        if facing == 0.0:
            return entry, s
        vx = c[k, 1, 0] + s * (2.0 * c[k, 2, 0] + 3.0 * s * c[k, 3, 0])
        vy = c[k, 1, 1] + s * (2.0 * c[k, 2, 1] + 3.0 * s * c[k, 3, 1])
        vz = up * (c[k, 1, 2] + s * (2.0 * c[k, 2, 2] + 3.0 * s * c[k, 3, 2]))
        pull = gx * vx + gy * vy + gz * vz
        slope = pull / facing * (n[0] * vx + n[1] * vy + up * n[2] * vz) - (vx * vx + vy * vy + vz * vz)
        slope += gx * (2.0 * c[k, 2, 0] + 6.0 * s * c[k, 3, 0]) + gy * (2.0 * c[k, 2, 1] + 6.0 * s * c[k, 3, 1])
        slope += up * gz * (2.0 * c[k, 2, 2] + 6.0 * s * c[k, 3, 2])
        if entry == math.inf or slope >= 0.0:
            if is_again:
                return entry, s
            is_again, following = True, _lower_end(p, n, c, k, radius, up)
        else:
            following = min(1.0, max(0.0, s - pull / slope))
        if abs(following - s) < 1e-10:
            return entry, s
        s = following
    return entry, s


@compiled
def _piece(c: Floats, k: int) -> blunt.Piece:
    """The coefficients of a piece as `sim.blunt` takes them."""
    return (
        *(c[k, 0, 0], c[k, 0, 1], c[k, 0, 2], c[k, 1, 0], c[k, 1, 1], c[k, 1, 2]),
        *(c[k, 2, 0], c[k, 2, 1], c[k, 2, 2], c[k, 3, 0], c[k, 3, 1], c[k, 3, 2]),
    )


@compiled
def _piece_entry(
    p: Vector, n: Vector, c: Floats, chords: Floats, k: int, edge: Edge, best: float
) -> tuple[float, float]:
    """(entry, s) of the line into the cutter swept along one piece, end and shank; nothing below `best` for a miss."""
    if len(edge) == 2:
        return blunt_entry(p, n, _piece(c, k), chords[k, 6], edge, best)
    radius = edge[0]
    start = _start(p, n, chords, k, radius + chords[k, 6], 1.0)
    x = chords[k, 0] + start * chords[k, 3] - p[0]
    y = chords[k, 1] + start * chords[k, 4] - p[1]
    z = chords[k, 2] + start * chords[k, 5] - p[2]
    bound = _entry(x, y, z, n[0], n[1], n[2], radius + chords[k, 6])
    if bound >= best and bound < math.inf and p[2] + bound * n[2] <= chords[k, 2] + start * chords[k, 5]:
        return math.inf, start
    if bound < best:
        entry, s = _lowest(p, n, c, k, start, radius, 1.0)
        height = c[k, 0, 2] + s * (c[k, 1, 2] + s * (c[k, 2, 2] + s * c[k, 3, 2]))
        if entry < math.inf and p[2] + entry * n[2] <= height:
            return entry, s
    return _shank_entry(p, n, c, chords, k, radius)


@compiled
def _shank_entry(p: Vector, n: Vector, c: Floats, chords: Floats, k: int, radius: float) -> tuple[float, float]:
    """(entry, s) through the upright side of the swept shank; inf where the line meets it below the ball's equator."""
    start = _start(p, n, chords, k, radius, 0.0)
    if chords[k, 3] == 0.0 and chords[k, 4] == 0.0:
        start = 0.0 if chords[k, 5] >= 0.0 else 1.0
    entry, s = _lowest(p, n, c, k, start, radius, 0.0)
    height = c[k, 0, 2] + s * (c[k, 1, 2] + s * (c[k, 2, 2] + s * c[k, 3, 2]))
    if entry < math.inf and p[2] + entry * n[2] >= height:
        return entry, s
    return math.inf, s


@compiled
def _contains(p: Vector, c: Floats, chords: Floats, k: int, s: float, edge: Edge) -> bool:
    """Whether a point is in the cutter swept along a piece: in ball or shank at s, else in the sweep of the chord."""
    if len(edge) == 2:
        return blunt_contains(p, _piece(c, k), chords[k, 6], edge)
    radius = edge[0]
    x = c[k, 0, 0] + s * (c[k, 1, 0] + s * (c[k, 2, 0] + s * c[k, 3, 0])) - p[0]
    y = c[k, 0, 1] + s * (c[k, 1, 1] + s * (c[k, 2, 1] + s * c[k, 3, 1])) - p[1]
    z = max(0.0, c[k, 0, 2] + s * (c[k, 1, 2] + s * (c[k, 2, 2] + s * c[k, 3, 2])) - p[2])
    if x * x + y * y + z * z <= radius * radius * (1.0 + 1e-12):
        return True
    return _gap2(p, chords, k) <= radius * radius


@compiled
def _cell(x: float, y: float, grid: Grid) -> int:
    """Number of the bin over a place in plan, or -1."""
    i = math.floor((x - grid[0]) / grid[2])
    j = math.floor((y - grid[1]) / grid[2])
    return i * grid[4] + j if 0 <= i < grid[3] and 0 <= j < grid[4] else -1


@compiled
def _outward(
    p: Vector, n: Vector, at: float, found: Found, layers: Layers, listed: tuple[int, int], edge: Edge
) -> Found:
    """The first entry above height `at` among the strands listed, or, <= 0, one that holds p."""
    strands, firsts, chords, pieces, items = layers
    best, owner, where = found
    for item in range(listed[0], listed[1]):
        middle, half = 0.5 * (at + best), 0.5 * (best - at)
        x = (p[0] + middle * n[0], p[1] + middle * n[1], p[2] + middle * n[2])
        strand = items[item]
        if _is_far(x, strands, strand, sum(edge) + half) or _is_apart(x, n, half, strands, strand, edge):
            continue
        for k in range(firsts[strand], firsts[strand + 1]):
            if _is_apart(x, n, half, chords, k, edge):
                continue
            entry, s = _piece_entry(p, n, pieces, chords, k, edge, best)
            if entry < best and (entry > 0.0 or _contains(p, pieces, chords, k, s, edge)):
                best, owner, where = entry, k, s
                if best <= 0.0:
                    return best, owner, where
    return best, owner, where


@compiled
def _inward(p: Vector, n: Vector, found: Found, layers: Layers, listed: tuple[int, int], edge: Edge) -> Found:
    """The cut followed further in through every piece that holds the point reached so far."""
    strands, firsts, chords, pieces, items = layers
    depth, owner, where = found
    for item in range(listed[0], listed[1]):
        strand = items[item]
        x = (p[0] + depth * n[0], p[1] + depth * n[1], p[2] + depth * n[2])
        if _is_apart(x, n, 0.0, strands, strand, edge):
            continue
        for k in range(firsts[strand], firsts[strand + 1]):
            x = (p[0] + depth * n[0], p[1] + depth * n[1], p[2] + depth * n[2])
            if _is_apart(x, n, 0.0, chords, k, edge):
                continue
            entry, s = _piece_entry(p, n, pieces, chords, k, edge, depth)
            if entry < depth and _contains(x, pieces, chords, k, s, edge):
                depth, owner, where = entry, k, s
    return depth, owner, where


@compiled
def _cut(
    p: Vector, n: Vector, found: Found, layers: Layers, starts: Ints, grid: Grid, edge: Edge, margin: float
) -> Found:
    """One probe: outward cell by cell to the first entry, or, where p is cut away, inward as far as the cut goes."""
    at = 0.0
    level = math.sqrt(n[0] * n[0] + n[1] * n[1])
    step = margin / level if level > 0.0 else math.inf
    while found[0] > 0.0 and at < found[0]:
        cell = _cell(p[0] + at * n[0], p[1] + at * n[1], grid)
        if cell >= 0:
            found = _outward(p, n, at, found, layers, (starts[cell], starts[cell + 1]), edge)
        at += step
    before = 1.0
    while found[0] <= 0.0 and found[0] < before:
        before = found[0]
        cell = _cell(p[0] + before * n[0], p[1] + before * n[1], grid)
        if cell >= 0:
            found = _inward(p, n, found, layers, (starts[cell], starts[cell + 1]), edge)
    return found


@compiled
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
    """Height along every normal at which the cutter's way begins (inf beyond `reach`), the piece that cut there, its s.

    The piece of the last probe is tried first: neighbours are cut by the same one, and all others are then far.
    """
    guess = -1
    for k in range(len(points)):
        p = (points[k, 0], points[k, 1], points[k, 2])
        n = (normals[k, 0], normals[k, 1], normals[k, 2])
        found = (reach, -1, 0.0)
        if guess >= 0:
            entry, s = _piece_entry(p, n, layers[3], layers[2], guess, edge, reach)
            if entry < reach and (entry > 0.0 or _contains(p, layers[3], layers[2], guess, s, edge)):
                found = (entry, guess, s)
        found = _cut(p, n, found, layers, starts, grid, edge, margin)
        guess = found[1]
        out[k] = found[0] if guess >= 0 else math.inf
        owners[k] = guess
        places[k] = found[2]
