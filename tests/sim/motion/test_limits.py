"""Limits checked on the sampled log, over random programs and machines (7.2)."""

from __future__ import annotations

import dataclasses
import itertools
import math
import random

import numpy as np
import pytest
from scipy.spatial import cKDTree

from sim.interpreter import canon
from sim.interpreter.canon import Motion, PathMode
from sim.motion.machine import Machine
from sim.motion.shapes import shape_of
from sim.motion.values import MachineState, MachineTimes, Samples, StandStill
from sim.profile import AxisLimits, MillProfile
from tests.sim.motion.log import Array, differences, dripped, lines, mill, run
from tests.sim.motion.programs import dense_program, random_program

KINDS = [("line", "rapid"), ("arc", "line"), ("spline",), ("line", "arc", "spline", "rapid")]


def random_mill(seed: int) -> MillProfile:
    """Three unlike axes and a look-ahead between 1 and 100 blocks."""
    source = random.Random(seed)
    axes = []
    for _ in range(3):
        acceleration = 10 ** source.uniform(2.7, 4.0)
        jerk = acceleration * 10 ** source.uniform(0.7, 1.5)
        axes.append(AxisLimits(-500.0, 500.0, source.uniform(50.0, 500.0), acceleration, jerk))
    return dataclasses.replace(mill(), axes=(axes[0], axes[1], axes[2]), lookahead_blocks=source.choice([1, 2, 5, 100]))


def check_limits(program: list[canon.Command], profile: MillProfile) -> None:
    """Speed, acceleration and jerk of every axis at every sample, by differences of the positions."""
    machine, samples = run(program, profile, is_compiled=None)
    assert machine.snapshot().state is MachineState.COMPLETED
    check_axes(program, profile, samples.position_mm)
    check_stands(machine, samples, 0.002)


def check_axes(program: list[canon.Command], profile: MillProfile, positions_mm: Array) -> None:
    """Positions (n, 3) that end where the program does and break no axis limit on the way."""
    motions = [command for command in program if isinstance(command, Motion)]
    log = differences(positions_mm, motions[0].start, 0.004)
    assert tuple(positions_mm[-1]) == motions[-1].end
    for number, axis in enumerate(profile.axes):
        assert np.max(np.abs(log.speed[:, number])) <= axis.rapid_mm_s * (1.0 + 1e-6)
        assert np.max(np.abs(log.acceleration[:, number])) <= axis.acceleration_mm_s2 * (1.0 + 1e-6)
        assert np.max(np.abs(log.jerk[:, number])) <= axis.jerk_mm_s3 * (1.0 + 1e-6)


@pytest.mark.parametrize("mode", list(PathMode))
@pytest.mark.parametrize("kinds", KINDS)
def test_speed_acceleration_and_jerk_stay_within_every_axis_limit(kinds: tuple[str, ...], mode: PathMode) -> None:
    """(7.2) At every sample, in every path mode; end points exact; every stop has a reason."""
    for seed in range(12):
        check_limits(random_program(seed, kinds, mode), random_mill(seed))


@pytest.mark.parametrize("mode", list(PathMode))
def test_short_rough_blocks_stay_within_every_axis_limit(mode: PathMode) -> None:
    """(7.2) Gentle bends that are passed as they are, rounded ones and straight joins, several within a few cycles."""
    for seed in range(12):
        check_limits(dense_program(seed, mode), random_mill(seed))


@pytest.mark.parametrize("mode", list(PathMode))
@pytest.mark.parametrize("has_operator", [False, True])
def test_blocks_that_come_late_make_no_axis_break_a_limit(has_operator: bool, mode: PathMode) -> None:
    """(7.2, 7.4) Whatever follows, the machine can still stop on the way proved before; and it says why it stands."""
    for seed in range(30):
        program = dense_program(seed, mode) if seed % 2 else random_program(seed, KINDS[seed % 4], mode)
        profile = random_mill(seed)
        machine, samples = dripped(program, profile, seed, has_operator=has_operator)
        check_axes(program, profile, samples.position_mm)
        check_stands(machine, samples, 0.005)


def check_stands(machine: Machine, samples: Samples, before_mm: float) -> None:
    """Every sample at rest belongs to a standstill with a reason, or to the last way before one.

    There the axes may come to rest for a step.
    """
    for k in np.flatnonzero(samples.feed_mm_min == 0.0):
        t_s, position = float(samples.t_s[k]), samples.position_mm[k]
        assert any(_explains(stand, t_s, position, before_mm) for stand in machine.stands), f"at {t_s:.3f} s"


def _explains(stand: StandStill, t_s: float, position: Array, before_mm: float) -> bool:
    if stand.t_s - 0.005 <= t_s <= stand.t_s + stand.duration_s + 0.005:
        return True
    return bool(0.0 <= stand.t_s - t_s <= 0.05 and np.linalg.norm(position - stand.position_mm) <= before_mm)


def _distances(samples: Array, motions: list[Motion]) -> tuple[Array, float]:
    """Distance of each sample from a cloud of points on the motions, and the pitch of that cloud, mm."""
    cloud = []
    for motion in motions:
        shape = shape_of(motion, 1e-6)
        cloud.append(shape.points(np.linspace(0.0, shape.length_mm, 4001)))
    pitch = max(float(np.max(np.linalg.norm(np.diff(part, axis=0), axis=1))) for part in cloud)
    distances, _ = cKDTree(np.vstack(cloud)).query(samples)
    return distances, pitch


@pytest.mark.parametrize("mode", [PathMode.CONTINUOUS, PathMode.ROUNDING_TOLERANCE])
@pytest.mark.parametrize("kinds", [("line",), ("arc", "line", "spline")])
def test_rounding_leaves_the_programmed_path_by_at_most_the_tolerance(kinds: tuple[str, ...], mode: PathMode) -> None:
    """(7.1, 7.2) Every sample lies within the tolerance of the programmed path, and `roundings` says how far."""
    corners = 0
    for seed in range(8):
        program = random_program(seed, kinds, mode)
        program[0] = canon.SetPathMode(0, None, mode, None)
        machine, samples = run(program, mill(), is_compiled=None, times=MachineTimes(rounding_mm=0.02))
        tolerance = 0.01 if mode is PathMode.CONTINUOUS else 0.02
        distances, pitch = _distances(samples.position_mm, [c for c in program if isinstance(c, Motion)])
        assert np.max(distances) <= tolerance + pitch
        assert all(rounding.deviation_mm <= tolerance * (1 + 1e-6) for rounding in machine.roundings)
        corners += len(machine.roundings)
    assert corners > 0


def test_g64_rounds_no_more_than_its_feed_needs() -> None:
    """(7.1) A corner of 1 degree: 1.5 m/min needs a rounding, 0.1 m/min next to none, and neither slows down."""
    bend = math.radians(1.0)
    points = [(0.0, 0.0, 0.0), (20.0, 0.0, 0.0), (20.0 + 20.0 * math.cos(bend), 20.0 * math.sin(bend), 0.0)]
    deviations = []
    for feed in (1500.0, 100.0):
        machine, samples = run(lines(points, feed))
        at_corner = np.argmin(np.abs(samples.position_mm[:, 0] - 20.0))
        assert samples.feed_mm_min[at_corner] == pytest.approx(feed, rel=1e-6)
        deviations += [sum(rounding.deviation_mm for rounding in machine.roundings)]
    assert 1e-4 < deviations[0] < 0.003
    assert deviations[1] < 2e-5


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
