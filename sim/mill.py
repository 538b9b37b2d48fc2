"""A whole program through interpreter and machine without a line: what `dnc simulate` measures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from sim.interpreter import canon
from sim.interpreter.run import count_blocks, interpret_bulk
from sim.interpreter.settings import G28, KnotRule, Settings, Tool
from sim.motion.machine import Machine
from sim.motion.through import run_through
from sim.motion.values import MachineState, Samples, StarvedInterval
from sim.profile import MillProfile


@dataclass(frozen=True)
class Recording:
    """What came of a program: its commands, the motion log, and what the control complained of.

    `machining_time_s` runs from the first block to the end; programmed stops count no time. `blocks` are the blocks
    that were read, blank lines not counted.
    """

    commands: Sequence[canon.Command | canon.LineRun]
    samples: Samples
    starved: Sequence[StarvedInterval]
    alarms: Sequence[canon.Alarm]
    machining_time_s: float
    blocks: int
    is_completed: bool
    machine: Machine = field(repr=False, compare=False)

    @cached_property
    def travelled(self) -> Sequence[canon.Motion]:
        """The motions as made, roundings included; worked out when first asked for."""
        return self.machine.travelled


def settings_of(
    profile: MillProfile,
    *,
    is_drip_fed: bool,
    tool_radii_mm: Mapping[int, float] | None = None,
    subprogram_folder: Path | None = None,
) -> Settings:
    """The control's side of interpreting, as the machine profile has it; radii by tool number, for G41 and G42."""
    return Settings(
        knot_rule=KnotRule(profile.knot_rule),
        poly_degree=profile.poly_degree,
        g28=G28(profile.g28),
        backward_jump_alarm=profile.backward_jump_alarm,
        has_tool_changer=profile.has_tool_changer,
        is_inch=profile.is_inch,
        is_drip_fed=is_drip_fed,
        travel_mm=tuple((axis.min_mm, axis.max_mm) for axis in profile.axes),
        subprogram_folder=subprogram_folder,
        tools={number: Tool(radius_mm) for number, radius_mm in (tool_radii_mm or {}).items()},
    )


def rehearse(
    data: bytes,
    profile: MillProfile,
    *,
    override_percent: float = 100.0,
    tool_radii_mm: Mapping[int, float] | None = None,
    subprogram_folder: Path | None = None,
) -> Recording:
    """Interpret and cut a whole program with a buffer that never runs dry; cycle start follows every stop at once."""
    settings = settings_of(profile, is_drip_fed=False, tool_radii_mm=tool_radii_mm, subprogram_folder=subprogram_folder)
    commands = list(interpret_bulk(data, settings))
    machine = Machine(profile, profile.block_cycle_s)
    machine.set_override(override_percent)
    samples = run_through(machine, commands)
    if machine.start_mm is not None:
        samples, _ = standing_at(samples, machine.start_mm)
    last_line = max((command.line for command in commands if isinstance(command, canon.End | canon.Alarm)), default=0)
    return Recording(
        commands=commands,
        samples=samples,
        starved=machine.starved,
        alarms=[command for command in commands if isinstance(command, canon.Alarm)],
        machining_time_s=machine.time_s,
        blocks=count_blocks(data, last_line),
        is_completed=machine.snapshot().state is MachineState.COMPLETED,
        machine=machine,
    )


def standing_at(samples: Samples, start: canon.Vector) -> tuple[Samples, bool]:
    """The log with the place of the first motion's start for the time before it, and whether the axes have moved.

    The machine learns where it stands from its first motion; until then its log says zero.
    """
    is_away = np.any(samples.position_mm != 0.0, axis=1)
    has_moved = bool(is_away.any())
    lead = int(np.argmax(is_away)) if has_moved else len(is_away)
    position_mm = samples.position_mm.copy()
    position_mm[:lead] = start
    return replace(samples, position_mm=position_mm), has_moved
