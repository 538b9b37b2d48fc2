"""The machine as its callers see it: commands in, log out."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from sim.interpreter import canon
from sim.interpreter.canon import PathMode
from sim.motion.machine import Machine
from sim.motion.values import MachineState, MachineTimes, StopReason
from tests.sim.motion.log import differences, lines, mill, path_mode, run


def test_one_line_takes_the_time_of_two_jerk_limited_ramps() -> None:
    """(7.1) 100 mm at 50 mm/s, J 20000: 2 s and one ramp of 2 sqrt(v/J) = 0.1 s."""
    _, samples = run(lines([(0.0, 0.0, 0.0), (100.0, 0.0, 0.0)], 3000.0))
    assert samples.t_s[-1] == pytest.approx(2.1, rel=0.01)
    assert tuple(samples.position_mm[-1]) == (100.0, 0.0, 0.0)
    log = differences(samples.position_mm, (0.0, 0.0, 0.0), 0.004)
    assert np.max(np.abs(log.speed)) <= 50.0 * (1 + 1e-9)
    assert np.max(np.abs(log.acceleration)) <= 2000.0
    assert np.max(np.abs(log.jerk)) <= 20000.0 * (1 + 1e-6)


def test_arc_and_polynomial_end_where_they_should() -> None:
    """(7.2) End points exact, feed even away from the ends."""
    arc = canon.Arc(1, None, (10.0, 0.0, 0.0), (-10.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), math.pi, 1200.0)
    rows = ((-10.0, 0.0, 0.0), (10.0, 0.0, 0.0), (0.0, 10.0, 0.0))
    bow = canon.Polynomial(2, None, (-10.0, 0.0, 0.0), (0.0, 10.0, 0.0), rows, (1.0,), 1.0, 1200.0)
    machine, samples = run([arc, bow, canon.End(3, None)])
    assert tuple(samples.position_mm[-1]) == (0.0, 10.0, 0.0)
    on_arc = samples.position_mm[samples.line == 1]
    assert np.max(np.abs(np.linalg.norm(on_arc, axis=1) - 10.0)) < 1e-9
    assert machine.snapshot().state is MachineState.COMPLETED


def test_events_happen_where_they_stand_and_take_their_time() -> None:
    """(7.1) Dwell, spindle, tool change and M0 with the axes at rest."""
    first, second = lines([(0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (9.0, 0.0, 0.0)], 600.0)
    program = [
        canon.SelectTool(1, None, 2),
        canon.ChangeTool(1, None, 2),
        canon.Spindle(1, None, 1000.0),
        first,
        canon.Dwell(3, None, 0.5),
        canon.Coolant(3, None, True, False),
        canon.Stop(4, None, False),
        second,
        canon.End(6, None),
    ]
    machine = Machine(mill(), 0.004, is_compiled=False, times=MachineTimes(tool_change_s=2.0, spindle_start_s=1.0))
    for command in program:
        machine.offer(command)
    machine.close()
    machine.advance(math.inf)
    snapshot = machine.snapshot()
    assert (snapshot.state, snapshot.tool, snapshot.is_flood) == (MachineState.PROGRAM_STOPPED, 2, True)
    assert snapshot.position_mm == (5.0, 0.0, 0.0)
    machine.cycle_start()
    machine.advance(math.inf)
    assert machine.snapshot().position_mm == (9.0, 0.0, 0.0)
    stands = {stand.reason: stand.duration_s for stand in machine.stands}
    assert stands[StopReason.TOOL_CHANGE] == pytest.approx(2.0)
    assert stands[StopReason.SPINDLE] == pytest.approx(1.0)
    assert stands[StopReason.DWELL] == pytest.approx(0.5, abs=0.004)
    assert machine.travelled == [first, second]


def test_live_and_at_once_give_the_same_motion() -> None:
    """(7.1) The same offers at the same machine time: one call or many."""
    points = [(0.3 * k, 2.0 * math.sin(0.1 * k), 0.0) for k in range(60)]
    program = [path_mode(PathMode.ROUNDING_TOLERANCE, 0.005), *lines(points, 2400.0), canon.End(99, None)]
    _, whole = run(program)
    machine = Machine(mill(), 0.004, is_compiled=False)
    for command in program:
        machine.offer(command)
    machine.close()
    parts = [machine.advance(0.011 * k) for k in range(1, 600)]
    assert np.array_equal(np.vstack([part.position_mm for part in parts]), whole.position_mm)


@pytest.mark.parametrize("mode", [PathMode.CONTINUOUS, PathMode.ROUNDING_TOLERANCE])
def test_a_run_of_cuts_moves_like_its_cuts_one_by_one(mode: PathMode) -> None:
    """(7.5) Arrays or values: the same log, the same motions as made; an exact stop belongs to the first cut alone."""
    points = [(0.3 * k, 2.0 * math.sin(0.1 * k), 0.0) for k in range(60)]
    points[20] = points[19]
    ends = np.array(points[1:])
    lines, feeds = np.arange(1, 60), np.full(59, 2400.0)
    cuts = canon.LineRun(lines, np.where(lines % 2 == 0, 10 * lines, -1), points[0], ends, feeds)
    before = [path_mode(mode, 0.005), canon.ExactStopOnce(1, None)]
    one_by_one, expected = run([*before, *cuts.expand(), canon.End(99, None)])
    at_once, samples = run([*before, cuts, canon.End(99, None)])
    for name in ("t_s", "position_mm", "feed_mm_min", "line", "block"):
        assert np.array_equal(getattr(samples, name), getattr(expected, name))
    assert at_once.travelled == one_by_one.travelled
    assert at_once.stands == one_by_one.stands
    assert at_once.snapshot() == one_by_one.snapshot()


def test_waiting_for_blocks_is_starvation_with_block_and_place() -> None:
    """(7.4) The machine slows for the known end, stops there, and says how long."""
    first, second = lines([(0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (8.0, 0.0, 0.0)], 1200.0)
    machine = Machine(mill(), 0.004, is_compiled=False)
    machine.offer(first)
    machine.advance(1.0)
    assert machine.stands[-1].reason is StopReason.STARVED
    assert machine.snapshot().position_mm == (4.0, 0.0, 0.0)
    machine.offer(second)
    machine.close()
    machine.advance(3.0)
    (starved,) = machine.starved
    assert (starved.line, starved.position_mm) == (1, (4.0, 0.0, 0.0))
    assert starved.t_s + starved.duration_s == pytest.approx(1.0)
    assert machine.snapshot().state is MachineState.COMPLETED


def test_feed_hold_and_reset_stop_on_the_path() -> None:
    """(7.1) Both stop within the jerk limit; a hold goes on, a reset forgets."""
    machine = Machine(mill(), 0.004, is_compiled=False)
    for command in lines([(0.0, 0.0, 0.0), (50.0, 0.0, 0.0)], 3000.0):
        machine.offer(command)
    machine.close()
    parts = [machine.advance(0.5)]
    machine.feed_hold()
    parts.append(machine.advance(2.0))
    assert machine.snapshot().state is MachineState.FEED_HOLD
    assert machine.snapshot().feed_mm_min == 0.0
    assert 20.0 < machine.snapshot().position_mm[0] < 30.0
    machine.cycle_start()
    parts.append(machine.advance(2.2))
    machine.reset()
    parts.append(machine.advance(5.0))
    assert machine.snapshot().state is MachineState.READY
    for before, after in itertools.pairwise(parts):
        assert len(before.t_s)
        assert np.all(after.position_mm[:, 0] >= before.position_mm[-1, 0])
    points = np.vstack([[(0.0, 0.0, 0.0)] * 3, *[part.position_mm for part in parts]])
    assert np.max(np.abs(np.diff(points[:, 0], n=3))) / 0.004**3 <= 20000.0 * (1 + 1e-6)
