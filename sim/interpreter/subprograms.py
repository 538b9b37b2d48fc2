"""Subprograms that run: their arguments, how often they still run, and what SAVE keeps."""

from __future__ import annotations

import difflib
from dataclasses import dataclass, field

from planner.gcode import Expression, Name, Word
from planner.gcode.statement import Procedure
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.definitions import bind
from sim.interpreter.execute import text_argument
from sim.interpreter.levels import Level
from sim.interpreter.library import Library, plain_name
from sim.interpreter.settings import Settings
from sim.interpreter.source import Whole
from sim.interpreter.state import State
from sim.interpreter.values import Value, Variables, evaluate
from sim.interpreter.vocabulary import ACTED_ADDRESSES, ACTED_CODES, IGNORED_ADDRESSES, refusal_of

_BY_TEXT = ("EXTCALL", "CALL")
_SAVED = (
    "motion", "plane", "dimension", "units", "feed_type", "work_offset", "frame", "path_mode", "compensation",
    "corner", "feed_correction", "acceleration", "spline_start", "spline_end",
)  # fmt: skip


@dataclass(slots=True)
class Call:
    """One call: `given` are the expressions of its arguments, `values` what they were, `back` the VAR parameters."""

    name: str
    data: bytes
    left: int
    given: tuple[Expression | None, ...]
    values: list[Value | None]
    back: dict[str, Name] = field(default_factory=dict)
    saved: dict[str, object] | None = None
    has_run: bool = False


class Subprograms:
    """The stack of calls above the main program; levels and scopes of variables grow and shrink with it.

    `begun` counts the subprograms that have begun, each run of one for itself.
    """

    def __init__(self, settings: Settings, state: State, variables: Variables, levels: list[Level]) -> None:
        self._settings, self._state, self._variables, self._levels = settings, state, variables, levels
        self._library = Library(settings.subprogram_folder)
        self._calls: list[Call] = []
        self.begun = 0

    @property
    def name(self) -> str | None:
        """The subprogram that runs, or None in the main program."""
        return self._calls[-1].name if self._calls else None

    def require(self, word: Word) -> None:
        """ControlAlarm where the word calls nothing that exists."""
        self._found(word)

    def call(self, word: Word, count: int) -> None:
        """Begin the subprogram that a word calls; ControlAlarm where there is none or too many are nested."""
        name, data = self._found(word)
        if len(self._calls) >= self._settings.max_call_depth:
            limit = self._settings.max_call_depth
            raise ControlAlarm(AlarmNumber.CALL_DEPTH, f"more than {limit} subprograms are nested", word.column)
        if not 0 <= count <= 9999:
            raise ControlAlarm(AlarmNumber.VALUE_OUT_OF_RANGE, f"P{count} is no number of calls; 1 to 9999 is expected")
        given = () if word.address in _BY_TEXT else word.arguments or ()
        values = [None if one is None else evaluate(one, self._variables) for one in given]
        if count:
            self._begin(Call(plain_name(name), data, count, given, values))

    def head(self, procedure: Procedure) -> None:
        """PROC, the head of the subprogram that runs: parameters come into being."""
        if not self._calls:
            return
        call = self._calls[-1]
        call.back = bind(procedure, call.given, call.values, self._variables)
        if "SAVE" in procedure.attributes:
            call.saved = {name: getattr(self._state, name) for name in _SAVED}

    def end(self) -> None:
        """The subprogram has ended: VAR parameters go back, and it runs again if calls are left."""
        call = self._calls.pop()
        self._levels.pop()
        scope = self._variables.scopes.pop()
        for name, value in (call.saved or {}).items():
            setattr(self._state, name, value)
        for parameter, expression in call.back.items():
            self._variables.assign(expression, scope[parameter].values[0])
        if call.left > 1:
            call.left -= 1
            self._begin(call)

    def _begin(self, call: Call) -> None:
        self.begun += 1
        self._calls.append(call)
        caller = self._levels[-1]
        is_repeat = call.has_run or caller.is_repeat or caller.at < caller.furthest
        call.has_run = True
        self._levels.append(Level(Whole(call.data), is_main=False, is_repeat=is_repeat))
        self._variables.scopes.append({})

    def _found(self, word: Word) -> tuple[str, bytes]:
        name = text_argument(word, self._variables) if word.address in _BY_TEXT else word.address
        data = self._library.program(name)
        if data is None:
            raise self._missing(name, word)
        return name, data

    def _missing(self, name: str, word: Word) -> ControlAlarm:
        if word.address in _BY_TEXT or (word.address[0] == "L" and word.address[1:].isdigit()):
            text = f"the subprogram {name} is not in the folder; a program of the folder is expected"
            return ControlAlarm(AlarmNumber.NO_PROGRAM, text, word.column)
        refusal = refusal_of(name)
        if refusal is not None:
            return ControlAlarm(AlarmNumber.NAME_UNKNOWN, refusal, word.column)
        known = [*ACTED_CODES, *ACTED_ADDRESSES, *IGNORED_ADDRESSES, *self._library.names]
        near = difflib.get_close_matches(name, sorted(known), n=1, cutoff=0.6)
        meant = f"{near[0]} may be meant" if near else "a word of its list is expected"
        return ControlAlarm(
            AlarmNumber.NAME_UNKNOWN, f"{name} is neither a word of this control nor a subprogram; {meant}", word.column
        )
