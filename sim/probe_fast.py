"""Probes against the swept ball, compiled: one ray after the other, exact on the curve of every piece that counts.

The geometry is told in `sim/MODEL.md`; `sim.probe_pure` gives the same figures where numba is not installed. Scalars
are mm; p is the probe's point, n its unit normal, a chord is (ax, ay, az, dx, dy, dz, sag).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Items = NDArray[np.int32]
F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """The function through numba, kept on disk between runs, free of the interpreter's lock."""
    return cast("F", njit(cache=True, nogil=True)(function))


@compiled
def _gap2(x: float, y: float, z: float, chord: Floats) -> float:
    """Squared distance from a point to the chord with all that stands above it: the axis of the swept cutter."""
    rx, ry, rz = x - chord[0], y - chord[1], z - chord[2]
    dx, dy, dz = chord[3], chord[4], chord[5]
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
def _entry(qx: float, qy: float, qz: float, nx: float, ny: float, nz: float, radius: float) -> float:
    """Where the line s n first meets the ball about q (with all z zero: its circle in plan); inf if it does not."""
    a = nx * nx + ny * ny + nz * nz
    b = qx * nx + qy * ny + qz * nz
    inner = b * b - a * (qx * qx + qy * qy + qz * qz - radius * radius)
    if inner < 0.0 or a < 1e-24:
        return math.inf
    return (b - math.sqrt(inner)) / a


@compiled
def _start(p: Floats, n: Floats, chord: Floats, radius: float, up: float) -> float:
    """Parameter in [0, 1] of the sphere by which the line enters the capsule about a chord (up = 0: in plan)."""
    dx, dy, dz = chord[3], chord[4], up * chord[5]
    nx, ny, nz = n[0], n[1], up * n[2]
    qx, qy, qz = chord[0] - p[0], chord[1] - p[1], up * (chord[2] - p[2])
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
def _lowest(p: Floats, n: Floats, c: Floats, start: float, radius: float, up: float) -> tuple[float, float]:
    """(entry, s): the lowest entry over all balls of a piece, by Newton from `start` (up = 0: circles in plan).

    Stationary where the vector from the ball's centre to the entry is square to the tangent of the curve.
    """
    s = start
    entry = math.inf
    for _ in range(12):
        x = c[0, 0] + s * (c[1, 0] + s * (c[2, 0] + s * c[3, 0])) - p[0]
        y = c[0, 1] + s * (c[1, 1] + s * (c[2, 1] + s * c[3, 1])) - p[1]
        z = up * (c[0, 2] + s * (c[1, 2] + s * (c[2, 2] + s * c[3, 2])) - p[2])
        entry = _entry(x, y, z, n[0], n[1], up * n[2], radius)
        if entry == math.inf:
            return entry, s
        gx, gy, gz = entry * n[0] - x, entry * n[1] - y, up * entry * n[2] - z
        facing = gx * n[0] + gy * n[1] + gz * up * n[2]
        if facing == 0.0:
            return entry, s
        vx = c[1, 0] + s * (2.0 * c[2, 0] + 3.0 * s * c[3, 0])
        vy = c[1, 1] + s * (2.0 * c[2, 1] + 3.0 * s * c[3, 1])
        vz = up * (c[1, 2] + s * (2.0 * c[2, 2] + 3.0 * s * c[3, 2]))
        pull = gx * vx + gy * vy + gz * vz
        slope = pull / facing * (n[0] * vx + n[1] * vy + up * n[2] * vz) - (vx * vx + vy * vy + vz * vz)
        slope += gx * (2.0 * c[2, 0] + 6.0 * s * c[3, 0]) + gy * (2.0 * c[2, 1] + 6.0 * s * c[3, 1])
        slope += up * gz * (2.0 * c[2, 2] + 6.0 * s * c[3, 2])
        if slope >= 0.0:
            return entry, s
        following = min(1.0, max(0.0, s - pull / slope))
        if abs(following - s) < 1e-10:
            return entry, s
        s = following
    return entry, s


@compiled
def _piece_entry(p: Floats, n: Floats, c: Floats, chord: Floats, radius: float, best: float) -> tuple[float, float]:
    """(entry, s) of the line into the cutter swept along one piece, ball and shank; inf where it misses."""
    start = _start(p, n, chord, radius + chord[6], 1.0)
    x = chord[0] + start * chord[3] - p[0]
    y = chord[1] + start * chord[4] - p[1]
    z = chord[2] + start * chord[5] - p[2]
    bound = _entry(x, y, z, n[0], n[1], n[2], radius + chord[6])
    if bound < math.inf:
        if bound >= best:
            return math.inf, start
        entry, s = _lowest(p, n, c, start, radius, 1.0)
        height = c[0, 2] + s * (c[1, 2] + s * (c[2, 2] + s * c[3, 2]))
        if entry < math.inf and p[2] + entry * n[2] <= height:
            return entry, s
    return _shank_entry(p, n, c, chord, radius)


@compiled
def _shank_entry(p: Floats, n: Floats, c: Floats, chord: Floats, radius: float) -> tuple[float, float]:
    """(entry, s) through the upright side of the swept shank; inf where the line meets it below the ball's equator."""
    start = _start(p, n, chord, radius, 0.0)
    if chord[3] == 0.0 and chord[4] == 0.0:
        start = 0.0 if chord[5] >= 0.0 else 1.0
    entry, s = _lowest(p, n, c, start, radius, 0.0)
    height = c[0, 2] + s * (c[1, 2] + s * (c[2, 2] + s * c[3, 2]))
    if entry < math.inf and p[2] + entry * n[2] >= height:
        return entry, s
    return math.inf, s


@compiled
def _contains(p: Floats, c: Floats, s: float, chord: Floats, radius: float) -> bool:
    """Whether a point is in the cutter swept along a piece: in the ball at s, else in the sweep of the chord."""
    x = c[0, 0] + s * (c[1, 0] + s * (c[2, 0] + s * c[3, 0])) - p[0]
    y = c[0, 1] + s * (c[1, 1] + s * (c[2, 1] + s * c[3, 1])) - p[1]
    z = c[0, 2] + s * (c[1, 2] + s * (c[2, 2] + s * c[3, 2])) - p[2]
    if x * x + y * y + z * z <= radius * radius * (1.0 + 1e-12):
        return True
    return _gap2(p[0], p[1], p[2], chord) <= radius * radius


@compiled
def _cell(x: float, y: float, grid: Floats, rows: int, columns: int) -> int:
    """Number of the bin over a place in plan, or -1; grid is (x0, y0, cell width)."""
    i = math.floor((x - grid[0]) / grid[2])
    j = math.floor((y - grid[1]) / grid[2])
    return i * columns + j if 0 <= i < rows and 0 <= j < columns else -1


@compiled
def _outward(
    p: Floats,
    n: Floats,
    at: float,
    best: float,
    guess: int,
    pieces: Floats,
    chords: Floats,
    listed: Items,
    radius: float,
) -> tuple[float, int, bool]:
    """(height, piece, is_inside): first entry above the surface among listed pieces, or the deepest that holds p."""
    owner, is_inside, depth = guess, False, 0.0
    for k in range(len(listed)):
        piece = listed[k]
        middle, half = 0.5 * (at + best), 0.5 * (best - at)
        chord = chords[piece]
        room = radius + chord[6] + half
        if _gap2(p[0] + middle * n[0], p[1] + middle * n[1], p[2] + middle * n[2], chord) > room * room:
            continue
        entry, s = _piece_entry(p, n, pieces[piece], chord, radius, best)
        if entry <= 0.0:
            if entry <= depth and _contains(p, pieces[piece], s, chord, radius):
                depth, owner, is_inside = entry, piece, True
        elif entry < best and not is_inside:
            best, owner = entry, piece
    return (depth if is_inside else best), owner, is_inside


@compiled
def _inward(
    p: Floats, n: Floats, depth: float, owner: int, pieces: Floats, chords: Floats, listed: Items, radius: float
) -> tuple[float, int]:
    """(height, piece): the cut followed further in through every listed piece that holds the point reached so far."""
    x = np.empty(3)
    for k in range(len(listed)):
        piece = listed[k]
        for axis in range(3):
            x[axis] = p[axis] + depth * n[axis]
        if _gap2(x[0], x[1], x[2], chords[piece]) > (radius + chords[piece, 6]) ** 2:
            continue
        entry, s = _piece_entry(p, n, pieces[piece], chords[piece], radius, depth)
        if entry < depth - 1e-9 and _contains(x, pieces[piece], s, chords[piece], radius):
            depth, owner = entry, piece
    return depth, owner


@compiled
def heights(
    points: Floats,
    normals: Floats,
    pieces: Floats,
    chords: Floats,
    starts: Ints,
    items: Items,
    grid: Floats,
    rows: int,
    columns: int,
    radius: float,
    reach: float,
    margin: float,
    out: Floats,
    owners: Ints,
) -> None:
    """Height along every normal at which the cutter's way begins (inf beyond `reach`), and the piece that cut there."""
    guess = -1
    for k in range(len(points)):
        p, n = points[k], normals[k]
        best, owner, at = reach, -1, 0.0
        if guess >= 0:
            entry, _ = _piece_entry(p, n, pieces[guess], chords[guess], radius, reach)
            if 0.0 < entry < reach:
                best, owner = entry, guess
        level = math.hypot(n[0], n[1])
        step = margin / level if level > 0.0 else math.inf
        is_inside = False
        while not is_inside and at < best:
            cell = _cell(p[0] + at * n[0], p[1] + at * n[1], grid, rows, columns)
            if cell >= 0:
                listed = items[starts[cell] : starts[cell + 1]]
                best, owner, is_inside = _outward(p, n, at, best, owner, pieces, chords, listed, radius)
            at += step
        before = 1.0
        while is_inside and best < before:
            before = best
            cell = _cell(p[0] + best * n[0], p[1] + best * n[1], grid, rows, columns)
            if cell >= 0:
                listed = items[starts[cell] : starts[cell + 1]]
                best, owner = _inward(p, n, best, owner, pieces, chords, listed, radius)
        out[k] = best if owner >= 0 else math.inf
        owners[k] = owner
        guess = owner
