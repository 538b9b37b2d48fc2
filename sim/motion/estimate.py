"""Machining time for plan, setup sheet and console: the machine's own motion, of which only the clock is kept.

There is no second law of time, so that what is promised and what is simulated cannot drift apart.
"""

from __future__ import annotations

from collections.abc import Iterable

from sim.interpreter.canon import Command, LineRun
from sim.motion.machine import Machine
from sim.motion.through import run_through
from sim.motion.values import MachineTimes
from sim.profile import MillProfile


def estimate_time_s(
    commands: Iterable[Command | LineRun], profile: MillProfile, *, times: MachineTimes | None = None
) -> float:
    """Time from the first motion to the end of these commands at 100 % override, never waiting for blocks.

    Dwells, tool changes, spindle starts and exact stops are counted, programmed stops are not.
    """
    machine = Machine(profile, profile.block_cycle_s, times=times)
    run_through(machine, commands)
    return machine.time_s
