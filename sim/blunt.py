"""Cutters with a flat end (bull-nose, flat) against rays, exact on the curve of every piece of their way.

Such a cutter is all that lies within the corner radius of its core: the upright half-cylinder over the flat end. The
distance to the core is convex, so along a short piece it falls to one lowest place, found by bisection on the sign of
its change with s. Scalars are mm; p is the probe's point, n its unit normal, q = p - c(s). The functions run compiled
where numba is installed and otherwise as they stand, slower, with the same figures.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]
Edge = tuple[float, float]
Stand = tuple[bool, float, float, float, float]
F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """The function through numba, kept on disk between runs, free of the interpreter's lock; itself without numba.

    What is kept of `sim.probe_fast` holds these functions too, and numba compares that file alone: after a change here
    remove the kept files, sim/__pycache__/*.nb?.
    """
    try:
        from numba import njit
    except ImportError:
        return function
    return cast("F", njit(cache=True, nogil=True, error_model="numpy")(function))


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
def _nearest(q: Vector, n: Vector, flat: float) -> Stand:
    """Where a line that misses the tool comes nearest to it, as `_stand` tells it."""
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
    _, gx, gy, gz = _beside(q[0] + high * n[0], q[1] + high * n[1], q[2] + high * n[2], flat)
    return False, math.inf, gx, gy, gz


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
def _stand(q: Vector, n: Vector, edge: Edge) -> Stand:
    """(hits, height, outward direction there) of a line into the tool at rest; without a hit, the nearest approach.

    The floor and the side bound the entry from below; where neither is met inside its face, the rounded edge is, by
    Newton's method on the distance, which for a convex solid comes from outside and never passes the entry.
    """
    corner, flat = edge
    outer = corner + flat
    side, floor, last = _bounds(q, n, outer, corner)
    h = max(side, floor)
    if last == -math.inf or h > last:
        return _nearest(q, n, flat)
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
    return _nearest(q, n, flat)


@compiled
def _seen(p: Vector, c: Floats, k: int, s: float) -> Vector:
    """The probe's point seen from the tool's reference at s of a piece."""
    return (
        p[0] - c[k, 0, 0] - s * (c[k, 1, 0] + s * (c[k, 2, 0] + s * c[k, 3, 0])),
        p[1] - c[k, 0, 1] - s * (c[k, 1, 1] + s * (c[k, 2, 1] + s * c[k, 3, 1])),
        p[2] - c[k, 0, 2] - s * (c[k, 1, 2] + s * (c[k, 2, 2] + s * c[k, 3, 2])),
    )


@compiled
def _change(c: Floats, k: int, s: float, gx: float, gy: float, gz: float) -> float:
    """How the distance along (gx, gy, gz) changes with s as the tool moves on."""
    vx = c[k, 1, 0] + s * (2.0 * c[k, 2, 0] + 3.0 * s * c[k, 3, 0])
    vy = c[k, 1, 1] + s * (2.0 * c[k, 2, 1] + 3.0 * s * c[k, 3, 1])
    vz = c[k, 1, 2] + s * (2.0 * c[k, 2, 2] + 3.0 * s * c[k, 3, 2])
    return float(-(gx * vx + gy * vy + gz * vz))


@compiled
def _turns(c: Floats, k: int) -> tuple[float, float]:
    """Where the height of a piece turns, rising, 1 for none: under a flat end each part has its own lowest place."""
    first, second, third = c[k, 1, 2], c[k, 2, 2], c[k, 3, 2]
    inner = second * second - 3.0 * third * first
    if inner <= 0.0 or (second == 0.0 and third == 0.0):
        return 1.0, 1.0
    lean = -(second + math.copysign(math.sqrt(inner), second))
    one = first / lean
    two = lean / (3.0 * third) if third != 0.0 else 1.0
    one, two = min(1.0, max(0.0, one)), min(1.0, max(0.0, two))
    return min(one, two), max(one, two)


@compiled
def _tried(p: Vector, n: Vector, c: Floats, k: int, s: float, edge: Edge, best: float, where: float) -> Vector:
    """(best entry, its s, change of the distance with s) after one more place of the tool."""
    hits, h, gx, gy, gz = _stand(_seen(p, c, k, s), n, edge)
    change = _change(c, k, s, gx, gy, gz)
    if hits and h < best:
        return h, s, change
    return best, where, change


@compiled
def entry(p: Vector, n: Vector, c: Floats, k: int, edge: Edge) -> tuple[float, float]:
    """(entry, s) of the line p + h n into the cutter swept along piece k; inf where it misses.

    `edge` is (corner radius, radius of the flat end), the latter above 0.
    """
    best, where = math.inf, 0.0
    one, two = _turns(c, k)
    for begin, end in ((0.0, one), (one, two), (two, 1.0)):
        low, high = begin, end
        if high <= low:
            continue
        best, where, falls = _tried(p, n, c, k, low, edge, best, where)
        best, where, rises = _tried(p, n, c, k, high, edge, best, where)
        if falls >= 0.0 or rises <= 0.0:
            continue
        while high - low > 1e-10:
            s = 0.5 * (low + high)
            best, where, change = _tried(p, n, c, k, s, edge, best, where)
            if change == 0.0:
                break
            if change < 0.0:
                low = s
            else:
                high = s
    return best, where


@compiled
def contains(p: Vector, c: Floats, k: int, edge: Edge) -> bool:
    """Whether a point is in the cutter swept along piece k."""
    corner, flat = edge
    one, two = _turns(c, k)
    for begin, end in ((0.0, one), (one, two), (two, 1.0)):
        low, high = begin, end
        for s in (low, high):
            x, y, z = _seen(p, c, k, s)
            if _beside(x, y, z, flat)[0] <= corner + 1e-12:
                return True
        while high - low > 1e-10:
            s = 0.5 * (low + high)
            x, y, z = _seen(p, c, k, s)
            distance, gx, gy, gz = _beside(x, y, z, flat)
            if distance <= corner + 1e-12:
                return True
            if _change(c, k, s, gx, gy, gz) < 0.0:
                low = s
            else:
                high = s
    return False
