"""The control's preparation of commands: what is modal, which motions form a run, and what happens between motions."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from sim.interpreter import canon
from sim.interpreter.canon import Command, LineRun, Motion, PathMode
from sim.motion.path import Run
from sim.motion.straight import Modal
from sim.motion.values import MachineTimes

_SYNCHRONOUS = (canon.Dwell, canon.ChangeTool, canon.Stop, canon.End, canon.Alarm)


@dataclass(frozen=True, slots=True)
class Event:
    """A command that is no motion, due after the first `after` motions; the axes stand for it if `is_synchronous`."""

    after: int
    command: Command
    is_synchronous: bool


class Preparation:
    """What was offered and is not prepared yet, what is modal between commands, and the events that await motions."""

    def __init__(self, times: MachineTimes, *, stops_at_optional: bool) -> None:
        self.events: deque[Event] = deque()
        self._offers: list[Command | LineRun] = []
        self._times = times
        self._tolerance_mm = times.continuous_mm
        self._stops_at_optional = stops_at_optional
        self._mode = PathMode.CONTINUOUS
        self._is_soft = True
        self._is_after_stop = self._is_exact_once = self._is_single_block = False
        self._spindle_rpm = 0.0
        self._runs: list[Run] = []

    @property
    def offered(self) -> int:
        """How many commands, each cut of a run counted, wait to be prepared."""
        return sum(len(each) if isinstance(each, LineRun) else 1 for each in self._offers)

    def offer(self, command: Command | LineRun) -> None:
        """Queue an interpreted command, or a run of straight cuts."""
        self._offers.append(command)

    @property
    def has_offers(self) -> bool:
        """Whether anything waits to be prepared."""
        return bool(self._offers)

    def forget_offers(self) -> None:
        """What was offered and is not prepared will not be."""
        self._offers.clear()

    def take(self, motions: int, *, is_single_block: bool) -> list[Run]:
        """The runs of all that was offered; `motions` is how many motions came before.

        In single block corners are not rounded, since the axes stop there.
        """
        commands, self._offers = self._offers, []
        self._runs, self._is_single_block = [], is_single_block
        straight: list[Motion] = []
        for command in commands:
            if isinstance(command, canon.Line | canon.Rapid):
                straight.append(command)
                motions += 1
                if self._is_exact_once:
                    self._end_run(straight, is_exact=True)
                    straight = []
                continue
            self._end_run(straight, is_exact=False)
            straight = []
            if isinstance(command, LineRun):
                self._take_run(command)
                motions += len(command)
            elif isinstance(command, canon.Arc | canon.Polynomial):
                self._end_run([command], is_exact=self._is_exact_once)
                motions += 1
            else:
                self._note(command, motions)
        self._end_run(straight, is_exact=False)
        return self._runs

    def _take_run(self, cuts: LineRun) -> None:
        """A run of cuts; a pending exact stop belongs to the first of them alone."""
        if self._is_exact_once:
            self._end_run([cuts.cut(0)], is_exact=True)
            if len(cuts) == 1:
                return
            cuts = cuts.after(1)
        self._end_run(cuts, is_exact=False)

    def _end_run(self, motions: Sequence[Motion] | LineRun, *, is_exact: bool) -> None:
        """These motions are a run, if there are any; `is_exact`: a pending exact stop belongs to the last one."""
        if len(motions) == 0:
            return
        modal = Modal(self._mode, self._tolerance_mm, self._is_soft)
        if self._is_single_block and self._mode is not PathMode.EXACT_STOP:
            modal = Modal(PathMode.CONTINUOUS, 0.0, self._is_soft)
        self._runs.append(Run(motions, modal, self._is_after_stop, is_exact))
        self._is_after_stop = False
        self._is_exact_once &= not is_exact

    def _note(self, command: Command, motions: int) -> None:
        """A command that is no motion: modal, or an event of its own."""
        match command:
            case canon.SetPathMode(mode=mode, tolerance_mm=tolerance):
                self._mode = mode
                preset = self._times.continuous_mm if mode is PathMode.CONTINUOUS else self._times.rounding_mm
                self._tolerance_mm = preset if tolerance is None else tolerance
            case canon.ExactStopOnce():
                self._is_exact_once = True
            case canon.SetJerkLimit(is_limited=is_limited):
                self._is_soft = is_limited
            case _:
                is_synchronous = self._is_synchronous(command)
                self.events.append(Event(motions, command, is_synchronous))
                self._is_after_stop |= is_synchronous
                if isinstance(command, canon.Spindle):
                    self._spindle_rpm = command.speed_rpm

    def _is_synchronous(self, command: Command) -> bool:
        """Whether the axes stand while this is done."""
        if isinstance(command, canon.Spindle):
            return command.speed_rpm != self._spindle_rpm
        if isinstance(command, canon.Stop) and command.is_optional:
            return self._stops_at_optional
        return isinstance(command, _SYNCHRONOUS)
