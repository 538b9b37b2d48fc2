"""A whole program through the machine at once: no block comes late, and cycle start follows every programmed stop."""

from __future__ import annotations

import math
from collections.abc import Iterable

from sim.interpreter.canon import Command, LineRun
from sim.motion.machine import Machine
from sim.motion.values import MachineState, Samples

_WAITS_FOR_OPERATOR = (MachineState.PROGRAM_STOPPED, MachineState.OPTIONAL_STOP)


def run_through(machine: Machine, commands: Iterable[Command | LineRun]) -> Samples:
    """Let the machine do all these commands; its whole log. Programmed stops count no time."""
    for command in commands:
        machine.offer(command)
    machine.close()
    parts = [machine.advance(math.inf)]
    while machine.snapshot().state in _WAITS_FOR_OPERATOR:
        machine.cycle_start()
        parts.append(machine.advance(math.inf))
    return Samples.joined(parts)
