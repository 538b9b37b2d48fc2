"""How fast a piece of path may be driven: axis speeds, accelerations and jerks turned into limits along the path.

With r(s) by arc length, axis k moves with r'_k v, accelerates with r'_k a + r''_k v^2 and jerks with r'_k j +
3 r''_k v a + r'''_k v^3. Curvature gets a share of each limit, motion along the path what is left of it, so that the
sum holds on every axis at every moment. Derivation: sim/motion/MODEL.md, section 3.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim.profile import MillProfile

Array = NDArray[np.float64]

OVERRIDE_TOP = 1.2
"""The largest feed override; limits along the path are laid out for it, so that turning the switch is always safe."""

JOIN_SHARE = 0.05
"""What a join that is passed as it is may use of the jerk of an axis, seen at the interpolator's cycle: half of it by
steps of speed and of curvature, half by a change of direction while the path is accelerated."""

_TINY = 1e-300


@dataclass(frozen=True, slots=True)
class AxisLimits:
    """Per axis, shape (3,): speed mm/s, acceleration mm/s2, jerk mm/s3; and the interpolator's cycle in s."""

    speed: Array
    acceleration: Array
    jerk: Array
    cycle_s: float

    def spared(self) -> AxisLimits:
        """What is left for the motion between joins where some of these are passed as they are.

        Two of them within a cycle may add up, hence twice JOIN_SHARE.
        """
        step = 2.0 * JOIN_SHARE * np.minimum(self.jerk * self.cycle_s, self.acceleration)
        return replace(self, acceleration=self.acceleration - step, jerk=(1.0 - 2.0 * JOIN_SHARE) * self.jerk)


@dataclass(frozen=True, slots=True)
class Shares:
    """What curvature may use of the axis limits; the rest is for motion along the path."""

    acceleration: float = 0.7
    jerk: float = 0.4
    coupling: float = 0.25


@dataclass(frozen=True, slots=True)
class PieceLimits:
    """Along the path, (n,) each: speed cap mm/s without regard to the feed, acceleration mm/s2, jerk mm/s3."""

    speed: Array
    acceleration: Array
    jerk: Array


def axis_limits(profile: MillProfile, cycle_s: float) -> AxisLimits:
    """The limits of this machine as arrays."""
    return AxisLimits(
        speed=np.array([axis.rapid_mm_s for axis in profile.axes]),
        acceleration=np.array([axis.acceleration_mm_s2 for axis in profile.axes]),
        jerk=np.array([axis.jerk_mm_s3 for axis in profile.axes]),
        cycle_s=cycle_s,
    )


def straight_limits(direction: Array, axes: AxisLimits) -> PieceLimits:
    """Limits of straight pieces with unit directions (n, 3)."""
    share = np.maximum(np.abs(direction), 1e-12)
    return PieceLimits(
        speed=np.min(axes.speed / share, axis=1),
        acceleration=np.min(axes.acceleration / share, axis=1),
        jerk=np.min(axes.jerk / share, axis=1),
    )


def curved_limits(
    first: Array, second: Array, third: Array, feed_mm_s: Array, axes: AxisLimits, shares: Shares
) -> PieceLimits:
    """Limits of curved pieces from bounds (n, 3) on |r'|, |r''|, |r'''| of each axis, and their feeds (n,)."""
    first = np.maximum(first, 1e-12)
    cap = np.min(axes.speed / first, axis=1)
    cap = np.minimum(cap, np.min(np.sqrt(shares.acceleration * axes.acceleration / np.maximum(second, _TINY)), axis=1))
    cap = np.minimum(cap, np.min(np.cbrt(shares.jerk * axes.jerk / np.maximum(third, _TINY)), axis=1))
    v = np.minimum(cap, OVERRIDE_TOP * feed_mm_s)[:, None]
    acceleration = np.min((axes.acceleration - second * v**2) / first, axis=1)
    coupled = np.min(shares.coupling * axes.jerk / np.maximum(3.0 * second * v, _TINY), axis=1)
    acceleration = np.minimum(acceleration, coupled)
    rest = axes.jerk - third * v**3 - 3.0 * second * v * acceleration[:, None]
    return PieceLimits(speed=cap, acceleration=acceleration, jerk=np.min(rest / first, axis=1))


def join_speed(bend: Array, jump: Array, axes: AxisLimits) -> Array:
    """Speed (n,) at which a join is passed as it is: direction changes by `bend` (n, 3), r'' by `jump` (n, 3), 1/mm.

    At the cycle T a step v bend_k of the speed of axis k shows as a jerk of v bend_k / T^2, a step v^2 jump_k of its
    acceleration as 3/4 v^2 jump_k / T at most; together they keep to half of JOIN_SHARE. Zero where the bend is not
    gentle: with the path's acceleration A the axis' steps by A bend_k, which must keep to the other half.
    """
    cycle = axes.cycle_s
    allowed = 0.5 * JOIN_SHARE * np.minimum(axes.jerk, axes.acceleration / cycle)
    b, c = np.abs(bend) / cycle**2, 0.75 * np.abs(jump) / cycle
    speed = np.min(2.0 * allowed / np.maximum(b + np.sqrt(b * b + 4.0 * c * allowed), _TINY), axis=1)
    is_gentle = np.all(0.75 * np.abs(bend) * np.max(axes.acceleration) <= allowed * cycle, axis=1)
    return np.asarray(np.where(is_gentle, speed, 0.0))


def curve_pieces(
    derivatives: Callable[[Array], tuple[Array, Array, Array]],
    from_mm: float,
    to_mm: float,
    feed_mm_s: float,
    axes: AxisLimits,
    shares: Shares,
) -> tuple[Array, PieceLimits]:
    """Edges (m + 1,) of the pieces of a stretch of curve, and their limits: one piece where these hardly vary.

    Bounds are taken from 5 points a piece and widened by 2 %. Where the speed they allow changes by more than a third
    from one piece to the next, both are halved, so that a sharp bend within a long curve is not stepped over.
    """
    feed = min(feed_mm_s, float(np.max(axes.speed)))
    edges = np.linspace(from_mm, to_mm, 17)
    for _ in range(6):
        limits = _limits_between(derivatives, edges, feed, axes, shares)
        speed = np.minimum(limits.speed, OVERRIDE_TOP * feed)
        is_rough = np.abs(np.diff(np.log(speed))) > math.log(4.0 / 3.0)
        if not np.any(is_rough):
            break
        halved = np.flatnonzero(np.append(is_rough, False) | np.append(False, is_rough))
        edges = np.insert(edges, halved + 1, (edges[halved] + edges[halved + 1]) / 2.0)
    else:
        limits = _limits_between(derivatives, edges, feed, axes, shares)
    is_even = np.min(speed) >= OVERRIDE_TOP * feed or np.ptp(limits.speed) < 0.05 * np.max(limits.speed)
    if is_even and np.min(limits.acceleration) > 0.8 * np.max(limits.acceleration):
        worst = [np.min(column, keepdims=True) for column in (limits.speed, limits.acceleration, limits.jerk)]
        return edges[[0, -1]], PieceLimits(*worst)
    return edges, limits


def _limits_between(
    derivatives: Callable[[Array], tuple[Array, Array, Array]],
    edges: Array,
    feed_mm_s: float,
    axes: AxisLimits,
    shares: Shares,
) -> PieceLimits:
    """Limits of the pieces between these edges."""
    inner, margin, count = 4, 1.02, len(edges) - 1
    at = np.append((edges[:-1, None] + np.diff(edges)[:, None] * (np.arange(inner) / inner)).ravel(), edges[-1])
    first, second, third = (_greatest(np.abs(derivative), count, inner) * margin for derivative in derivatives(at))
    return curved_limits(first, second, third, np.full(count, feed_mm_s), axes, shares)


def _greatest(values: Array, count: int, inner: int) -> Array:
    """Row-wise maximum over each piece's points, ends included; (count, 3)."""
    starts = values[:-1].reshape(count, inner, -1)
    ends = values[inner::inner]
    return np.asarray(np.maximum(np.max(starts, axis=1), ends))
