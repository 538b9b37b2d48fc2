"""Cutters with a flat end (bull-nose, flat) against rays, exact on the curve of every piece of their way.

Such a cutter is all that lies within the corner radius of its core: the upright half-cylinder over the flat end. Where
a line meets the tool, and how near it comes, are convex functions of the tool's place, so along a short piece they fall
to one lowest value and stay above their tangents. Scalars are mm; p is the probe's point, n its unit normal, c(s) the
tool's reference on a piece, q = p - c(s); a piece is the twelve coefficients of c, of s^0 first, x y z of each; `edge`
is (corner radius, radius of the flat end), the latter above 0. The functions run compiled where numba is installed and
otherwise as they stand, slower, with the same figures.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.compiled import compiled

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]
Edge = tuple[float, float]
Piece = tuple[float, ...]
Stand = tuple[bool, float, float, float, float]
Found = tuple[float, float]


class Look(NamedTuple):
    """The tool at one place s of a piece: the height at which the line meets it, or else the gap between the two.

    `rate` is how that value changes with s, `share` how much of a step of the tool can show in it.
    """

    s: float
    hits: bool
    value: float
    rate: float
    share: float


@compiled
def is_beyond(x: Vector, n: Vector, half: float, chords: Floats, k: int, edge: Edge) -> bool:
    """Whether the stretch x - half n to x + half n surely misses the tool all along a chord and its sag.

    A plane square to the way from the core to x must part them; False may mean that this plane does not.
    """
    rx, ry, rz = x[0] - chords[k, 0], x[1] - chords[k, 1], x[2] - chords[k, 2]
    dx, dy, dz = chords[k, 3], chords[k, 4], chords[k, 5]
    plan = dx * dx + dy * dy
    s = min(1.0, max(0.0, (rx * dx + ry * dy) / plan)) if plan > 0.0 else (0.0 if dz >= 0.0 else 1.0)
    distance, gx, gy, gz = _beside(rx - s * dx, ry - s * dy, rz - s * dz, edge[1])
    along = gx * dx + gy * dy + gz * dz
    nearer = max(-s * along, (1.0 - s) * along) + half * abs(gx * n[0] + gy * n[1] + gz * n[2])
    return bool(distance - nearer > edge[0] + chords[k, 6] + 1e-12)


@compiled
def _beside(x: float, y: float, z: float, flat: float) -> tuple[float, float, float, float]:
    """Distance to the core of a point seen from the tool's reference, and the direction away from the core."""
    rho = math.sqrt(x * x + y * y)
    out, down = max(rho - flat, 0.0), min(z, 0.0)
    distance = math.sqrt(out * out + down * down)
    if distance == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    level = out / (distance * rho) if rho > 0.0 else 0.0
    return distance, level * x, level * y, down / distance


@compiled
def entry(p: Vector, n: Vector, piece: Piece, sag: float, edge: Edge, best: float) -> Found:
    """(entry, s) of the line p + h n into the cutter swept along a piece, if lower than `best`; else (best, 0).

    `sag` bounds the distance of the piece from its chord.
    """
    found = (best, 0.0)
    one, two = _turns(piece)
    for begin, end in ((0.0, one), (one, two), (two, 1.0)):
        if begin < end:
            found = _lowest(p, n, piece, begin, end, sag, edge, found)
    return found


@compiled
def contains(p: Vector, piece: Piece, sag: float, edge: Edge) -> bool:
    """Whether a point is in the cutter swept along a piece."""
    return bool(entry(p, (0.0, 0.0, 0.0), piece, sag, edge, 1e-12)[0] < 1e-12)


@compiled
def _turns(piece: Piece) -> tuple[float, float]:
    """Where the height of a piece turns, rising, 1 for none: under a flat end each part has its own lowest place."""
    first, second, third = piece[5], piece[8], piece[11]
    inner = second * second - 3.0 * third * first
    if inner <= 0.0 or (second == 0.0 and third == 0.0):
        return 1.0, 1.0
    lean = -(second + math.copysign(math.sqrt(inner), second))
    one = first / lean
    two = lean / (3.0 * third) if third != 0.0 else 1.0
    one, two = min(1.0, max(0.0, one)), min(1.0, max(0.0, two))
    return min(one, two), max(one, two)


@compiled
def _lowest(
    p: Vector, n: Vector, piece: Piece, begin: float, end: float, sag: float, edge: Edge, found: Found
) -> Found:
    """The lower of what is found already and the lowest entry along a stretch of a piece.

    The stretch closes in on the place where the value turns from falling to rising, until nothing can be gained but
    1e-12 mm, or until the tangents tell that nothing in it is as low as what is found.
    """
    a, b = _look(p, n, piece, begin, edge), _look(p, n, piece, end, edge)
    for look in (a, b):
        if look.hits and look.value < found[0]:
            found = (look.value, look.s)
    before, now = a, b
    for turn in range(120):
        width = b.s - a.s
        if a.rate >= 0.0 or b.rate <= 0.0 or width * min(1.0, abs(now.rate)) < 1e-12:
            break
        if _floor(a, b, sag) >= (found[0] if a.hits or b.hits else 0.0):
            break
        before, now = now, _look(p, n, piece, _trial(a, b, before, now, turn), edge)
        if now.hits and now.value < found[0]:
            found = (now.value, now.s)
        if now.rate < 0.0:
            a = now
        else:
            b = now
    return found


@compiled
def _look(p: Vector, n: Vector, piece: Piece, s: float, edge: Edge) -> Look:
    """The tool at s of a piece; n = 0 asks for the point p, and the value is its gap, below 0 inside the edge."""
    x = p[0] - piece[0] - s * (piece[3] + s * (piece[6] + s * piece[9]))
    y = p[1] - piece[1] - s * (piece[4] + s * (piece[7] + s * piece[10]))
    z = p[2] - piece[2] - s * (piece[5] + s * (piece[8] + s * piece[11]))
    vx = piece[3] + s * (2.0 * piece[6] + 3.0 * s * piece[9])
    vy = piece[4] + s * (2.0 * piece[7] + 3.0 * s * piece[10])
    vz = piece[5] + s * (2.0 * piece[8] + 3.0 * s * piece[11])
    if n[0] == 0.0 and n[1] == 0.0 and n[2] == 0.0:
        distance, gx, gy, gz = _beside(x, y, z, edge[1])
        return Look(s, True, distance - edge[0], -(gx * vx + gy * vy + gz * vz), 1.0)
    hits, value, gx, gy, gz = _stand((x, y, z), n, edge)
    share = 1.0 / max(1e-9, -(gx * n[0] + gy * n[1] + gz * n[2])) if hits else 1.0
    return Look(s, hits, value, -share * (gx * vx + gy * vy + gz * vz), share)


@compiled
def _floor(a: Look, b: Look, sag: float) -> float:
    """What no value between a and b lies below: the crossing of the tangents, less what a piece strays from its own.

    Beside a miss the tangent of a hit counts alone.
    """
    x = _crossing(a, b)
    y = b.s - a.s - x
    strays = 4.0 * sag * max(a.share * x * x, b.share * y * y)
    return (a.value + a.rate * x if a.hits or not b.hits else b.value - b.rate * y) - strays


@compiled
def _crossing(a: Look, b: Look) -> float:
    """Where the tangents at a and b cross, as a distance from a; that of a hit and a miss at the miss."""
    width = b.s - a.s
    if a.hits != b.hits:
        return width if a.hits else 0.0
    return min(width, max(0.0, (b.value - a.value - b.rate * width) / (a.rate - b.rate)))


@compiled
def _trial(a: Look, b: Look, before: Look, now: Look, turn: int) -> float:
    """The place to look at next between a and b, `before` and `now` being the last two looks.

    Between a hit and a miss it is where the gap would close; else a secant of the rates finds a smooth turn, the
    crossing of the tangents a sharp one. Each second trial goes a little past it, so that both ends move.
    """
    width = b.s - a.s
    x = _crossing(a, b)
    if a.hits != b.hits:
        x = width - b.value / b.rate if a.hits else -a.value / a.rate
    elif abs(x - 0.5 * width) < 0.15 * width and before.rate != now.rate:
        x = now.s - a.s - now.rate * (now.s - before.s) / (now.rate - before.rate)
    if turn % 2 == 1:
        x += 0.01 * width if 2.0 * x < width else -0.01 * width
    return a.s + x if 0.0 < x < width and turn % 6 != 5 else a.s + 0.5 * width


@compiled
def _stand(q: Vector, n: Vector, edge: Edge) -> Stand:
    """(hits, height, outward direction there) of a line into the tool at rest; of a miss, the gap between the two.

    The floor and the side bound the entry from below; where neither is met inside its face, the rounded edge is, by
    Newton's method on the distance, which for a convex solid comes from outside and never passes the entry.
    """
    corner, flat = edge
    outer = corner + flat
    side, floor, last = _bounds(q, n, outer, corner)
    h = max(side, floor)
    if last == -math.inf or h > last:
        return _nearest(q, n, edge)
    x, y, z = q[0] + h * n[0], q[1] + h * n[1], q[2] + h * n[2]
    if floor >= side and (corner == 0.0 or x * x + y * y <= flat * flat):
        return True, h, 0.0, 0.0, -1.0
    if floor < side and (corner == 0.0 or z >= 0.0):
        return True, h, x / outer, y / outer, 0.0
    for _ in range(60):
        distance, gx, gy, gz = _beside(q[0] + h * n[0], q[1] + h * n[1], q[2] + h * n[2], flat)
        slope = gx * n[0] + gy * n[1] + gz * n[2]
        if distance - corner < 1e-12:
            return True, h, gx, gy, gz
        if slope >= 0.0 or h > last:
            break
        h -= (distance - corner) / slope
    return _nearest(q, n, edge)


@compiled
def _bounds(q: Vector, n: Vector, outer: float, corner: float) -> Vector:
    """(entry into the endless cylinder, entry over the plane of the floor, end of both); the end is -inf for a miss."""
    plan, along = n[0] * n[0] + n[1] * n[1], q[0] * n[0] + q[1] * n[1]
    outside = q[0] * q[0] + q[1] * q[1] - outer * outer
    side, last, floor = -math.inf, math.inf, -math.inf
    if plan > 1e-24:
        inner = along * along - plan * outside
        if inner < 0.0:
            return side, floor, -math.inf
        side, last = (-along - math.sqrt(inner)) / plan, (-along + math.sqrt(inner)) / plan
    elif outside > 0.0 or n[2] < 0.0:
        return side, floor, -math.inf
    if n[2] > 0.0:
        floor = (-corner - q[2]) / n[2]
    elif n[2] < 0.0:
        last = min(last, (-corner - q[2]) / n[2])
    elif q[2] < -corner:
        last = -math.inf
    return side, floor, last


@compiled
def _nearest(q: Vector, n: Vector, edge: Edge) -> Stand:
    """Where a line that misses the tool comes nearest to it, as `_stand` tells it."""
    corner, flat = edge
    plan = n[0] * n[0] + n[1] * n[1]
    low = -(q[0] * n[0] + q[1] * n[1]) / plan if plan > 1e-24 else -q[2] / n[2]
    high = -q[2] / n[2] if abs(n[2]) > 1e-12 else low
    low, high = min(low, high), max(low, high)
    for _ in range(50):
        h = 0.5 * (low + high)
        _, gx, gy, gz = _beside(q[0] + h * n[0], q[1] + h * n[1], q[2] + h * n[2], flat)
        if gx * n[0] + gy * n[1] + gz * n[2] < 0.0:
            low = h
        else:
            high = h
    x, y = q[0] + high * n[0], q[1] + high * n[1]
    distance, gx, gy, gz = _beside(x, y, q[2] + high * n[2], flat)
    rho = math.sqrt(x * x + y * y)
    out = (x * n[0] + y * n[1]) / rho if rho > 0.0 else 0.0
    size = math.sqrt(out * out + n[2] * n[2])
    if distance < 1e-12 and size > 0.0:  # it touches a flat cutter, so the way out is square to the line
        gx, gy, gz = abs(n[2]) / size * x / flat, abs(n[2]) / size * y / flat, -abs(out) / size
    return False, distance - corner, gx, gy, gz
