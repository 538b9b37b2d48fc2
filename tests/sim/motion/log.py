"""What the tests read from a motion log: machines, programs, finite differences."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interpreter import canon
from sim.motion.machine import Machine
from sim.motion.values import MachineState, MachineTimes, Samples
from sim.profile import AxisLimits, MillProfile

Array = NDArray[np.float64]


def mill(
    *, acceleration: float = 2000.0, jerk: float = 20000.0, cycle_s: float = 0.004, lookahead: int = 100
) -> MillProfile:
    """A mill with three equal axes."""
    axis = AxisLimits(-500.0, 500.0, 20000.0 / 60.0, acceleration, jerk)
    return MillProfile(
        baud=9600,
        format="8N1",
        xon=17,
        xoff=19,
        says_xon_at_start=False,
        dialect="sinumerik",
        knot_rule="nx",
        poly_degree=5,
        g28="iso",
        backward_jump_alarm=14000,
        has_tool_changer=True,
        is_inch=False,
        resolution_mm=0.001,
        tool_length_reference="tip",
        receive_buffer_bytes=30720,
        xoff_free_bytes=120,
        xon_fill_bytes=15360,
        block_cycle_s=cycle_s,
        lookahead_blocks=lookahead,
        axes=(axis, axis, axis),
    )


def lines(points: Sequence[tuple[float, float, float]], feed_mm_min: float) -> list[canon.Command]:
    """Straight cuts through these points, one program line each."""
    return [canon.Line(k + 1, None, a, b, feed_mm_min) for k, (a, b) in enumerate(itertools.pairwise(points))]


def path_mode(mode: canon.PathMode, tolerance_mm: float | None = None) -> canon.SetPathMode:
    return canon.SetPathMode(0, None, mode, tolerance_mm)


def run(
    commands: Sequence[canon.Command | canon.LineRun],
    profile: MillProfile | None = None,
    *,
    step_s: float = 0.004,
    is_compiled: bool | None = False,
    times: MachineTimes | None = None,
) -> tuple[Machine, Samples]:
    """The whole program, all blocks known from the start."""
    machine = Machine(profile or mill(), step_s, is_compiled=is_compiled, times=times)
    for command in commands:
        machine.offer(command)
    machine.close()
    return machine, machine.advance(math.inf)


@dataclass(frozen=True)
class Differences:
    """Per axis, from positions: speeds, accelerations, jerks, each (n, 3)."""

    speed: Array
    acceleration: Array
    jerk: Array


def differences(positions_mm: Array, start: tuple[float, float, float], step_s: float) -> Differences:
    """Backward differences of the log's positions (n, 3), at rest before and after it."""
    rest = np.repeat([positions_mm[-1]], 3, axis=0)
    points = np.vstack([np.repeat([start], 3, axis=0), positions_mm, rest])
    speed = np.diff(points, axis=0) / step_s
    acceleration = np.diff(speed, axis=0) / step_s
    return Differences(speed, acceleration, np.diff(acceleration, axis=0) / step_s)


def dripped(
    commands: Sequence[canon.Command], profile: MillProfile, seed: int, *, has_operator: bool
) -> tuple[Machine, Samples]:
    """A run whose blocks come late and in any portions, with an operator at the switches or without.

    The end of the program is reached: at last the override is 100 % and cycle start has been pressed.
    """
    source = random.Random(seed)
    machine = Machine(profile, 0.004, is_compiled=None)
    pause_s, now_s = 10 ** source.uniform(-2.5, 0.0), 0.0
    left, parts = list(commands), []
    while left:
        portion = source.choice([1, 1, 1, 2, 3, 8])
        for command in left[:portion]:
            machine.offer(command)
        left = left[portion:]
        if has_operator:
            machine.set_override(source.choice([0.0, 10.0, 50.0, 100.0, 120.0]))
            source.choice([machine.feed_hold, machine.cycle_start, machine.cycle_start])()
        now_s += source.expovariate(1.0 / pause_s)
        parts.append(machine.advance(now_s))
    machine.close()
    machine.set_override(100.0)
    machine.cycle_start()
    parts.append(machine.advance(math.inf))
    assert machine.snapshot().state is MachineState.COMPLETED
    return machine, Samples.joined(parts)
