"""Closed forms of one jerk-limited change of speed: its time, its distance, and the jerk of the next step of it.

Plain functions of numbers: `sim.motion.fast` compiles this very text. Source: sim/motion/MODEL.md, section 2.
"""

from __future__ import annotations

import math

PLANNED = 0.88
"""Share of jerk and acceleration that planning counts on. A speed ramp ends in two steps for any phase of the step
only if the planned jerk is at most 8/9 of the real one."""


def ramp_time_s(dv: float, acceleration: float, jerk: float) -> float:
    """Least time to change the speed by dv >= 0, mm/s, from and to zero acceleration."""
    if dv <= acceleration * acceleration / jerk:
        return 2.0 * math.sqrt(dv / jerk)
    return acceleration / jerk + dv / acceleration


def brake_mm(v: float, a: float, target: float, acceleration: float, jerk: float) -> float:
    """Distance in which speed v with acceleration a comes down to `target` and stays; 0 when it needs none."""
    distance = 0.0
    if a > 0.0:
        t = a / jerk
        peak = v + a * t / 2.0
        if peak <= target:
            return 0.0
        distance = t * (v + t * (a / 2.0 - jerk * t / 6.0))
        return distance + (peak + target) / 2.0 * ramp_time_s(peak - target, acceleration, jerk)
    if v <= target:
        return 0.0
    t = -a / jerk
    if v + a * t / 2.0 <= target:
        t = (-a - math.sqrt(max(a * a - 2.0 * jerk * (v - target), 0.0))) / jerk
        return t * (v + t * (a / 2.0 + jerk * t / 6.0))
    acceleration = max(acceleration, -a)
    before = v - a * t / 2.0
    done = t * (before - jerk * t * t / 6.0)
    return max((before + target) / 2.0 * ramp_time_s(before - target, acceleration, jerk) - done, 0.0)


def ease_mm(v: float, a: float, acceleration: float, jerk: float) -> float:
    """Distance in which |a| comes down to `acceleration`."""
    t = (abs(a) - acceleration) / jerk
    return t * (v + t * (a / 2.0 - math.copysign(jerk * t / 6.0, a)))


def jerk_to_speed(
    v: float, a: float, target: float, acceleration: float, jerk: float, full_jerk: float, dt: float
) -> float:
    """The jerk of this step on the quickest way to `target` with zero acceleration, never past it.

    Two steps end it exactly where they can (`full_jerk` allowed); else the acceleration after the step is the one
    from which a ramp with `jerk` ends at the target.
    """
    gap = target - v
    first = gap / (dt * dt) - 1.5 * a / dt
    second = -gap / (dt * dt) + 0.5 * a / dt
    between = gap - dt * (a + first * dt / 2.0)
    if (
        abs(first) <= full_jerk
        and abs(second) <= full_jerk
        and abs(a + first * dt) <= acceleration
        and between * gap >= 0.0
    ):
        return first
    gap -= a * dt / 2.0
    wanted = jerk * (math.sqrt(dt * dt / 4.0 + 2.0 * abs(gap) / jerk) - dt / 2.0)
    wanted = min(wanted, acceleration)
    if gap < 0.0:
        wanted = -wanted
    return min(max((wanted - a) / dt, -full_jerk), full_jerk)
