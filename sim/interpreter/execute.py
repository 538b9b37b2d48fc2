"""What one block does: read, check, then change the state and give canonical commands, in the control's order.

The order within a block: modes, frames, tool, spindle start, coolant, message, then the move, then what the control
does after a move (M5, M9, M0, M1, M2, M17, M30).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from planner.gcode import Block, ModalGroup, Name, Text, Word
from sim.interpreter import canon
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.frame_words import program_frame, program_limits
from sim.interpreter.mode_words import remember, set_feed, set_modes
from sim.interpreter.motion_words import Frames, Mover
from sim.interpreter.outlet import Outlet
from sim.interpreter.request import AXES, Request, request_of
from sim.interpreter.settings import Settings
from sim.interpreter.state import State
from sim.interpreter.values import Variables, evaluate
from sim.interpreter.vocabulary import refusal_of

_MESSAGE_LIMIT = 200
_ENDS = frozenset({2, 17, 30})


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a block leaves to the flow: subprograms to call, how often, and whether the program ends."""

    calls: list[Word]
    count: int
    is_end: bool


NOTHING_LEFT = Outcome([], 1, is_end=False)


class Executor:
    """Executes blocks of words against the state; flow and subprograms are decided elsewhere."""

    def __init__(
        self,
        settings: Settings,
        state: State,
        variables: Variables,
        outlet: Outlet,
        require_program: Callable[[Word], None],
    ) -> None:
        self._settings, self._state, self._variables, self._outlet = settings, state, variables, outlet
        self._require_program = require_program
        self._mover = Mover(settings, state, outlet)

    @property
    def frames(self) -> Frames:
        """In which coordinates blocks have moved."""
        return self._mover.frames

    @property
    def is_waiting(self) -> bool:
        """Whether a move waits for what follows it."""
        return self._mover.path.is_waiting

    def execute(self, block: Block) -> Outcome:
        """Carry out a block. Raises ControlAlarm for what the control refuses."""
        request = request_of(block, self._variables, self._settings.accepted_m_codes)
        if request.is_bare_move:
            set_feed(request, self._state)
            self._mover.move(request)
            self._require_used(request)
            return NOTHING_LEFT
        calls = self._own_calls(request)
        self._numbered_call(calls, request)
        remember(request, self._state)
        set_modes(request, self._state, self._outlet)
        set_feed(request, self._state)
        self._tool(request)
        self._before_move(request)
        self._work(request)
        count = request.take("P") if calls else None
        self._require_used(request)
        self._after_move(request)
        return Outcome(calls, 1 if count is None else int(count), not _ENDS.isdisjoint(request.m_codes))

    def _work(self, request: Request) -> None:
        """The one thing a block does beside its modes: it waits, sets a frame, or moves."""
        one_shot, frame = request.code(ModalGroup.ONE_SHOT), request.code(ModalGroup.FRAME)
        if one_shot is not None and frame is not None:
            text = f"{one_shot} and {frame} stand in one block; a block of its own is expected for each"
            raise ControlAlarm(AlarmNumber.OWN_BLOCK, text, request.column_of(ModalGroup.FRAME))
        if one_shot == "G4":
            self._mover.set_motion(request)
            self._dwell(request)
        elif frame is not None:
            self._mover.path.finish_spline(None)
            self._mover.set_motion(request)
            self._frame(frame, request)
        else:
            self._mover.move(request)

    def _numbered_call(self, calls: list[Word], request: Request) -> None:
        column = request.numbers.get("L", (0.0, 0))[1]
        number = request.take("L")
        if number is not None:
            calls.append(Word(f"L{number:g}", column=column))
        if len(calls) > 1:
            refusal = refusal_of(calls[0].address)
            if refusal is not None:
                raise ControlAlarm(AlarmNumber.NAME_UNKNOWN, refusal, calls[0].column)
            text = f"{calls[0].address} and {calls[1].address} are called in one block; one call is expected"
            raise ControlAlarm(AlarmNumber.BLOCK_NOT_INTERPRETABLE, text, calls[1].column)
        for word in calls:
            self._require_program(word)

    def finish(self) -> None:
        """The program has ended: what still waits is completed."""
        self._mover.path.finish()

    def _put(self, make: type[canon.Command], request: Request, *values: object) -> None:
        self._outlet.put(make(request.block.line, request.block.number, *values))

    def _own_calls(self, request: Request) -> list[Word]:
        calls: list[Word] = []
        for word in request.calls:
            if word.address == "MSG":
                self._message(word, request)
            elif word.address == "FGROUP":
                self._feed_group(word)
            else:
                calls.append(word)
        return calls

    def _message(self, word: Word, request: Request) -> None:
        values = word.arguments
        if values is None or len(values) > 1:
            raise ControlAlarm(
                AlarmNumber.PARAMETERS, 'MSG needs one text; MSG("text") or MSG() is expected', word.column
            )
        text = ""
        if values and values[0] is not None:
            value = evaluate(values[0], self._variables)
            text = value if isinstance(value, str) else f"{value:.12g}"
        if len(text) > _MESSAGE_LIMIT:
            raise ControlAlarm(AlarmNumber.PARAMETERS, f"MSG is longer than {_MESSAGE_LIMIT} characters", word.column)
        self._state.message = text
        self._put(canon.Message, request, text)

    def _feed_group(self, word: Word) -> None:
        axes: list[int] = []
        for value in word.arguments or ():
            if not isinstance(value, Name) or value.name not in AXES:
                text = "FGROUP names something that is no axis; X, Y or Z is expected"
                raise ControlAlarm(AlarmNumber.PARAMETERS, text, word.column)
            axes.append(AXES[value.name])
        self._state.feed_axes = tuple(axes) if 0 < len(set(axes)) < len(AXES) else None

    def _tool(self, request: Request) -> None:
        state, settings = self._state, self._settings
        number = request.take("T")
        if request.tool_name is not None:
            digits = "".join(filter(str.isdigit, request.tool_name))
            number = float(digits[:8]) if digits else 0.0
        if number is not None:
            if number < 0 or number != int(number):
                raise ControlAlarm(
                    AlarmNumber.VALUE_OUT_OF_RANGE, f"T{number:g} is no tool; a whole number is expected"
                )
            state.tool_selected, state.tool_selected_name = int(number), request.tool_name or ""
            self._put(canon.SelectTool, request, int(number))
        if 6 in request.m_codes or (number is not None and not settings.has_tool_changer):
            state.tool, state.tool_name, state.edge = state.tool_selected, state.tool_selected_name, 1
            self._put(canon.ChangeTool, request, state.tool)
        edge = request.take("D")
        if edge is not None:
            if not 0 <= edge <= 9 or edge != int(edge):
                raise ControlAlarm(AlarmNumber.VALUE_OUT_OF_RANGE, f"D{edge:g} is no edge; D0 to D9 is expected")
            state.edge = int(edge)
            self._put(canon.SelectEdge, request, state.edge)

    def _before_move(self, request: Request) -> None:
        state = self._state
        is_own_s = request.code(ModalGroup.FRAME) in ("G25", "G26") or request.code(ModalGroup.ONE_SHOT) == "G4"
        speed = None if is_own_s else request.take("S")
        if speed is not None:
            if speed < 0:
                raise ControlAlarm(AlarmNumber.VALUE_OUT_OF_RANGE, f"S{speed:g} is no speed; 0 or more is expected")
            state.spindle_rpm = speed
        turns = [number for number in (3, 4, 5) if number in request.m_codes]
        if len(turns) > 1:
            raise ControlAlarm(AlarmNumber.SAME_GROUP, f"M{turns[0]} and M{turns[1]} exclude each other")
        if turns and turns[0] != 5:
            state.spindle_direction = 1 if turns[0] == 3 else -1
        if (turns and turns[0] != 5) or (speed is not None and state.spindle_direction and not turns):
            self._put(canon.Spindle, request, state.spindle_direction * state.limited_rpm)
        if 7 in request.m_codes or 8 in request.m_codes:
            state.is_mist |= 7 in request.m_codes
            state.is_flood |= 8 in request.m_codes
            self._put(canon.Coolant, request, state.is_flood, state.is_mist)

    def _after_move(self, request: Request) -> None:
        state = self._state
        if 5 in request.m_codes:
            state.spindle_direction = 0
            self._put(canon.Spindle, request, 0.0)
        if 9 in request.m_codes:
            state.is_flood = state.is_mist = False
            self._put(canon.Coolant, request, False, False)
        for number in (0, 1):
            if number in request.m_codes:
                self._put(canon.Stop, request, number == 1)

    def _dwell(self, request: Request) -> None:
        seconds, turns = request.take("F"), request.take("S")
        if (seconds is None) == (turns is None):
            raise ControlAlarm(AlarmNumber.PARAMETERS, "G4 needs F with seconds or S with turns", None)
        if turns is not None:
            speed = self._state.limited_rpm if self._state.spindle_direction else 0.0
            if speed == 0.0:
                raise ControlAlarm(
                    AlarmNumber.NO_SPINDLE, "G4 S waits for turns of a spindle that stands; M3 is expected"
                )
            seconds = turns / speed * 60.0
        assert seconds is not None
        if seconds < 0:
            raise ControlAlarm(AlarmNumber.VALUE_OUT_OF_RANGE, f"G4 waits {seconds:g} s; 0 or more is expected")
        self._put(canon.Dwell, request, seconds)

    def _frame(self, code: str, request: Request) -> None:
        state = self._state
        if code not in ("G25", "G26"):
            program_frame(code, request, state)
            return
        speed_rpm = state.limited_rpm
        program_limits(code, request, state)
        if state.spindle_direction and state.limited_rpm != speed_rpm:
            self._put(canon.Spindle, request, state.spindle_direction * state.limited_rpm)

    def _require_used(self, request: Request) -> None:
        left = request.leftover()
        if left is not None:
            name, column = left
            text = f"{name} has no meaning in this block; a code that uses it is expected"
            raise ControlAlarm(AlarmNumber.BLOCK_NOT_INTERPRETABLE, text, column)


def text_argument(word: Word, variables: Variables) -> str:
    """The single text of a call such as EXTCALL("name")."""
    values = word.arguments or ()
    value = values[0] if len(values) == 1 else None
    text = value.value if isinstance(value, Text) else evaluate(value, variables) if value is not None else None
    if not isinstance(text, str):
        raise ControlAlarm(AlarmNumber.PARAMETERS, f'{word.address} needs a name; ("NAME") is expected', word.column)
    return text
