"""Limits checked on the sampled log, over random programs and machines (7.2)."""

from __future__ import annotations

import dataclasses
import itertools
import random

import numpy as np
import pytest
from scipy.spatial import cKDTree

from sim.interpreter import canon
from sim.interpreter.canon import Motion, PathMode
from sim.motion.machine import MachineState, StandStill
from sim.motion.shapes import shape_of
from sim.profile import AxisLimits, MillProfile
from tests.sim.motion.log import Array, differences, mill, run
from tests.sim.motion.programs import random_program


def random_mill(seed: int) -> MillProfile:
    """Three unlike axes and a look-ahead between 1 and 100 blocks."""
    source = random.Random(seed)
    axes = []
    for _ in range(3):
        acceleration = 10 ** source.uniform(2.7, 4.0)
        jerk = acceleration * 10 ** source.uniform(0.7, 1.5)
        axes.append(AxisLimits(-500.0, 500.0, source.uniform(50.0, 500.0), acceleration, jerk))
    return dataclasses.replace(mill(), axes=(axes[0], axes[1], axes[2]), lookahead_blocks=source.choice([1, 2, 5, 100]))


@pytest.mark.parametrize("mode", [PathMode.EXACT_STOP, PathMode.ROUNDING_TOLERANCE])
@pytest.mark.parametrize("kinds", [("line", "rapid"), ("arc", "line"), ("spline",)])
def test_speed_acceleration_and_jerk_stay_within_every_axis_limit(kinds: tuple[str, ...], mode: PathMode) -> None:
    """(7.2) Differences of the positions at every sample; end points exact; every stop has a reason."""
    for seed in range(15):
        profile, program = random_mill(seed), random_program(seed, kinds, mode)
        machine, samples = run(program, profile, is_compiled=None)
        motions = [command for command in program if isinstance(command, Motion)]
        log = differences(samples, motions[0].start, 0.004)
        axes = profile.axes
        assert machine.snapshot().state is MachineState.COMPLETED
        assert tuple(samples.position_mm[-1]) == motions[-1].end
        # a join of two curves may jump in curvature by what the jerk makes in one cycle
        slack = 1.0 if kinds == ("line", "rapid") else 1.75
        for axis in range(3):
            assert np.max(np.abs(log.speed[:, axis])) <= axes[axis].rapid_mm_s * (1.0 + 1e-6)
            assert np.max(np.abs(log.acceleration[:, axis])) <= axes[axis].acceleration_mm_s2 * (1.0 + 1e-6)
            assert np.max(np.abs(log.jerk[:, axis])) <= slack * axes[axis].jerk_mm_s3 * (1.0 + 1e-6)
        still = np.flatnonzero(samples.feed_mm_min == 0.0)
        stands = machine.stands
        for k in still:
            assert any(_explains(stand, float(samples.t_s[k]), samples.position_mm[k]) for stand in stands)


def _explains(stand: StandStill, t_s: float, position: Array) -> bool:
    """A standstill, or the last 2 um before one, where the axes may come to rest for a step."""
    if stand.t_s - 0.005 <= t_s <= stand.t_s + stand.duration_s + 0.005:
        return True
    return bool(0.0 <= stand.t_s - t_s <= 0.05 and np.linalg.norm(position - stand.position_mm) <= 0.002)


def _distances(samples: Array, motions: list[Motion]) -> tuple[Array, float]:
    """Distance of each sample from a cloud of points on the motions, and the pitch of that cloud, mm."""
    cloud = []
    for motion in motions:
        shape = shape_of(motion, 1e-6)
        cloud.append(shape.points(np.linspace(0.0, shape.length_mm, 4001)))
    pitch = max(float(np.max(np.linalg.norm(np.diff(part, axis=0), axis=1))) for part in cloud)
    distances, _ = cKDTree(np.vstack(cloud)).query(samples)
    return distances, pitch


@pytest.mark.parametrize("kinds", [("line",), ("arc", "line", "spline")])
def test_rounding_leaves_the_programmed_path_by_at_most_the_tolerance(kinds: tuple[str, ...]) -> None:
    """(7.1, 7.2) Every sample lies within the tolerance of the programmed path, and `roundings` says how far."""
    for seed in range(12):
        program = random_program(seed, kinds, PathMode.ROUNDING_TOLERANCE)
        program[0] = canon.SetPathMode(0, None, PathMode.ROUNDING_TOLERANCE, 0.02)
        machine, samples = run(program, mill(), is_compiled=None)
        distances, pitch = _distances(samples.position_mm, [c for c in program if isinstance(c, Motion)])
        assert np.max(distances) <= 0.02 + pitch
        assert all(rounding.deviation_mm <= 0.02 * (1 + 1e-6) for rounding in machine.roundings)


def test_travelled_is_what_the_log_went_through() -> None:
    """(7.1) The motions reported as made join end to end and hold every sample, roundings included."""
    for seed in range(8):
        program = random_program(seed, ("line", "arc", "spline"), PathMode.ROUNDING_TOLERANCE)
        machine, samples = run(program, mill(), is_compiled=None)
        travelled = machine.travelled
        for before, after in itertools.pairwise(travelled):
            assert np.allclose(before.end, after.start, atol=1e-6)
        distances, pitch = _distances(samples.position_mm, travelled)
        assert np.max(distances) <= pitch


def test_a_corner_without_rounding_steps_the_axes_by_no_more_than_the_overload() -> None:
    """(7.1) G64: the speed step of an axis is at most 1.2 x acceleration x cycle, plus one step of acceleration."""
    for seed in range(20):
        program = random_program(seed, ("line",), PathMode.CONTINUOUS)
        _, samples = run(program, mill(), is_compiled=None)
        log = differences(samples, (0.0, 0.0, 0.0), 0.004)
        assert np.max(np.abs(log.acceleration)) <= (1.2 + 1.0) * 2000.0
