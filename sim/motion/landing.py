"""Coming to rest exactly at a place: jerks, a parabola in time, that end at (end, 0, 0).

Plain functions of numbers and arrays: `sim.motion.fast` compiles this very text. Source: MODEL.md, section 2.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim.motion.braking import PLANNED, brake_mm
from sim.motion.rows import (
    ACC,
    ALPHA,
    BETA,
    END,
    GAMMA,
    JERK,
    LANDING_END,
    LANDING_LEFT,
    LANDING_STEPS,
    PIECE,
    A,
    S,
    V,
    step_to,
)

Array = NDArray[np.float64]


def landing(ahead: float, v: float, a: float, steps: int, dt: float) -> tuple[float, float, float]:
    """Least-norm jerks over `steps` (>= 3) steps that end `ahead` mm further at rest: (alpha, beta, gamma).

    With m steps still to come after a step and x = m - (steps - 1)/2 its jerk is alpha + beta x + gamma (x^2 -
    (steps^2 - 1)/12): these three are orthogonal over the steps, which makes the three end conditions triangular.
    """
    n = float(steps)
    r_a = -a / dt
    r_v = -(v + n * dt * a) / (dt * dt)
    r_s = (ahead - n * dt * (v + n * dt * a / 2.0)) / (dt * dt * dt)
    b = r_v - n / 2.0 * r_a
    c = 2.0 * (r_s - n / 2.0 * b - n * n / 6.0 * r_a)
    square = n * n - 1.0
    return r_a / n, b / (n * square / 12.0), c / (n * square * (n * n - 4.0) / 180.0)


def landing_jerk(alpha: float, beta: float, gamma: float, steps: int, left: int) -> float:
    """The jerk of the step of a landing after which `left` - 1 steps remain."""
    x = left - 1.0 - (steps - 1.0) / 2.0
    return alpha + beta * x + gamma * (x * x - (steps * steps - 1.0) / 12.0)


def next_landing_jerk(state: Array) -> float:
    """The jerk of the next step of the landing under way."""
    left = int(state[LANDING_LEFT])
    state[LANDING_LEFT] = left - 1
    return landing_jerk(state[ALPHA], state[BETA], state[GAMMA], int(state[LANDING_STEPS]), left)


def lands(s: float, v: float, a: float, steps: int, piece: int, stop: int, rows: Array, dt: float) -> bool:
    """Whether the landing on the end of piece `stop` in this many steps breaks no limit at any step."""
    alpha, beta, gamma = landing(rows[stop, END] - s, v, a, steps, dt)
    for left in range(steps, 0, -1):
        j = landing_jerk(alpha, beta, gamma, steps, left)
        s += dt * (v + dt * (a / 2.0 + dt * j / 6.0))
        v += dt * (a + dt * j / 2.0)
        a += dt * j
        if left == 1:
            s = np.nextafter(rows[stop, END], -math.inf)
        piece = step_to(s, v, a, j, piece, stop, rows)
        if piece < 0:
            return False
    return True


def plan_landing(state: Array, stop: int, rows: Array, dt: float, longest: int) -> bool:
    """Begin a landing on the end of piece `stop` if one is possible now, and say whether it is.

    A landing is smoother than the quickest stop and takes longer, so only the last `longest` steps before a stop are
    one; from rest, a whole short move is.
    """
    s, v, a = state[S], state[V], state[A]
    piece = int(state[PIECE])
    ahead = rows[stop, END] - s
    jerk = rows[piece, JERK]
    if (
        ahead
        > 1.3 * brake_mm(v, a, 0.0, PLANNED * rows[piece, ACC], PLANNED * jerk) + 4.0 * jerk * dt * dt * dt + v * dt
    ):
        return False
    ramp_s = 3.0 * ahead / v if a < 0.0 and v > 0.0 else (32.0 * ahead / jerk) ** (1.0 / 3.0)
    least = max(3, int(ramp_s / dt))
    if v > 0.0 and least > longest:
        return False
    for steps in range(least, least + (6 if v > 0.0 else 60)):
        if lands(s, v, a, steps, piece, stop, rows, dt):
            alpha, beta, gamma = landing(ahead, v, a, steps, dt)
            state[LANDING_LEFT] = state[LANDING_STEPS] = steps
            state[ALPHA], state[BETA], state[GAMMA] = alpha, beta, gamma
            state[LANDING_END] = rows[stop, END]
            return True
    return False
