"""What the tests read from a motion log: machines, programs, finite differences."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interpreter import canon
from sim.motion.machine import Machine
from sim.motion.values import MachineTimes, Samples
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


def differences(samples: Samples, start: tuple[float, float, float], step_s: float) -> Differences:
    """Backward differences of the log, at rest before and after it."""
    rest = np.repeat([samples.position_mm[-1]], 3, axis=0)
    points = np.vstack([np.repeat([start], 3, axis=0), samples.position_mm, rest])
    speed = np.diff(points, axis=0) / step_s
    acceleration = np.diff(speed, axis=0) / step_s
    return Differences(speed, acceleration, np.diff(acceleration, axis=0) / step_s)
