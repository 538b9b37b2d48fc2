"""The machining time that plan, setup sheet and console promise, against the mill that makes it (7.8)."""

from __future__ import annotations

import pytest

from sim.interpreter import canon
from sim.interpreter.canon import Command, PathMode
from sim.motion.estimate import estimate_time_s
from sim.motion.machine import Machine
from sim.motion.values import MachineState
from tests.sim.motion.log import mill
from tests.sim.motion.programs import random_program


def driven_s(program: list[Command], lookahead: int) -> float:
    """When a mill that is given each block as soon as it has room for one comes to the end of the program."""
    profile = mill(lookahead=lookahead)
    machine = Machine(profile, profile.block_cycle_s)
    waiting = list(program)
    while machine.snapshot().state is not MachineState.COMPLETED:
        while waiting and machine.free_blocks > 0:
            machine.offer(waiting.pop(0))
        machine.advance(machine.time_s + profile.block_cycle_s)
        if machine.snapshot().state is MachineState.PROGRAM_STOPPED:
            machine.cycle_start()
    return machine.stands[-1].t_s


@pytest.mark.parametrize("mode", list(PathMode))
@pytest.mark.parametrize("kinds", [("line", "rapid"), ("line", "arc", "spline")])
def test_the_estimate_is_within_a_hundredth_of_the_mill(kinds: tuple[str, ...], mode: PathMode) -> None:
    """(7.8) Random programs, sharp corners and short legs in every path mode, a control that sees five blocks ahead."""
    for seed in range(20):
        program = [*random_program(seed, kinds, mode), canon.End(99, None)]
        assert estimate_time_s(program, mill(lookahead=5)) == pytest.approx(driven_s(program, 5), rel=0.01)


def test_the_estimate_counts_what_the_axes_stand_for_but_no_programmed_stop() -> None:
    """(7.8) Passes with plunges, exact stops and rapids; a spindle start, a dwell, a tool change, an M0."""
    program: list[Command] = [canon.Spindle(0, None, 1000.0), canon.Dwell(1, None, 2.0), canon.ChangeTool(2, None, 1)]
    at = (0.0, 0.0, 50.0)
    for k in range(6):
        near, far = (0.0, 50.0) if k % 2 == 0 else (50.0, 0.0)
        over, down, begin = (near, float(k), at[2]), (near, float(k), 2.0), (near, float(k), 0.0)
        end, up = (far, float(k), 0.0), (far, float(k), 10.0)
        program += [canon.Rapid(1, None, at, over), canon.Rapid(2, None, over, down), canon.Stop(2, None, False)]
        program += [canon.Line(3, None, down, begin, 100.0), canon.ExactStopOnce(4, None)]
        program += [canon.Line(4, None, begin, end, 250.0), canon.Rapid(5, None, end, up)]
        at = up
    program.append(canon.End(6, None))
    assert estimate_time_s(program, mill()) == pytest.approx(driven_s(program, 100), rel=0.01)
