"""The way to standstill: the proof that a step leaves one, and the way itself, followed until a better one is proved.

Every step leaves a way to standstill that breaks no limit. While the path stays as it is `stop_jerk` finds it again;
before anything ahead changes, `keep_way` writes its jerks down, since the limits of what comes might lead elsewhere.

Plain functions of numbers and arrays: `sim.motion.fast` compiles this very text. Source: MODEL.md, section 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.motion.braking import PLANNED, jerk_to_speed
from sim.motion.landing import next_landing_jerk
from sim.motion.rows import (
    ACC,
    END,
    JERK,
    LANDING_END,
    LANDING_LEFT,
    PIECE,
    PROVED,
    WAY_AT,
    WAY_END,
    WAY_REST,
    A,
    S,
    V,
    piece_at,
    step_to,
)

Array = NDArray[np.float64]

LONGEST_WAY = 10_000
"""Steps that a way to standstill may take."""


def stop_jerk(s: float, v: float, a: float, piece: int, last: int, rows: Array, dt: float) -> float:
    """The jerk of this step on the way to standing still as soon as the limits here and just ahead allow."""
    acceleration, jerk, full = rows[piece, ACC], rows[piece, JERK], rows[piece, JERK]
    reach, soon = s + v * dt, s + v * (abs(a) / jerk + 2.0 * dt)
    q = piece
    while q < last and rows[q, END] <= soon:
        q += 1
        acceleration, jerk = min(acceleration, rows[q, ACC]), min(jerk, rows[q, JERK])
        if rows[q - 1, END] <= reach:
            full = jerk
    return jerk_to_speed(v, a, 0.0, PLANNED * acceleration, PLANNED * jerk, full, dt)


def can_stop(s: float, v: float, a: float, j: float, piece: int, last: int, rows: Array, dt: float) -> bool:
    """Whether a step with jerk j, then `stop_jerk` to the end, breaks no limit of the machine at any step.

    CAP and KNOT do not depend on the override, so what is safe stays safe when the switch is turned.
    """
    for _ in range(LONGEST_WAY):
        a_next = a + j * dt
        v_next = v + dt * (a + a_next) / 2.0
        s += dt * (v + dt * (a / 2.0 + dt * j / 6.0))
        piece = step_to(s, v_next, a_next, j, piece, last, rows)
        if piece < 0:
            return False
        if v_next <= 1e-9:
            return bool(abs(a_next) <= 1e-6 * rows[piece, ACC])
        v, a = v_next, a_next
        j = stop_jerk(s, v, a, piece, last, rows, dt)
    return False


def way_jerk(state: Array, rows: Array, way: Array, dt: float) -> float:
    """The jerk of this step on the way to standstill that was proved last."""
    if state[WAY_AT] < state[WAY_END]:
        return float(way[int(state[WAY_AT])])
    return stop_jerk(state[S], state[V], state[A], int(state[PIECE]), int(state[PROVED]), rows, dt)


def keep_way(state: Array, rows: Array, way: Array, dt: float) -> float:
    """Write the proved way to standstill into `way`, if it is not there yet; returns the path length where it ends.

    A landing under way is one by itself.
    """
    if state[LANDING_LEFT] > 0:
        return float(state[LANDING_END])
    if state[WAY_AT] < state[WAY_END]:
        return float(state[WAY_REST])
    s, v, a = state[S], state[V], state[A]
    piece, last, count = int(state[PIECE]), int(state[PROVED]), 0
    while v > 1e-9 and count < LONGEST_WAY:
        j = stop_jerk(s, v, a, piece, last, rows, dt)
        s += dt * (v + dt * (a / 2.0 + dt * j / 6.0))
        v += dt * (a + dt * j / 2.0)
        a += dt * j
        piece = piece_at(s, piece, last, rows)
        way[count] = j
        count += 1
    state[WAY_AT], state[WAY_END], state[WAY_REST] = 0.0, count, s
    return float(s)


def leave_landing(state: Array, way: Array) -> None:
    """End a landing on what is no stop any more: its steps are the way to standstill until another is proved."""
    state[WAY_AT], state[WAY_END], state[WAY_REST] = 0.0, state[LANDING_LEFT], state[LANDING_END]
    count = int(state[LANDING_LEFT])
    for k in range(count):
        way[k] = next_landing_jerk(state)
