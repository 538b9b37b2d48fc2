"""The time law: closed forms, its compiled twin, splines, starvation, speed."""

from __future__ import annotations

import math
import subprocess
import sys
import time

import numpy as np
import pytest

from sim.interpreter import canon
from sim.interpreter.canon import PathMode
from sim.motion import law
from sim.motion.braking import brake_mm, ease_mm
from sim.motion.landing import landing, landing_jerk
from sim.motion.machine import Machine
from sim.motion.values import MachineState
from tests.sim.motion.log import lines, mill, path_mode, run
from tests.sim.motion.programs import random_program


def test_braking_distance_agrees_with_itself_along_the_way() -> None:
    """(7.1) From zero acceleration (v0 + v1)/2 T; part of the way into the ramp, the rest of that."""
    acceleration, jerk, v, target = 2000.0, 20000.0, 90.0, 10.0
    whole = (v + target) / 2.0 * 2.0 * math.sqrt((v - target) / jerk)
    assert brake_mm(v, 0.0, target, acceleration, jerk) == pytest.approx(whole, rel=1e-12)
    for t in (0.01, 0.03, 0.06):
        later, rate = v - jerk * t * t / 2.0, -jerk * t
        gone = v * t - jerk * t**3 / 6.0
        assert brake_mm(later, rate, target, acceleration, jerk) == pytest.approx(whole - gone, rel=1e-9)
    eased = ease_mm(v, 800.0, 0.0, jerk)
    peak = v + 800.0**2 / (2.0 * jerk)
    both = eased + brake_mm(peak, 0.0, target, acceleration, jerk)
    assert brake_mm(v, 800.0, target, acceleration, jerk) == pytest.approx(both, rel=1e-12)


def test_a_landing_ends_exactly_at_rest() -> None:
    """(7.1) Three conditions, least-norm jerks."""
    steps, dt, ahead, v, a = 9, 0.004, 0.3, 20.0, -900.0
    alpha, beta, gamma = landing(ahead, v, a, steps, dt)
    s = 0.0
    for left in range(steps, 0, -1):
        j = landing_jerk(alpha, beta, gamma, steps, left)
        s, v, a = s + dt * (v + dt * (a / 2 + dt * j / 6)), v + dt * (a + dt * j / 2), a + dt * j
    assert (s, v, a) == pytest.approx((ahead, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_the_compiled_law_is_its_pure_twin(seed: int) -> None:
    """(7.5) The same text, compiled and interpreted: the same log to the last bits that rounding leaves."""
    pytest.importorskip("numba")
    program = random_program(seed, ("line", "arc", "spline", "rapid"), PathMode.ROUNDING_TOLERANCE)
    _, slow = run(program, is_compiled=False)
    _, fast = run(program, is_compiled=True)
    assert len(slow.t_s) == len(fast.t_s)
    assert np.allclose(slow.position_mm, fast.position_mm, atol=1e-9)


@pytest.mark.parametrize("mode", [PathMode.EXACT_STOP, PathMode.CONTINUOUS, PathMode.ROUNDING_TOLERANCE])
def test_coasting_takes_the_steps_that_the_law_would(mode: PathMode, monkeypatch: pytest.MonkeyPatch) -> None:
    """(7.5) At an even feed steps are taken without asking ahead; asked one by one they come out the same."""
    for seed in range(6):
        program = random_program(seed, ("line", "arc", "spline", "rapid"), mode)
        _, coasted = run(program)
        with monkeypatch.context() as patch:
            patch.setattr(law, "coasting_steps", lambda *_: 0)
            _, asked = run(program)
        assert len(coasted.t_s) == len(asked.t_s)
        assert np.allclose(coasted.position_mm, asked.position_mm, atol=1e-9)


def test_without_the_compiler_the_mill_is_still_faster_than_real_time() -> None:
    """(7.5) 0.2 mm blocks at the feed that the block cycle allows, so that no step is a coasting one."""
    points = [(0.2 * k, 5 * math.sin(0.006 * k), 3 * math.sin(0.01 * k)) for k in range(400)]
    begin = time.process_time()
    _, samples = run(lines(points, 3000.0), is_compiled=False)
    assert samples.t_s[-1] > time.process_time() - begin


def test_the_machine_imports_no_numba() -> None:
    """(7.5) Importing the machine must not need the optional compiler."""
    code = "import sys, sim.motion.machine; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_splines_keep_their_feed_within_a_thousandth() -> None:
    """(7.3) An uneven parametrisation, and a rational arc, at 600 mm/min away from the ends."""
    rows = ((0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (10.0, 30.0, 0.0), (25.0, -20.0, 0.0))
    curve = canon.Polynomial(1, None, rows[0], (40.0, 10.0, 0.0), rows, (1.0,), 1.0, 600.0)
    half = math.sqrt(0.5)
    top = ((20.0, 0.0, 0.0), (2 * 20.0 * (half - 1.0), 2 * 20.0 * half, 0.0))
    quarter = ((top[0]), top[1], tuple(np.subtract((0.0, 20.0, 0.0), np.add(top[0], top[1]))))
    bottom = (1.0, 2.0 * (half - 1.0), 2.0 * (1.0 - half))
    rational = canon.Polynomial(1, None, (20.0, 0.0, 0.0), (0.0, 20.0, 0.0), quarter, bottom, 1.0, 600.0)
    for motion in (curve, rational):
        _, samples = run([motion])
        feeds = np.linalg.norm(np.diff(samples.position_mm, axis=0), axis=1) / 0.004 * 60.0
        assert np.max(np.abs(feeds[60:-60] / 600.0 - 1.0)) < 1e-3
    radius = np.linalg.norm(samples.position_mm, axis=1)
    assert np.max(np.abs(radius - 20.0)) < 1e-9


def test_a_block_lasts_at_least_a_cycle() -> None:
    """(7.4) v <= 0.9 length / cycle: 0.1 mm blocks at 4 ms are driven at 22.5 mm/s at most."""
    _, samples = run(lines([(0.1 * k, 0.0, 0.0) for k in range(400)], 6000.0), is_compiled=None)
    assert np.max(samples.feed_mm_min) == pytest.approx(22.5 * 60.0, rel=1e-6)


def test_a_short_look_ahead_costs_speed_and_never_a_limit() -> None:
    """(7.4) The horizon is min(look-ahead, blocks offered): fewer known blocks, slower motion."""
    points = [(0.2 * k, math.sin(0.02 * k), 0.0) for k in range(400)]
    times = [run(lines(points, 2400.0), mill(lookahead=n), is_compiled=None)[1].t_s[-1] for n in (1, 3, 10, 100)]
    assert times[0] > times[1] > times[2] >= times[3]


def test_single_block_stands_after_each_motion() -> None:
    """(7.1) Cycle start goes on to the next block end."""
    machine = Machine(mill(), 0.004, is_compiled=False)
    for command in [
        path_mode(PathMode.ROUNDING_TOLERANCE, 0.01),
        *lines([(0.0, 0, 0), (3.0, 0, 0), (3.0, 4, 0)], 900.0),
    ]:
        machine.offer(command)
    machine.close()
    machine.set_single_block(True)
    machine.advance(math.inf)
    assert (machine.snapshot().state, machine.snapshot().position_mm) == (MachineState.SINGLE_BLOCK, (3.0, 0.0, 0.0))
    machine.set_single_block(False)
    machine.cycle_start()
    machine.advance(math.inf)
    assert machine.snapshot().position_mm == (3.0, 4.0, 0.0)


def test_override_changes_the_feed_without_breaking_a_limit() -> None:
    """(7.1) 100 to 30 % and back while cutting; 0 % stands still."""
    machine = Machine(mill(), 0.004, is_compiled=False)
    machine.offer(lines([(0.0, 0.0, 0.0), (60.0, 0.0, 0.0)], 2400.0)[0])
    machine.close()
    parts = [machine.advance(0.5)]
    machine.set_override(30.0)
    parts.append(machine.advance(1.0))
    assert parts[-1].feed_mm_min[-1] == pytest.approx(720.0, rel=1e-6)
    machine.set_override(0.0)
    parts.append(machine.advance(1.5))
    assert machine.snapshot().feed_mm_min == 0.0
    machine.set_override(100.0)
    parts.append(machine.advance(9.0))
    assert machine.snapshot().position_mm == (60.0, 0.0, 0.0)
    x = np.concatenate([[0.0] * 3, *[part.position_mm[:, 0] for part in parts]])
    assert np.max(np.abs(np.diff(x, n=3))) / 0.004**3 <= 20000.0 * (1.0 + 1e-6)


def test_rapids_follow_the_override_up_to_100_percent() -> None:
    """(7.1, 5.8) Half of it, no more above 100 %, and at 0 % the axes stand until it is raised."""
    fastest = {}
    for percent in (100.0, 50.0, 120.0):
        machine = Machine(mill(), 0.004, is_compiled=False)
        machine.set_override(percent)
        machine.offer(canon.Rapid(1, None, (0.0, 0.0, 0.0), (300.0, 0.0, 0.0)))
        machine.close()
        fastest[percent] = float(np.max(machine.advance(math.inf).feed_mm_min))
    assert fastest[50.0] == pytest.approx(fastest[100.0] / 2.0, rel=1e-6)
    assert fastest[120.0] == fastest[100.0]
    machine = Machine(mill(), 0.004, is_compiled=False)
    machine.set_override(0.0)
    machine.offer(canon.Rapid(1, None, (0.0, 0.0, 0.0), (300.0, 0.0, 0.0)))
    machine.close()
    machine.advance(5.0)
    assert machine.snapshot().position_mm == (0.0, 0.0, 0.0)
    machine.set_override(100.0)
    machine.advance(math.inf)
    assert machine.snapshot().position_mm == (300.0, 0.0, 0.0)


def test_dense_programs_run_far_faster_than_the_machine() -> None:
    """(7.5) 20,000 blocks of 0.2 mm after warm-up; the bound is a fifth of what an idle core does."""
    pytest.importorskip("numba")
    points = [(0.2 * k, 5 * math.sin(0.006 * k), 3 * math.sin(0.01 * k)) for k in range(20_001)]
    program = lines(points, 3000.0)
    run(program[:500], is_compiled=True)
    begin = time.process_time()
    _, samples = run(program, is_compiled=True)
    spent = time.process_time() - begin
    assert 20_000 / spent > 40_000
    assert samples.t_s[-1] / spent > 200
