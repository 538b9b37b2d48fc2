"""The interpreter: bytes of blocks in, canonical commands out; an alarm is a command too, and the last one."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import suppress

from planner.gcode import SyntaxProblem, read_block
from sim.interpreter import canon
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.execute import Executor
from sim.interpreter.outlet import Outlet
from sim.interpreter.settings import Settings
from sim.interpreter.state import State
from sim.interpreter.values import Value, Variables


class Interpreter:
    """One program, block by block as the control receives it.

    `block` and `finish` return the commands that are decided so far; splines and compensation wait for later blocks.
    After an Alarm or an End nothing more is given.
    """

    def __init__(self, settings: Settings | None = None) -> None:
        self._settings = settings or Settings()
        self._state = State(self._settings.start_mm)
        self._outlet = Outlet()
        self._variables = Variables(self._settings.r_parameters, self._system)
        self._line = 0
        self._executor = Executor(self._settings, self._state, self._variables, self._outlet)

    @property
    def state(self) -> State:
        """The modal state after the blocks so far, as a copy."""
        return copy.copy(self._state)

    def block(self, raw: bytes, line: int) -> list[canon.Command]:
        """The commands that this block decides. `line` counts from 1."""
        if self._state.is_ended:
            return []
        self._line = line
        number: int | None = None
        try:
            block = read_block(raw.decode("latin-1"), line)
            number = block.number
            if block.skip_level is not None and block.skip_level in self._settings.skip_levels:
                return self._outlet.drain()
            self._executor.execute(block)
            if not self._state.is_ended:
                self._end_of_program(block.words, line, number)
        except SyntaxProblem as problem:
            text = f"{problem.what}; expected {problem.expected}"
            self._alarm(AlarmNumber.SYNTAX, text, problem.column, line, number)
        except ControlAlarm as alarm:
            self._alarm(alarm.number, alarm.text, alarm.column, line, number)
        return self._outlet.drain()

    def finish(self) -> list[canon.Command]:
        """The commands that waited for more blocks; call it when no more will come."""
        if not self._state.is_ended:
            try:
                self._executor.finish()
            except ControlAlarm as alarm:
                self._alarm(alarm.number, alarm.text, alarm.column, self._line, None)
            self._state.is_ended = True
        return self._outlet.drain()

    def _end_of_program(self, words: tuple[object, ...], line: int, number: int | None) -> None:
        ends = any(getattr(w, "address", "") == "M" and getattr(w, "value", None) in (2.0, 17.0, 30.0) for w in words)
        if ends:
            self._executor.finish()
            self._outlet.put(canon.End(line, number))
            self._state.is_ended = True

    def _alarm(self, number: int, text: str, column: int | None, line: int, block: int | None) -> None:
        with suppress(ControlAlarm):
            self._executor.finish()
        self._outlet.abandon()
        self._outlet.put(canon.Alarm(line, block, int(number), text, column))
        self._state.is_ended = True

    def _system(self, name: str, indices: tuple[Value, ...]) -> Value:
        shown = f"{name}[...]" if indices else name
        raise ControlAlarm(AlarmNumber.NAME_UNKNOWN, f"the system variable {shown} is not known")


def interpret(data: bytes, settings: Settings | None = None) -> Iterator[canon.Command]:
    """The canonical commands of a whole program."""
    interpreter = Interpreter(settings)
    for line, raw in enumerate(data.split(b"\n"), start=1):
        yield from interpreter.block(raw, line)
    yield from interpreter.finish()
