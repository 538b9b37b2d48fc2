"""The time law: how speed grows and falls along a known path, one step of the interpolator at a time.

State is (s, v, a): path length, speed, acceleration along the path; the jerk is constant within a step. The path is a
row of pieces, each with a greatest speed, acceleration and jerk; piece q ends at `ends[q]`, where the speed may be at
most `nodes[q]`, and at the last piece known the speed must reach zero. Each step takes the largest jerk from which the
machine can still keep every limit ahead by braking with `PLANNED` of what it has; the rest covers that a step is not
infinitely short. Standstill is reached by a landing: jerks, a parabola in time, that end at (end, 0, 0) exactly.

Plain functions of numbers and arrays: `sim.motion.fast` compiles this very text, so the slow and the fast law agree.
Source: receding horizon after sim/motion/MODEL.md, section 2.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

PLANNED = 0.88
"""Share of jerk and acceleration that planning counts on. A speed ramp ends in two steps for any phase of the step
only if the planned jerk is at most 8/9 of the real one."""

S, V, A, PIECE, HORIZON, LANDING_LEFT, LANDING_STEPS, ALPHA, BETA, GAMMA, LANDING_END = range(11)
STATE_SIZE = 11
"""Places in the state array of `run`; a landing is (alpha, beta, gamma) over its steps, towards LANDING_END."""


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


def piece_at(s: float, piece: int, last: int, ends: Array) -> int:
    """Index of the piece that holds path length s, from `piece` on."""
    while piece < last and ends[piece] <= s:
        piece += 1
    return piece


def is_safe(
    s: float,
    v: float,
    a: float,
    piece: int,
    last: int,
    ends: Array,
    speeds: Array,
    nodes: Array,
    accs: Array,
    jerks: Array,
    tightening: float,
    dt: float,
) -> int:
    """Whether every limit from s on can be kept by braking (0 no, 1 yes); node `last` counts as speed zero.

    2: moreover nothing ahead is tighter than here within the distance of a full stop.

    Braking to a node counts on the tightest limits before it. Where limits tighten below the share `tightening` (a
    small rounding after a long leg) and the speed can be steady by then, what lies beyond is judged from there. A
    braking ramp changes its jerk between two steps, which costs less than J dt^3 of way; the step that crosses into
    tighter limits is already bound by them.
    """
    top = v + (a * a / (2.0 * PLANNED * jerks[piece]) if a > 0.0 else 0.0)
    if top > speeds[piece] * (1.0 + 1e-9) or abs(a) > accs[piece] * (1.0 + 1e-9):
        return 0
    verdict = 2
    acceleration, jerk = PLANNED * accs[piece], PLANNED * jerks[piece]
    stop = brake_mm(v, a, 0.0, acceleration, jerk)
    for q in range(piece, last + 1):
        ahead = ends[q] - s
        target, need = nodes[q] if q < last else 0.0, 0.0
        if top > target or accs[q] < 0.9 * accs[piece] or jerks[q] < 0.9 * jerks[piece]:
            verdict = 1
        if a > 0.0 or v > target:
            need = brake_mm(v, a, target, acceleration, jerk)
            if need > 0.0 and need + jerk * dt * dt * dt > ahead:
                return 0
        if ahead >= 1.1 * stop + v * dt:
            return verdict
        if q == last:
            return 1
        next_acceleration, next_jerk = PLANNED * accs[q + 1], PLANNED * jerks[q + 1]
        if next_jerk < jerk:
            ahead = max(ahead - 1.5 * min(top, target) * dt, 0.0)
            if need > ahead:
                return 0
        is_steady_by_then = ahead >= need and ahead >= ease_mm(v, a, 0.0, jerk)
        if is_steady_by_then and (next_acceleration < tightening * acceleration or next_jerk < tightening * jerk):
            s, v, a = ends[q], min(top, target), 0.0
            top = v
            acceleration, jerk = next_acceleration, next_jerk
        else:
            if abs(a) > accs[q + 1] and ease_mm(v, a, accs[q + 1], jerk) > ahead:
                return 0
            acceleration, jerk = min(acceleration, next_acceleration), min(jerk, next_jerk)
        stop = brake_mm(v, a, 0.0, acceleration, jerk)
    return 1


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


def step_to(
    s: float,
    v: float,
    a: float,
    j: float,
    piece: int,
    last: int,
    ends: Array,
    caps: Array,
    knots: Array,
    accs: Array,
    jerks: Array,
    stops: Indices,
) -> int:
    """The piece that holds s, if a step with jerk j from `piece` that ends at (s, v, a) breaks no limit; else -1."""
    acceleration, jerk, top = accs[piece], jerks[piece], caps[piece]
    while ends[piece] <= s:
        if piece == last or stops[piece] != 0:
            return -1
        top = min(top, knots[piece], caps[piece + 1])
        piece += 1
        acceleration, jerk = min(acceleration, accs[piece]), min(jerk, jerks[piece])
    if v > top * (1.0 + 1e-9) or v < -1e-9 or abs(a) > acceleration * (1.0 + 1e-9) or abs(j) > jerk * (1.0 + 1e-9):
        return -1
    return piece


def lands(
    s: float,
    v: float,
    a: float,
    steps: int,
    piece: int,
    stop: int,
    ends: Array,
    speeds: Array,
    nodes: Array,
    accs: Array,
    jerks: Array,
    stops: Indices,
    dt: float,
) -> bool:
    """Whether the landing on the end of piece `stop` in this many steps breaks no limit at any step."""
    alpha, beta, gamma = landing(ends[stop] - s, v, a, steps, dt)
    for left in range(steps, 0, -1):
        j = landing_jerk(alpha, beta, gamma, steps, left)
        s += dt * (v + dt * (a / 2.0 + dt * j / 6.0))
        v += dt * (a + dt * j / 2.0)
        a += dt * j
        if left == 1:
            s = np.nextafter(ends[stop], -math.inf)
        piece = step_to(s, v, a, j, piece, stop, ends, speeds, nodes, accs, jerks, stops)
        if piece < 0:
            return False
    return True


def plan_landing(
    state: Array,
    stop: int,
    ends: Array,
    speeds: Array,
    nodes: Array,
    accs: Array,
    jerks: Array,
    stops: Indices,
    dt: float,
    longest: int,
) -> bool:
    """Begin a landing on the end of piece `stop` if one is possible now, and say whether it is.

    A landing is smoother than the quickest stop and takes longer, so only the last `longest` steps before a stop are
    one; from rest, a whole short move is.
    """
    s, v, a = state[S], state[V], state[A]
    piece = int(state[PIECE])
    ahead = ends[stop] - s
    jerk = jerks[piece]
    if ahead > 1.3 * brake_mm(v, a, 0.0, PLANNED * accs[piece], PLANNED * jerk) + 4.0 * jerk * dt * dt * dt + v * dt:
        return False
    ramp_s = 3.0 * ahead / v if a < 0.0 and v > 0.0 else (32.0 * ahead / jerk) ** (1.0 / 3.0)
    least = max(3, int(ramp_s / dt))
    if v > 0.0 and least > longest:
        return False
    for steps in range(least, least + (6 if v > 0.0 else 60)):
        if lands(s, v, a, steps, piece, stop, ends, speeds, nodes, accs, jerks, stops, dt):
            alpha, beta, gamma = landing(ahead, v, a, steps, dt)
            state[LANDING_LEFT] = state[LANDING_STEPS] = steps
            state[ALPHA], state[BETA], state[GAMMA] = alpha, beta, gamma
            state[LANDING_END] = ends[stop]
            return True
    return False


def stop_jerk(
    s: float, v: float, a: float, piece: int, last: int, ends: Array, accs: Array, jerks: Array, dt: float
) -> float:
    """The jerk of this step on the way to standing still as soon as the limits here and just ahead allow."""
    acceleration, jerk, full = accs[piece], jerks[piece], jerks[piece]
    reach, soon = s + v * dt, s + v * (abs(a) / jerk + 2.0 * dt)
    q = piece
    while q < last and ends[q] <= soon:
        q += 1
        acceleration, jerk = min(acceleration, accs[q]), min(jerk, jerks[q])
        if ends[q - 1] <= reach:
            full = jerk
    return jerk_to_speed(v, a, 0.0, PLANNED * acceleration, PLANNED * jerk, full, dt)


def can_stop(
    s: float,
    v: float,
    a: float,
    j: float,
    piece: int,
    last: int,
    ends: Array,
    caps: Array,
    knots: Array,
    accs: Array,
    jerks: Array,
    stops: Indices,
    dt: float,
) -> bool:
    """Whether a step with jerk j, then `stop_jerk` to the end, breaks no limit of the machine at any step.

    `caps` and `knots` do not depend on the override, so what is safe stays safe when the switch is turned.
    """
    for _ in range(10_000):
        a_next = a + j * dt
        v_next = v + dt * (a + a_next) / 2.0
        s += dt * (v + dt * (a / 2.0 + dt * j / 6.0))
        piece = step_to(s, v_next, a_next, j, piece, last, ends, caps, knots, accs, jerks, stops)
        if piece < 0:
            return False
        if v_next <= 1e-9:
            return bool(abs(a_next) <= 1e-6 * accs[piece])
        v, a = v_next, a_next
        j = stop_jerk(s, v, a, piece, last, ends, accs, jerks, dt)
    return False


def choose_jerk(
    state: Array,
    last: int,
    ends: Array,
    speeds: Array,
    nodes: Array,
    caps: Array,
    knots: Array,
    accs: Array,
    jerks: Array,
    stops: Indices,
    is_holding: bool,
    dt: float,
) -> float:
    """The largest jerk of this step after which every limit ahead can be kept.

    `is_safe` chooses it by closed forms that foresee smooth braking; `can_stop` has the last word, step by step.
    Where nothing else passes, the way to standstill that the step before has proved is followed.
    """
    s, v, a = state[S], state[V], state[A]
    piece = int(state[PIECE])
    reach = piece_at(s + v * dt, piece, last, ends)
    acceleration, jerk, speed = accs[piece], jerks[piece], speeds[piece]
    for q in range(piece + 1, reach + 1):
        acceleration, jerk, speed = min(acceleration, accs[q]), min(jerk, jerks[q]), min(speed, speeds[q])
    if is_holding:
        speed = 0.0
    high = jerk_to_speed(v, a, speed, PLANNED * acceleration, PLANNED * jerk, jerk, dt)
    low = stop_jerk(s, v, a, piece, last, ends, accs, jerks, dt)
    if high <= low:
        return low
    proved = low
    trial, best = high, low
    for _ in range(8 if v > 0.0 else 40):
        a_next = a + trial * dt
        v_next = v + dt * (a + a_next) / 2.0
        s_next = s + dt * (v + dt * (a / 2.0 + dt * trial / 6.0))
        after = piece_at(s_next, piece, last, ends)
        is_slowing = v > speed and v_next <= v
        top = speeds[after]
        if is_slowing and top < v:
            speeds[after] = v
        good = is_safe(s_next, v_next, a_next, after, last, ends, speeds, nodes, accs, jerks, 0.5, dt)
        if good == 0:
            good = is_safe(s_next, v_next, a_next, after, last, ends, speeds, nodes, accs, jerks, 0.98, dt)
        speeds[after] = top
        if good == 2 and after == piece:
            return trial
        if good > 0:
            best = trial
            if trial == high:
                break
            low = trial
        else:
            high = trial
        trial = (low + high) / 2.0
    for _ in range(4 if v > 0.0 else 40):
        if best == proved or can_stop(s, v, a, best, piece, last, ends, caps, knots, accs, jerks, stops, dt):
            return best
        best = (best + proved) / 2.0
    return proved


def run(
    state: Array,
    count: int,
    ends: Array,
    speeds: Array,
    nodes: Array,
    caps: Array,
    knots: Array,
    accs: Array,
    jerks: Array,
    stops: Indices,
    ordinals: Indices,
    lookahead: int,
    is_holding: bool,
    dt: float,
    steps: int,
    log_s: Array,
    log_v: Array,
    log_piece: Indices,
) -> int:
    """Step until a stop is reached, the machine stands by order, or `steps` are done; returns the steps done.

    `state` is changed in place; row k of the logs holds path length, speed and piece after step k. Horizon: pieces of
    at most `lookahead` blocks beyond the present one, of the `count` known; its last end counts as a stop.
    """
    piece, last = int(state[PIECE]), int(state[HORIZON])
    stop = piece
    for k in range(steps):
        while last + 1 < count and ordinals[last + 1] <= ordinals[piece] + lookahead:
            last += 1
        while stop < last and stops[stop] == 0:
            stop += 1
        if ends[stop] != state[LANDING_END]:
            state[LANDING_LEFT] = 0
        is_landing = state[LANDING_LEFT] > 0
        if not (is_holding or is_landing):
            is_landing = plan_landing(state, stop, ends, speeds, nodes, accs, jerks, stops, dt, 12)
        if is_landing:
            left = int(state[LANDING_LEFT])
            j = landing_jerk(state[ALPHA], state[BETA], state[GAMMA], int(state[LANDING_STEPS]), left)
            state[LANDING_LEFT] = left - 1
        else:
            j = choose_jerk(state, last, ends, speeds, nodes, caps, knots, accs, jerks, stops, is_holding, dt)
        v, a = state[V], state[A]
        state[S] += dt * (v + dt * (a / 2.0 + dt * j / 6.0))
        state[V] = max(v + dt * (a + dt * j / 2.0), 0.0)
        state[A] = a + dt * j
        if is_landing and state[LANDING_LEFT] == 0:
            state[S], state[V], state[A] = state[LANDING_END], 0.0, 0.0
            piece = stop
        else:
            state[S] = min(state[S], ends[last])
            piece = piece_at(state[S], piece, last, ends)
            if state[V] < 1e-12 and abs(state[A]) < 1e-6:
                state[V], state[A] = 0.0, 0.0
        state[PIECE], state[HORIZON] = piece, last
        log_s[k], log_v[k], log_piece[k] = state[S], state[V], piece
        if state[V] == 0.0 and (is_landing or is_holding or speeds[piece] == 0.0):
            return k + 1
    return steps
