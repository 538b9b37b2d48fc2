"""Why the axes stand, for how long, and what hold, cycle start and reset may do while they do (7.1)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from sim.interpreter import canon
from sim.interpreter.canon import PathMode
from sim.motion.machine import Machine
from sim.motion.values import MachineState, MachineTimes, StopReason
from tests.sim.motion.log import lines, mill, path_mode, run

FIRST, SECOND, THIRD = lines([(0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (9.0, 0.0, 0.0), (12.0, 0.0, 0.0)], 600.0)
SETTLED_S = 0.04
"""A loop of 58.3/s that stopped with 20 m/s3 lags by 0.1 mm and is within 0.01 mm after 0.0396 s: ten cycles."""


def machine_with(commands: Sequence[canon.Command], *, stops_at_optional: bool = False) -> Machine:
    machine = Machine(
        mill(),
        0.004,
        is_compiled=False,
        stops_at_optional=stops_at_optional,
        times=MachineTimes(tool_change_s=2.0, spindle_start_s=1.0),
    )
    for command in commands:
        machine.offer(command)
    return machine


def reasons(machine: Machine) -> list[StopReason]:
    return [stand.reason for stand in machine.stands]


def test_an_exact_stop_waits_until_the_axes_have_arrived() -> None:
    """(7.1) On a straight way too: at the end of every block, and not before the axes are there."""
    machine, samples = run([path_mode(PathMode.EXACT_STOP), FIRST, SECOND, canon.End(9, None)])
    assert reasons(machine) == [StopReason.EXACT_STOP, StopReason.EXACT_STOP, StopReason.END]
    for stand, end in zip(machine.stands, (FIRST, SECOND), strict=False):
        assert stand.position_mm == end.end
        assert stand.duration_s == pytest.approx(SETTLED_S)
        assert stand.line == end.line
    assert (samples.position_mm == FIRST.end).all(axis=1).sum() == 1 + round(SETTLED_S / 0.004)


def test_an_exact_stop_of_one_block_is_of_that_block() -> None:
    """(7.1) G9 acts on the next move alone, whatever stands between."""
    machine, _ = run([FIRST, canon.ExactStopOnce(2, None), canon.Coolant(2, None, True, False), SECOND, THIRD])
    assert reasons(machine) == [StopReason.EXACT_STOP, StopReason.END]
    assert machine.stands[0].position_mm == SECOND.end


@pytest.mark.parametrize(
    ("mode", "tolerance_mm", "deviation_mm", "feed_mm_min"),
    [
        (PathMode.ROUNDING_TOLERANCE, 0.05, 0.05, 100.0),
        (PathMode.ROUNDING_TOLERANCE, None, 0.02, 100.0),
        (PathMode.ROUNDING_DISTANCE, 0.4, 0.4 * 0.375 * math.sqrt(0.5), 100.0),
        (PathMode.CONTINUOUS, None, 0.01, 3000.0),
    ],
)
def test_a_square_corner_is_rounded_as_far_as_its_mode_says(
    mode: PathMode, tolerance_mm: float | None, deviation_mm: float, feed_mm_min: float
) -> None:
    """(7.1) G642 uses its tolerance up, G641 begins and ends at its distance; 0.375 d sin(theta/2) off the corner.

    Both at a feed that would need less of it; G64 takes no more than 0.01 mm where its feed would need more.
    """
    corner = lines([(0.0, 0.0, 0.0), (20.0, 0.0, 0.0), (20.0, 20.0, 0.0)], feed_mm_min)
    machine, samples = run([path_mode(mode, tolerance_mm), *corner], times=MachineTimes(rounding_mm=0.02))
    (rounding,) = machine.roundings
    assert rounding.deviation_mm == pytest.approx(deviation_mm, rel=1e-6)
    assert rounding.corner_mm == (20.0, 0.0, 0.0)
    nearest_mm = np.hypot(samples.position_mm[:, 0] - 20.0, samples.position_mm[:, 1]).min()
    assert deviation_mm * (1 - 1e-6) <= nearest_mm <= deviation_mm + 0.1


def test_a_hold_during_a_dwell_stands_behind_it() -> None:
    """(7.1) The dwell runs to its end, the next move does not begin before cycle start."""
    machine = machine_with([FIRST, canon.Dwell(2, None, 1.0), SECOND])
    machine.close()
    machine.advance(1.0)
    assert machine.stands[-1].reason is StopReason.DWELL
    machine.feed_hold()
    machine.advance(10.0)
    assert (machine.snapshot().state, machine.snapshot().position_mm) == (MachineState.FEED_HOLD, FIRST.end)
    assert reasons(machine) == [StopReason.DWELL, StopReason.FEED_HOLD]
    assert machine.stands[0].duration_s == pytest.approx(1.0)
    machine.cycle_start()
    machine.advance(math.inf)
    assert (machine.snapshot().state, machine.snapshot().position_mm) == (MachineState.COMPLETED, SECOND.end)


def test_a_hold_during_the_last_dwell_stands_before_the_end() -> None:
    """(7.1) The program has ended when cycle start has been pressed."""
    machine = machine_with([FIRST, canon.Dwell(2, None, 1.0)])
    machine.close()
    machine.advance(1.0)
    machine.feed_hold()
    machine.advance(10.0)
    assert machine.snapshot().state is MachineState.FEED_HOLD
    machine.cycle_start()
    machine.advance(math.inf)
    assert machine.snapshot().state is MachineState.COMPLETED


def test_a_hold_in_a_move_is_told_as_one() -> None:
    """(7.1)"""
    machine = machine_with([FIRST])
    machine.close()
    machine.advance(0.3)
    machine.feed_hold()
    machine.advance(5.0)
    assert reasons(machine) == [StopReason.FEED_HOLD]
    assert 0.0 < machine.snapshot().position_mm[0] < 5.0
    assert machine.stands_for is StopReason.FEED_HOLD
    machine.cycle_start()
    machine.advance(5.1)
    assert machine.stands_for is None


def test_a_hold_at_a_programmed_stop_changes_nothing() -> None:
    """(7.1) M0 waits for cycle start already."""
    machine = machine_with([FIRST, canon.Stop(2, None, False), SECOND])
    machine.close()
    machine.advance(5.0)
    machine.feed_hold()
    assert machine.snapshot().state is MachineState.PROGRAM_STOPPED
    machine.cycle_start()
    machine.advance(math.inf)
    assert machine.snapshot().position_mm == SECOND.end


@pytest.mark.parametrize("stops", [True, False])
def test_m1_stops_only_where_it_is_switched_on(stops: bool) -> None:
    """(7.1) Switched off it does not slow the axes down either."""
    machine = machine_with([FIRST, canon.Stop(2, None, True), SECOND], stops_at_optional=stops)
    machine.close()
    samples = machine.advance(math.inf)
    assert machine.snapshot().state is (MachineState.OPTIONAL_STOP if stops else MachineState.COMPLETED)
    assert reasons(machine) == [StopReason.OPTIONAL_STOP if stops else StopReason.END]
    assert stops or samples.feed_mm_min[np.argmin(np.abs(samples.position_mm[:, 0] - 5.0))] == pytest.approx(600.0)


def test_a_spindle_told_its_own_speed_does_not_stop_the_axes() -> None:
    """(7.1) S and M3 again, as CAM systems write them before every pass."""
    spindle = canon.Spindle(1, None, 900.0)
    machine = machine_with([spindle, FIRST, spindle, SECOND])
    machine.close()
    samples = machine.advance(math.inf)
    assert reasons(machine) == [StopReason.SPINDLE, StopReason.END]
    assert samples.feed_mm_min[np.argmin(np.abs(samples.position_mm[:, 0] - 5.0))] == pytest.approx(600.0)


def test_single_block_is_told_as_such_and_an_exact_stop_stays_one() -> None:
    """(7.1)"""
    machine = machine_with([FIRST, canon.ExactStopOnce(2, None), SECOND])
    machine.close()
    machine.set_single_block(True)
    for _ in range(2):
        machine.advance(math.inf)
        assert machine.snapshot().state is MachineState.SINGLE_BLOCK
        machine.cycle_start()
    assert reasons(machine) == [StopReason.SINGLE_BLOCK, StopReason.EXACT_STOP]


def test_a_way_back_is_a_stop_at_a_corner() -> None:
    """(7.1) No rounding turns by 180 degrees."""
    machine, _ = run(lines([(0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (1.0, 0.0, 0.0)], 600.0))
    assert reasons(machine) == [StopReason.CORNER, StopReason.END]
    assert machine.roundings == []


def test_g641_rounds_no_rapid() -> None:
    """(7.1) Cuts are rounded over its distance, a corner from or into a rapid is not."""
    square = [(0.0, 0.0, 0.0), (20.0, 0.0, 0.0), (20.0, 20.0, 0.0), (0.0, 20.0, 0.0)]
    way = [canon.Rapid(1, None, square[0], square[1]), *lines(square[1:], 600.0)]
    machine, _ = run([path_mode(PathMode.ROUNDING_DISTANCE, 0.4), *way])
    assert [rounding.corner_mm for rounding in machine.roundings] == [square[2]]


def test_an_alarm_ends_in_reset_alone() -> None:
    """(7.1) Cycle start does not go on after it; a reset forgets what was behind it."""
    machine = machine_with([FIRST, canon.Alarm(2, None, 14040, "the arc does not close", None), SECOND])
    machine.advance(5.0)
    assert (machine.snapshot().state, machine.snapshot().alarm) == (MachineState.ALARM, "14040 the arc does not close")
    machine.cycle_start()
    machine.advance(10.0)
    assert (machine.snapshot().state, machine.snapshot().position_mm) == (MachineState.ALARM, FIRST.end)
    machine.reset()
    assert (machine.snapshot().state, machine.snapshot().alarm) == (MachineState.READY, "")
    assert machine.snapshot().blocks_queued == 0
    machine.advance(15.0)
    assert machine.snapshot().position_mm == FIRST.end


def test_a_reset_in_a_move_forgets_the_rest_and_a_new_program_goes_on_from_there() -> None:
    """(7.1) Cycle start during the stop changes nothing; tool stays, spindle and coolant go off."""
    head = [canon.ChangeTool(1, None, 3), canon.Spindle(1, None, 900.0), canon.Coolant(1, None, True, True)]
    machine = machine_with([*head, FIRST, SECOND])
    machine.advance(3.3)
    assert machine.snapshot().feed_mm_min > 0.0
    machine.reset()
    machine.offer(THIRD)
    machine.cycle_start()
    machine.advance(10.0)
    seen = machine.snapshot()
    assert (seen.state, seen.tool, seen.spindle_rpm) == (MachineState.READY, 3, 0.0)
    assert (seen.is_flood, seen.is_mist, seen.blocks_queued) == (False, False, 0)
    assert 0.0 < seen.position_mm[0] < 5.0
    assert machine.stands_for is StopReason.RESET
    machine.offer(canon.Line(1, None, seen.position_mm, (7.0, 0.0, 0.0), 600.0))
    machine.close()
    machine.advance(20.0)
    assert (machine.snapshot().state, machine.snapshot().position_mm) == (MachineState.COMPLETED, (7.0, 0.0, 0.0))
    assert [motion.end for motion in machine.travelled] == [seen.position_mm, (7.0, 0.0, 0.0)]


def test_a_reset_in_a_dwell_ends_the_dwell() -> None:
    """(7.1) A new program begins at once, and no time of the old one is left over for it."""
    machine = machine_with([canon.Dwell(1, None, 100.0), FIRST])
    machine.advance(1.0)
    machine.reset()
    assert machine.snapshot().state is MachineState.READY
    machine.offer(FIRST)
    machine.close()
    machine.advance(3.0)
    assert machine.snapshot().state is MachineState.COMPLETED


def test_the_end_of_a_program_switches_off_and_is_left_by_cycle_start() -> None:
    """(7.1)"""
    head = [canon.Spindle(1, None, 900.0), canon.Coolant(1, None, False, True)]
    machine = machine_with([*head, FIRST, canon.End(2, None)])
    machine.advance(math.inf)
    seen = machine.snapshot()
    assert (seen.state, seen.spindle_rpm, seen.is_mist) == (MachineState.COMPLETED, 0.0, False)
    machine.cycle_start()
    assert machine.snapshot().state is MachineState.ACTIVE


def test_override_zero_is_told_as_such_before_and_within_a_move() -> None:
    """(7.1)"""
    machine = machine_with([canon.Line(1, None, (1.0, 2.0, 3.0), (5.0, 2.0, 3.0), 600.0)])
    machine.close()
    machine.set_override(0.0)
    machine.advance(1.0)
    assert machine.stands_for is StopReason.OVERRIDE
    assert machine.snapshot().position_mm == machine.stands[0].position_mm == (1.0, 2.0, 3.0)
    machine.set_override(100.0)
    machine.advance(1.2)
    assert machine.stands_for is None
    machine.set_override(0.0)
    machine.advance(3.0)
    assert machine.stands_for is StopReason.OVERRIDE
    assert 1.0 < machine.snapshot().position_mm[0] < 5.0
    assert reasons(machine) == [StopReason.OVERRIDE, StopReason.OVERRIDE]
