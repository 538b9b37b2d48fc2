"""Machining time in closed form: no stepping, for the plan, the setup sheet and the console.

The path is prepared as the machine prepares it. Speeds at its joins come from one backward and one forward pass that
know acceleration only; between two valleys of the speed so found, the time is corrected by what a jerk-limited rise
and fall over the same distance takes longer. Source: sim/motion/MODEL.md, section 6.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from sim.interpreter import canon
from sim.interpreter.canon import Command
from sim.motion.law import PLANNED, ramp_time_s
from sim.motion.limits import axis_limits
from sim.motion.path import Path
from sim.motion.pieces import Pieces
from sim.motion.prepare import Preparation
from sim.motion.values import MachineTimes, StopReason
from sim.profile import MillProfile

Array = NDArray[np.float64]


def estimate_time_s(
    commands: Iterable[Command], profile: MillProfile, *, times: MachineTimes | None = None, speed_error: float = 1e-3
) -> float:
    """Time from the first motion to the end of these commands at 100 % override, never waiting for blocks.

    Dwells, tool changes, spindle starts and exact stops are counted, programmed stops are not.
    """
    times = times or MachineTimes()
    axes = axis_limits(profile, profile.block_cycle_s)
    path = Path(axes, times.overload, speed_error, times.same_place_mm)
    preparation = Preparation(times.rounding_mm, stops_at_optional=False)
    path.add(preparation.take(commands, 0, is_single_block=False), 0.0)
    path.pieces.limit(1.0, 0)
    exact_stops = sum(reason is StopReason.EXACT_STOP for reason in path.reasons.values())
    standing = exact_stops * times.settle_s(float(np.max(axes.jerk)))
    standing += _event_time_s((event.command for event in preparation.events), times)
    return standing + _moving_time_s(path.pieces, profile.block_cycle_s)


def _event_time_s(commands: Iterable[Command], times: MachineTimes) -> float:
    """What the axes stand for, s."""
    total, spindle_rpm = 0.0, 0.0
    for command in commands:
        if isinstance(command, canon.Dwell):
            total += command.time_s
        elif isinstance(command, canon.ChangeTool):
            total += times.tool_change_s
        elif isinstance(command, canon.Spindle) and command.speed_rpm != spindle_rpm:
            spindle_rpm = command.speed_rpm
            total += times.spindle_start_s
    return total


def _moving_time_s(rows: Pieces, cycle_s: float) -> float:
    """Time in motion; every stop costs half a cycle more, since a landing takes whole cycles."""
    count = rows.count
    if count == 0:
        return 0.0
    lengths = rows.ends[:count] - rows.starts[:count]
    acceleration, jerk = PLANNED * rows.accs[:count], PLANNED * rows.jerks[:count]
    limits = rows.speeds[:count]
    nodes = _reachable(np.append(0.0, rows.nodes[:count]), acceleration, lengths)
    peaks = np.sqrt((nodes[:-1] ** 2 + nodes[1:] ** 2) / 2.0 + acceleration * lengths)
    peaks = np.minimum(peaks, limits)
    up, down = peaks - nodes[:-1], peaks - nodes[1:]
    ramps = (up * (peaks + nodes[:-1]) + down * (peaks + nodes[1:])) / (2.0 * acceleration)
    base = (up + down) / acceleration + np.maximum(lengths - ramps, 0.0) / np.maximum(peaks, 1e-12)
    stops = int(np.count_nonzero(rows.stops[:count]))
    return float(np.sum(base)) + _jerk_time_s(nodes, peaks, lengths, acceleration, jerk) + 0.5 * cycle_s * stops


def _reachable(nodes: Array, acceleration: Array, lengths: Array) -> Array:
    """Speeds at the joins (n + 1,) that acceleration alone allows, from those the joins allow."""
    energy = np.append(0.0, np.cumsum(2.0 * acceleration * lengths))
    square = nodes**2
    square[-1] = 0.0
    backward = np.minimum.accumulate((square + energy)[::-1])[::-1] - energy
    return np.asarray(np.sqrt(np.maximum(np.minimum.accumulate(backward - energy) + energy, 0.0)))


def _jerk_time_s(nodes: Array, peaks: Array, lengths: Array, acceleration: Array, jerk: Array) -> float:
    """What limited jerk adds, hump by hump: from one valley of the speed to the next."""
    valleys = [0]
    for k in range(1, len(nodes) - 1):
        if nodes[k] <= peaks[k - 1] and nodes[k] <= peaks[k] and (nodes[k] < peaks[k - 1] or nodes[k] < peaks[k]):
            is_fall = nodes[k] < nodes[k - 1] or nodes[k] < peaks[k - 1]
            is_rise = nodes[k] < nodes[k + 1] or nodes[k] < peaks[k]
            if is_fall and is_rise:
                valleys.append(k)
    valleys.append(len(nodes) - 1)
    total = 0.0
    for low, high in itertools.pairwise(valleys):
        distance = float(np.sum(lengths[low:high]))
        top = float(np.max(peaks[low:high]))
        a, j = float(np.min(acceleration[low:high])), float(np.min(jerk[low:high]))
        start, end = float(nodes[low]), float(nodes[high])
        total += _hump_s(start, end, top, distance, a, j) - _hump_s(start, end, top, distance, a, math.inf)
    return total


def _hump_s(start: float, end: float, top: float, distance: float, acceleration: float, jerk: float) -> float:
    """Time from speed `start` to `end` over this distance, at most `top` between them."""

    def ramps(peak: float) -> tuple[float, float]:
        """Time and distance of rise and fall."""
        total_s = total_mm = 0.0
        for v in (start, end):
            dv = max(peak - v, 0.0)
            t = dv / acceleration if math.isinf(jerk) else ramp_time_s(dv, acceleration, jerk)
            total_s += t
            total_mm += t * (peak + v) / 2.0
        return total_s, total_mm

    low, high = max(start, end), max(top, start, end)
    if ramps(high)[1] > distance:
        for _ in range(50):
            middle = (low + high) / 2.0
            low, high = (middle, high) if ramps(middle)[1] <= distance else (low, middle)
        high = low
    time_s, ramp_mm = ramps(high)
    return time_s + max(distance - ramp_mm, 0.0) / max(high, 1e-12)
