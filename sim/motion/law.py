"""The time law: how speed grows and falls along a known path, one step of the interpolator at a time.

State is (s, v, a): path length, speed, acceleration along the path; the jerk is constant within a step. The path is a
row of pieces (`sim.motion.rows`); at the end of the last one known the speed must reach zero. Each step takes the
largest jerk from which the machine can still keep every limit ahead by braking with `PLANNED` of what it has; the rest
covers that a step is not infinitely short. Standstill is reached by a landing.

Plain functions of numbers and arrays: `sim.motion.fast` compiles this very text, so the slow and the fast law agree.
Source: receding horizon after sim/motion/MODEL.md, section 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.motion.braking import PLANNED, brake_mm, ease_mm, jerk_to_speed
from sim.motion.landing import next_landing_jerk, plan_landing
from sim.motion.rows import (
    ACC,
    END,
    HORIZON,
    JERK,
    LANDING_END,
    LANDING_LEFT,
    NODE,
    PIECE,
    PROVED,
    SPEED,
    STOP,
    WAY_AT,
    WAY_END,
    WAY_REST,
    A,
    S,
    V,
    piece_at,
)
from sim.motion.standing import can_stop, leave_landing, way_jerk

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def is_safe(s: float, v: float, a: float, piece: int, last: int, rows: Array, tightening: float, dt: float) -> int:
    """Whether every limit from s on can be kept by braking (0 no, 1 yes); node `last` counts as speed zero.

    2: moreover nothing ahead is tighter than here within the distance of a full stop.

    Braking to a node counts on the tightest limits before it. Where limits tighten below the share `tightening` (a
    small rounding after a long leg) and the speed can be steady by then, what lies beyond is judged from there. A
    braking ramp changes its jerk between two steps, which costs less than J dt^3 of way; the step that crosses into
    tighter limits is already bound by them.
    """
    top = v + (a * a / (2.0 * PLANNED * rows[piece, JERK]) if a > 0.0 else 0.0)
    if top > rows[piece, SPEED] * (1.0 + 1e-9) or abs(a) > rows[piece, ACC] * (1.0 + 1e-9):
        return 0
    verdict = 2
    acceleration, jerk = PLANNED * rows[piece, ACC], PLANNED * rows[piece, JERK]
    stop = brake_mm(v, a, 0.0, acceleration, jerk)
    for q in range(piece, last + 1):
        ahead = rows[q, END] - s
        target, need = rows[q, NODE] if q < last else 0.0, 0.0
        if top > target or rows[q, ACC] < 0.9 * rows[piece, ACC] or rows[q, JERK] < 0.9 * rows[piece, JERK]:
            verdict = 1
        if a > 0.0 or v > target:
            need = brake_mm(v, a, target, acceleration, jerk)
            if need > 0.0 and need + jerk * dt * dt * dt > ahead:
                return 0
        if ahead >= 1.1 * stop + v * dt:
            return verdict
        if q == last:
            return 1
        next_acceleration, next_jerk = PLANNED * rows[q + 1, ACC], PLANNED * rows[q + 1, JERK]
        if next_jerk < jerk:
            ahead = max(ahead - 1.5 * min(top, target) * dt, 0.0)
            if need > ahead:
                return 0
        is_steady_by_then = ahead >= need and ahead >= ease_mm(v, a, 0.0, jerk)
        if is_steady_by_then and (next_acceleration < tightening * acceleration or next_jerk < tightening * jerk):
            s, v, a = rows[q, END], min(top, target), 0.0
            top = v
            acceleration, jerk = next_acceleration, next_jerk
        else:
            if abs(a) > rows[q + 1, ACC] and ease_mm(v, a, rows[q + 1, ACC], jerk) > ahead:
                return 0
            acceleration, jerk = min(acceleration, next_acceleration), min(jerk, next_jerk)
        stop = brake_mm(v, a, 0.0, acceleration, jerk)
    return 1


def choose_jerk(state: Array, last: int, rows: Array, way: Array, is_holding: bool, dt: float) -> float:
    """The largest jerk of this step after which every limit ahead can be kept.

    `is_safe` chooses it by closed forms that foresee smooth braking; `can_stop` has the last word, step by step.
    Where nothing else passes, the way to standstill that was proved last is followed.
    """
    s, v, a = state[S], state[V], state[A]
    piece = int(state[PIECE])
    reach = piece_at(s + v * dt, piece, last, rows)
    acceleration, jerk, speed = rows[piece, ACC], rows[piece, JERK], rows[piece, SPEED]
    for q in range(piece + 1, reach + 1):
        acceleration, jerk = min(acceleration, rows[q, ACC]), min(jerk, rows[q, JERK])
        speed = min(speed, rows[q, SPEED])
    if is_holding:
        speed = 0.0
    high = jerk_to_speed(v, a, speed, PLANNED * acceleration, PLANNED * jerk, jerk, dt)
    proved = way_jerk(state, rows, way, dt)
    if high > proved:
        best, is_proved = foreseen_jerk(state, last, rows, speed, proved, high, dt)
        for _ in range(4 if v > 0.0 else 40):
            if best == proved:
                break
            if is_proved or can_stop(s, v, a, best, piece, last, rows, dt):
                state[PROVED], state[WAY_AT], state[WAY_END] = last, 0.0, 0.0
                return best
            best = (best + proved) / 2.0
    if state[WAY_END] > 0:
        state[WAY_AT] += 1.0
    return proved


def foreseen_jerk(
    state: Array, last: int, rows: Array, speed: float, low: float, high: float, dt: float
) -> tuple[float, bool]:
    """The largest jerk from `low` to `high` that `is_safe` accepts, and whether nothing ahead can gainsay it."""
    s, v, a = state[S], state[V], state[A]
    piece = int(state[PIECE])
    trial, best = high, low
    for _ in range(8 if v > 0.0 else 40):
        a_next = a + trial * dt
        v_next = v + dt * (a + a_next) / 2.0
        s_next = s + dt * (v + dt * (a / 2.0 + dt * trial / 6.0))
        after = piece_at(s_next, piece, last, rows)
        is_slowing = v > speed and v_next <= v
        top = rows[after, SPEED]
        if is_slowing and top < v:
            rows[after, SPEED] = v
        good = is_safe(s_next, v_next, a_next, after, last, rows, 0.5, dt)
        if good == 0:
            good = is_safe(s_next, v_next, a_next, after, last, rows, 0.98, dt)
        rows[after, SPEED] = top
        if good == 2 and after == piece:
            return trial, True
        if good > 0:
            best = trial
            if trial == high:
                break
            low = trial
        else:
            high = trial
        trial = (low + high) / 2.0
    return best, False


def coasting_steps(state: Array, last: int, rows: Array, dt: float) -> int:
    """How many steps from here on the speed stays as it is: full feed, and nothing ahead to brake for so soon.

    It must be possible to stop after them; what lies between needs no proof of its own, since nobody interrupts.
    """
    s, v, piece = state[S], state[V], int(state[PIECE])
    if v == 0.0 or state[A] != 0.0 or v != rows[piece, SPEED]:
        return 0
    acceleration, jerk = rows[piece, ACC], rows[piece, JERK]
    q = piece
    while q < last and rows[q, NODE] == v and rows[q + 1, SPEED] == v:
        q += 1
        acceleration, jerk = min(acceleration, rows[q, ACC]), min(jerk, rows[q, JERK])
    room = rows[q, END] - s - 1.3 * brake_mm(v, 0.0, 0.0, PLANNED * acceleration, PLANNED * jerk)
    steps = max(int(room / (v * dt)) - 2, 0)
    while steps > 0:
        after = piece_at(s + steps * dt * v, piece, last, rows)
        if can_stop(s + steps * dt * v, v, 0.0, 0.0, after, last, rows, dt):
            state[PROVED], state[WAY_AT], state[WAY_END] = last, 0.0, 0.0
            break
        steps //= 2
    return steps


def coast(
    state: Array, count: int, last: int, rows: Array, dt: float, log_s: Array, log_v: Array, log_piece: Indices
) -> None:
    """`count` steps at the present speed."""
    piece, v = int(state[PIECE]), state[V]
    s = state[S]
    for k in range(count):
        s += dt * v
        piece = piece_at(s, piece, last, rows)
        log_s[k], log_v[k], log_piece[k] = s, v, piece
    state[S], state[PIECE] = s, piece


def make_step(state: Array, j: float, is_landing: bool, stop: int, last: int, rows: Array, dt: float) -> bool:
    """Go one step with jerk j; returns whether the written way to standstill has come to its end with it."""
    v, a = state[V], state[A]
    has_stopped = bool(0 < state[WAY_END] <= state[WAY_AT])
    state[S] += dt * (v + dt * (a / 2.0 + dt * j / 6.0))
    state[V] = max(v + dt * (a + dt * j / 2.0), 0.0)
    state[A] = a + dt * j
    if is_landing and state[LANDING_LEFT] == 0:
        state[S], state[V], state[A], state[PIECE] = state[LANDING_END], 0.0, 0.0, stop
        return False
    if has_stopped:
        state[S], state[V], state[A], state[WAY_AT], state[WAY_END] = state[WAY_REST], 0.0, 0.0, 0.0, 0.0
    else:
        state[S] = min(state[S], rows[last, END])
    state[PIECE] = piece_at(state[S], int(state[PIECE]), last, rows)
    settle(state, rows)
    return has_stopped


def settle(state: Array, rows: Array) -> None:
    """What rounding leaves of rest or of an even speed is none."""
    piece = int(state[PIECE])
    if state[V] < 1e-12 and abs(state[A]) < 1e-6:
        state[V], state[A] = 0.0, 0.0
    speed = rows[piece, SPEED]
    if abs(state[V] - speed) <= 1e-9 * speed and abs(state[A]) <= 1e-6 * rows[piece, ACC]:
        state[V], state[A] = speed, 0.0


def next_jerk(
    state: Array, stop: int, last: int, rows: Array, way: Array, is_holding: bool, dt: float
) -> tuple[float, bool]:
    """The jerk of this step, and whether it belongs to a landing on the end of piece `stop`."""
    if state[LANDING_LEFT] > 0 and rows[stop, END] != state[LANDING_END]:
        leave_landing(state, way)
    is_landing = state[LANDING_LEFT] > 0
    if not (is_holding or is_landing):
        is_landing = plan_landing(state, stop, rows, dt, 12)
    if not is_landing:
        return choose_jerk(state, last, rows, way, is_holding, dt), False
    state[WAY_AT], state[WAY_END] = 0.0, 0.0
    return next_landing_jerk(state), True


def run(
    state: Array,
    count: int,
    rows: Array,
    ordinals: Indices,
    lookahead: int,
    way: Array,
    is_holding: bool,
    dt: float,
    log_s: Array,
    log_v: Array,
    log_piece: Indices,
) -> int:
    """Step until a stop is reached, the machine stands by order, or the logs are full; returns the steps done.

    `state` and `way` (`sim.motion.standing`) are changed in place; row k of the logs holds path length, speed and piece
    after step k. Horizon: pieces of at most `lookahead` blocks beyond the present one, of the `count` known; its last
    end counts as a stop.
    """
    last = int(state[HORIZON])
    stop = int(state[PIECE])
    done = 0
    while done < len(log_s):
        piece = int(state[PIECE])
        while last + 1 < count and ordinals[last + 1] <= ordinals[piece] + lookahead:
            last += 1
        state[HORIZON] = last
        free = 0 if is_holding else min(coasting_steps(state, last, rows, dt), len(log_s) - done)
        if free > 0:
            coast(state, free, last, rows, dt, log_s[done:], log_v[done:], log_piece[done:])
            done += free
            continue
        stop = max(stop, piece)
        while stop < last and rows[stop, STOP] == 0.0:
            stop += 1
        j, is_landing = next_jerk(state, stop, last, rows, way, is_holding, dt)
        has_stopped = make_step(state, j, is_landing, stop, last, rows, dt)
        log_s[done], log_v[done], log_piece[done] = state[S], state[V], int(state[PIECE])
        done += 1
        if state[V] == 0.0 and (is_landing or is_holding or has_stopped or rows[int(state[PIECE]), SPEED] == 0.0):
            break
    return done
