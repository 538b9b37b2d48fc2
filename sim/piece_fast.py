"""A line against the cutter swept along one piece, compiled: exact on the piece's curve, end and shank.

The geometry is told in `sim/MODEL.md`; `sim.piece_pure` gives the same figures where numba is not installed. Scalars
are mm; p is the probe's point, n its unit normal, k the piece. A chord is (ax, ay, az, dx, dy, dz, sag). An edge is
(R,) for a ball, else (corner radius, radius of the flat end); numba makes code for the kind in use alone.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim import blunt
from sim.compiled import compiled

blunt_entry, blunt_contains, is_beyond = blunt.entry, blunt.contains, blunt.is_beyond  # numba asks for plain names

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]
Edge = tuple[float] | tuple[float, float]


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
def is_apart(x: Vector, n: Vector, half: float, chords: Floats, k: int, edge: Edge) -> bool:
    """Whether the stretch of a line to either side of x surely misses the cutter swept along a chord and its sag."""
    if len(edge) == 2:
        return is_beyond(x, n, half, chords, k, edge)
    return bool(_gap2(x, chords, k) > (edge[0] + half + chords[k, 6]) ** 2)


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
def piece_entry(
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
def contains(p: Vector, c: Floats, chords: Floats, k: int, s: float, edge: Edge) -> bool:
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
