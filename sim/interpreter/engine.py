"""The interpreter: bytes of blocks in, canonical commands out; an alarm is a command too, and the last one.

Blocks of subprograms give commands with line and block number of the block in the main program that called them.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from planner.gcode import Block, SyntaxProblem, read_block
from planner.gcode.statement import Define, Procedure, Return
from sim.interpreter import canon
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.canon import Vector
from sim.interpreter.definitions import define
from sim.interpreter.execute import Executor
from sim.interpreter.flow import Flow
from sim.interpreter.levels import Level
from sim.interpreter.mapping import mapping_of
from sim.interpreter.motion_words import Frames
from sim.interpreter.outlet import Outlet
from sim.interpreter.settings import Settings
from sim.interpreter.source import Received, Source
from sim.interpreter.state import State
from sim.interpreter.structures import glance
from sim.interpreter.subprograms import Subprograms
from sim.interpreter.system_variables import SystemVariables
from sim.interpreter.travel import rows_within
from sim.interpreter.values import Variables


class Interpreter:
    """One program, block by block as the control receives it.

    `block` and `finish` return the commands that are decided so far; splines and compensation wait for later blocks.
    After an Alarm or an End nothing more is given.
    """

    def __init__(self, settings: Settings | None = None, source: Source | None = None) -> None:
        self._settings = settings or Settings()
        units = "G70" if self._settings.is_inch else "G71"
        self._state = State(
            self._settings.start_mm,
            units=units,
            is_machine_inch=self._settings.is_inch,
            machine_max_rpm=self._settings.spindle_max_rpm,
        )
        self._outlet = Outlet()
        self._variables = Variables(self._settings.r_parameters, SystemVariables(self._state, self._settings).read)
        self._flow = Flow(self._settings, self._variables)
        self._received = Received(is_kept=not self._settings.is_drip_fed)
        self._main = Level(source or self._received)
        self._levels = [self._main]
        self._subprograms = Subprograms(self._settings, self._state, self._variables, self._levels)
        self._executor = Executor(self._settings, self._state, self._variables, self._outlet, self._subprograms.require)
        self._line = 0
        self._number: int | None = None
        self._read: tuple[bytes, Block | None] = (b"", None)

    @property
    def state(self) -> State:
        """The modal state after the blocks so far, as a copy."""
        return copy.copy(self._state)

    @property
    def modal(self) -> State:
        """The modal state itself, for the fast route; see `state` for a copy."""
        return self._state

    @property
    def variables(self) -> Variables:
        """R parameters and variables of the moment."""
        return self._variables

    @property
    def frames(self) -> Frames:
        """In which coordinates blocks have moved; whoever reads it clears it."""
        return self._executor.frames

    @property
    def calls(self) -> int:
        """How many subprograms have begun so far."""
        return self._subprograms.begun

    @property
    def is_in_structure(self) -> bool:
        """Whether an IF or a loop of the main program is open, or a jump looks for its target."""
        return bool(self._main.opened or self._main.sections) or self._main.search is not None

    @property
    def is_passing_over(self) -> bool:
        """Whether blocks are passed over: the branch of an IF that is not taken, or the way to the target of a jump."""
        return self._main.search is not None

    def go_on_from(self, other: Interpreter) -> None:
        """Take over the state, the variables and the open structures that another interpreter left."""
        for one in fields(State):
            setattr(self._state, one.name, getattr(other._state, one.name))
        self._state.is_ended = False
        self._variables.r, self._variables.globals = other._variables.r, other._variables.globals
        self._main.opened = other._main.opened

    @property
    def is_waiting(self) -> bool:
        """Whether a spline or a compensated contour has begun whose end waits for a block still to come."""
        return self._executor.is_waiting

    @property
    def next_line(self) -> int | None:
        """Index of the main program's next line, or None after the end."""
        return None if self._state.is_ended else self._main.at

    @property
    def takes_runs(self) -> bool:
        """Whether plain blocks with G1 would give nothing but straight cuts, each as written plus `total_shift`."""
        state, main = self._state, self._main
        return (
            not state.is_ended
            and (main.source is not self._received or not self._received.is_kept)
            and len(self._levels) == 1
            and main.search is None
            and not main.sections
            and main.at >= main.furthest
            and state.is_plain
            and not self._executor.is_waiting
            and self._outlet.is_empty
        )

    @property
    def total_shift(self) -> Vector:
        """Canonical minus programmed coordinates while the frame only shifts."""
        return mapping_of(self._state, self._settings, is_suppressed=False).total_shift

    def plain_rows_within(self, values: NDArray[np.float64]) -> int:
        """How many of these plain blocks (`PlainLines.values`), from the first on, stay within the axes' travel."""
        return rows_within(values, self._state, self._settings, self.total_shift)

    def take_run(self, count: int, feed: float, last: canon.Line | None) -> None:
        """The next `count` blocks, all plain, have been read elsewhere; the state becomes what they leave."""
        self._main.at += count
        self._main.furthest = max(self._main.furthest, self._main.at)
        self._received.skip(count)
        self._state.feed = feed
        if last is not None:
            self._state.position_mm, self._state.last_motion = last.end, last

    def block(self, raw: bytes, line: int, read: Block | None = None) -> list[canon.Command]:
        """The commands that this block decides. `line` counts from 1; `read` is the block, if somebody has read it."""
        if self._state.is_ended:
            return []
        self._received.add(raw, line)
        self._read = (raw, read)
        return list(self.advance())

    def advance(self) -> Iterator[canon.Command]:
        """Execute the blocks that are there, in the order the program gives them."""
        while not self._state.is_ended and self.step():
            yield from self._outlet.drain()
        yield from self._outlet.drain()

    def drain(self) -> list[canon.Command]:
        """The commands decided by `step`."""
        return self._outlet.drain()

    def finish(self) -> list[canon.Command]:
        """The commands that waited for more blocks; call it when no more will come."""
        given: list[canon.Command] = []
        while not self._state.is_ended and (search := self._main.search) is not None:
            self._line, self._number = search.line, None
            if self._guarded(lambda: self._flow.unresolved(self._main)):
                given += self.advance()
        if not self._state.is_ended and self._guarded(self._complete):
            self._state.is_ended = True
        return given + self._outlet.drain()

    def _complete(self) -> None:
        if self._main.opened:
            self._line, self._number = self._main.opened[-1].line, None
        self._flow.require_closed(self._main)
        self._executor.finish()

    def step(self) -> bool:
        """Execute one block of the innermost program; False where it has not come yet."""
        level = self._levels[-1]
        self._flow.section_end(level)
        raw = level.source.text(level.at)
        if raw is None:
            return not level.is_main and self._guarded(lambda: self._end_of_level(level))
        index = level.at
        level.at += 1
        if level.is_main:
            self._line, self._number = level.source.line(index), None
        self._guarded(lambda: self._take(level, index, raw))
        return True

    def _guarded(self, action: Callable[[], None]) -> bool:
        """Do it; what the control refuses becomes an alarm, and False."""
        try:
            action()
        except SyntaxProblem as problem:
            self._alarm(AlarmNumber.SYNTAX, f"{problem.what}; expected {problem.expected}", problem.column)
        except ControlAlarm as alarm:
            if alarm.line is not None:
                self._line, self._number = alarm.line, alarm.block
            self._alarm(alarm.number, alarm.text, alarm.column)
        else:
            return True
        return False

    def _take(self, level: Level, index: int, raw: bytes) -> None:
        if level.search is not None:
            block = glance(raw)
            if not self._flow.look(level, index, block):
                return
        self._flow.count_block(level, index)
        text, read = self._read
        block = read if read is not None and raw is text else read_block(raw.decode("latin-1"), self._line)
        if level.is_main:
            self._number = block.number
        else:
            block = _called_from(block, self._line, self._number)
        if block.skip_level is None or block.skip_level not in self._settings.skip_levels:
            before = self._outlet.count
            try:
                self._execute(level, index, block)
            except ControlAlarm as alarm:
                self._outlet.withdraw(before)
                if alarm.line is None:
                    alarm.column = alarm.column or _first_column(block)
                raise

    def _execute(self, level: Level, index: int, block: Block) -> None:
        statement = block.statement
        if isinstance(statement, Define):
            define(statement, self._variables, self._settings.max_array_elements)
        elif isinstance(statement, Procedure):
            self._subprograms.head(statement)
        elif isinstance(statement, Return):
            self._return(level)
        elif statement is not None:
            self._flow.act(level, index, statement)
        elif block.words:
            outcome = self._executor.execute(block)
            for word in outcome.calls:
                self._subprograms.call(word, outcome.count)
            if outcome.is_end:
                self._return(level)

    def _return(self, level: Level) -> None:
        """M2, M17, M30 or RET: a subprogram goes back to its caller, the main program ends."""
        if level.is_main:
            self._executor.finish()
            self._outlet.put(canon.End(self._line, self._number))
            self._state.is_ended = True
        else:
            self._flow.count_repeat()
            self._subprograms.end()

    def _end_of_level(self, level: Level) -> None:
        if level.search is not None:
            self._flow.unresolved(level)
        else:
            self._flow.require_closed(level)
            self._return(level)

    def _alarm(self, number: int, text: str, column: int | None) -> None:
        with suppress(ControlAlarm):
            self._executor.finish()
        self._outlet.abandon()
        name = self._subprograms.name
        if name is not None:
            text, column = f"in subprogram {name}: {text}", None
        self._outlet.put(canon.Alarm(self._line, self._number, int(number), text, column))
        self._state.is_ended = True


def _first_column(block: Block) -> int:
    """Where the block begins to command something, for alarms about all of it."""
    if block.words:
        return block.words[0].column
    return len(block.text) - len(block.text.lstrip()) + 1


def _called_from(block: Block, line: int, number: int | None) -> Block:
    return Block(
        line, number, block.words, block.comment, block.statement, block.label, block.skip_level, block.is_main
    )
