"""What one block asks for: its words sorted by kind with their values, before any of them takes effect.

Whatever no part of the interpreter takes out of a request has no meaning in that block, and is an alarm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from planner.gcode import GROUP_OF, Block, Call, Expression, ModalGroup, Name, Word, code_of
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.values import Variables, as_number, evaluate
from sim.interpreter.vocabulary import (
    ACTED_ADDRESSES,
    ACTED_CODES,
    ACTED_M,
    IGNORED_ADDRESSES,
    IGNORED_CODES,
    IGNORED_M,
    REFUSED_CODES,
    refusal_of,
)

AXES = {"X": 0, "Y": 1, "Z": 2}
CENTRES = {"I": 0, "J": 1, "K": 2}
MIDDLES = {"I1": 0, "J1": 1, "K1": 2}
MACHINE_AXES = {"X1": 0, "Y1": 1, "Z1": 2}
NUMBERS = frozenset(["F", "S", "T", "D", "L", "P", "CR", "AR", "TURN", "RPL", "PL", "PW", "SD", "ADIS", "CTOL", "FP"])
LARGEST = 1e9
_NUMBERS_OF_MOVES = frozenset(["F", "PL", "PW"])
_CODES_OF_MOVES = frozenset([ModalGroup.MOTION, ModalGroup.EXACT_STOP_ONCE])


@dataclass(frozen=True, slots=True)
class Coordinate:
    """A dimension as programmed; `is_absolute` is None where neither AC nor IC says."""

    value: float
    is_absolute: bool | None
    column: int


@dataclass(slots=True)
class Request:
    """The words of one block by kind. Axis indices are 0, 1, 2; `polynomials` has None for the denominator."""

    block: Block
    codes: dict[ModalGroup, tuple[str, int]] = field(default_factory=dict)
    m_codes: list[int] = field(default_factory=list)
    axes: dict[int, Coordinate] = field(default_factory=dict)
    centres: dict[int, Coordinate] = field(default_factory=dict)
    middles: dict[int, Coordinate] = field(default_factory=dict)
    machine_axes: dict[int, Coordinate] = field(default_factory=dict)
    polynomials: dict[int | None, tuple[float, ...]] = field(default_factory=dict)
    numbers: dict[str, tuple[float, int]] = field(default_factory=dict)
    tool_name: str | None = None
    calls: list[Word] = field(default_factory=list)
    accepted: list[Word] = field(default_factory=list)

    def code(self, group: ModalGroup) -> str | None:
        """The code of this group in the block, or None."""
        found = self.codes.get(group)
        return None if found is None else found[0]

    def take(self, address: str) -> float | None:
        """The number at this address, which counts as used then."""
        found = self.numbers.pop(address, None)
        return None if found is None else found[0]

    def column_of(self, group: ModalGroup) -> int | None:
        """Where the code of this group stands."""
        found = self.codes.get(group)
        return None if found is None else found[1]

    @property
    def is_geometry(self) -> bool:
        """Whether axis, centre or polynomial words ask for a move."""
        return bool(self.axes or self.centres or self.middles or self.polynomials)

    @property
    def is_bare_move(self) -> bool:
        """Whether the block holds a motion code, G9, dimensions, a feed and what belongs to a curve at most."""
        return (
            not (self.m_codes or self.calls or self.tool_name or self.accepted)
            and self.codes.keys() <= _CODES_OF_MOVES
            and self.numbers.keys() <= _NUMBERS_OF_MOVES
        )

    def leftover(self) -> tuple[str, int] | None:
        """A word that nothing has taken, with its column, or None."""
        groups = (
            (AXES, self.axes),
            (CENTRES, self.centres),
            (MIDDLES, self.middles),
            (MACHINE_AXES, self.machine_axes),
        )
        for names, coordinates in groups:
            for name, index in names.items():
                if index in coordinates:
                    return name, coordinates[index].column
        if self.polynomials:
            return "PO", 0
        for name, (_, column) in self.numbers.items():
            return name, column
        return None


def request_of(block: Block, variables: Variables, accepted_m: frozenset[int]) -> Request:
    """The words of a block sorted; assignments to variables are made on the way, left to right."""
    request = Request(block)
    for word in block.words:
        try:
            _sort(word, request, variables, accepted_m)
        except ControlAlarm as alarm:
            if alarm.column is not None:
                raise
            raise ControlAlarm(alarm.number, alarm.text, word.column) from None
    return request


def _sort(word: Word, request: Request, variables: Variables, accepted_m: frozenset[int]) -> None:
    address = word.address
    if address in AXES:
        _add_coordinate(word, AXES[address], request.axes, variables, request)
    elif address in NUMBERS:
        _add_number(word, request, variables)
    elif address == "G" or (word.value is None and word.arguments is None and address in GROUP_OF):
        _add_code(word, request)
    elif address in ("M", "M1"):
        _add_m(word, request, variables, accepted_m)
    elif address in CENTRES:
        _add_coordinate(word, CENTRES[address], request.centres, variables, None)
    elif address in MIDDLES:
        _add_coordinate(word, MIDDLES[address], request.middles, variables, None)
    elif address in MACHINE_AXES:
        _add_coordinate(word, MACHINE_AXES[address], request.machine_axes, variables, None)
    elif address == "S1":
        _put(request, "S", number_of(word, variables), word)
    elif address == "PO":
        _add_polynomial(word, request, variables)
    elif word.value is not None and variables.is_known(address):
        indices = tuple(evaluate(index, variables) for index in word.index or ())
        variables.write(address, indices, _word_value(word, variables))
    elif address in IGNORED_ADDRESSES:
        request.accepted.append(word)
    else:
        _add_call(word, request)


def _add_code(word: Word, request: Request) -> None:
    code = code_of(word) or f"G{word.text}"
    group = GROUP_OF.get(code)
    if group is None:
        raise ControlAlarm(
            AlarmNumber.UNKNOWN_G, f"{code} is no G function of this control; one of its list is expected"
        )
    if code in REFUSED_CODES:
        raise ControlAlarm(AlarmNumber.UNKNOWN_G, f"{code} ({REFUSED_CODES[code]}) is not available on this control")
    if code not in ACTED_CODES and code not in IGNORED_CODES:
        raise ControlAlarm(AlarmNumber.UNKNOWN_G, f"{code} is not available on this control")
    if group in request.codes:
        first = request.codes[group][0]
        text = f"{first} and {code} are of the same group; one of them is expected"
        raise ControlAlarm(AlarmNumber.SAME_GROUP, text)
    request.codes[group] = (code, word.column)


def _add_m(word: Word, request: Request, variables: Variables, accepted_m: frozenset[int]) -> None:
    value = number_of(word, variables)
    number = int(value)
    if number != value or (number not in ACTED_M and number not in IGNORED_M and number not in accepted_m):
        text = f"M{value:g} is not known to this machine; an M function of its list is expected"
        raise ControlAlarm(AlarmNumber.M_UNKNOWN, text)
    if number in request.m_codes:
        raise ControlAlarm(AlarmNumber.SAME_GROUP, f"M{number} stands twice; once is expected")
    request.m_codes.append(number)


def _add_coordinate(
    word: Word, index: int, into: dict[int, Coordinate], variables: Variables, request: Request | None
) -> None:
    if index in into:
        raise ControlAlarm(AlarmNumber.AXIS_TWICE, f"{word.address} stands twice; once is expected")
    value, is_absolute = word.value, None
    if isinstance(value, Call) and value.name in ("AC", "IC") and len(value.arguments) == 1:
        is_absolute = value.name == "AC"
        value = value.arguments[0]
    elif isinstance(value, Call) and value.name == "PO" and request is not None:
        request.polynomials[index] = _numbers_of(value.arguments, variables)
        return
    number = value if isinstance(value, float) else _evaluated(value, word, variables)
    into[index] = Coordinate(_in_range(number, word.address), is_absolute, word.column)


def _add_number(word: Word, request: Request, variables: Variables) -> None:
    if word.address == "T" and word.value is not None and not isinstance(word.value, float):
        value = evaluate(word.value, variables)
        if isinstance(value, str):
            request.tool_name = value
            return
    _put(request, word.address, number_of(word, variables), word)


def _put(request: Request, address: str, value: float, word: Word) -> None:
    if address in request.numbers:
        raise ControlAlarm(AlarmNumber.AXIS_TWICE, f"{word.address} stands twice; once is expected")
    request.numbers[address] = (_in_range(value, word.address), word.column)


def _add_polynomial(word: Word, request: Request, variables: Variables) -> None:
    arguments = word.arguments
    if word.index is None or (arguments is None and word.value is None):
        raise ControlAlarm(AlarmNumber.SYNTAX, "PO lacks brackets or values; PO[X]=(end,a2,a3) is expected")
    values = _numbers_of(arguments, variables) if arguments is not None else (number_of(word, variables),)
    axis: int | None = None
    if word.index:
        index = word.index[0]
        if len(word.index) != 1 or not isinstance(index, Name) or index.name not in AXES:
            raise ControlAlarm(AlarmNumber.POLYNOMIAL, "PO names no axis; PO[X], PO[Y], PO[Z] or PO[] is expected")
        axis = AXES[index.name]
    if axis in request.polynomials:
        raise ControlAlarm(AlarmNumber.AXIS_TWICE, "PO stands twice for one axis; once is expected")
    request.polynomials[axis] = values


def _numbers_of(arguments: tuple[Expression | None, ...], variables: Variables) -> tuple[float, ...]:
    if not 1 <= len(arguments) <= 5:
        text = f"a polynomial has {len(arguments)} values; the end and at most 4 coefficients are expected"
        raise ControlAlarm(AlarmNumber.POLYNOMIAL, text)
    return tuple(
        0.0 if argument is None else _in_range(as_number(evaluate(argument, variables)), "PO") for argument in arguments
    )


def _add_call(word: Word, request: Request) -> None:
    is_call = word.value is None and (word.address in ACTED_ADDRESSES or len(word.address) > 1)
    if not is_call:
        text = f"the address {word.address} is not known; an address of the control's list is expected"
        if word.address == "N":
            text = "N stands inside the block; the block number is expected at its head"
        elif word.address[0] in "MS" and word.address[1:].isdigit():
            kind = word.address[0]
            text = f"{word.address}= is for another spindle, and this machine has one; {kind} or {kind}1= is expected"
        raise ControlAlarm(AlarmNumber.NAME_UNKNOWN, refusal_of(word.address) or text)
    request.calls.append(word)


def number_of(word: Word, variables: Variables) -> float:
    """The number a word carries."""
    if isinstance(word.value, float):
        return word.value
    return _evaluated(word.value, word, variables)


def _evaluated(value: Expression | float | None, word: Word, variables: Variables) -> float:
    if value is None:
        raise ControlAlarm(AlarmNumber.SYNTAX, f"{word.address} has no value; a number is expected")
    return value if isinstance(value, float) else as_number(evaluate(value, variables))


def _word_value(word: Word, variables: Variables) -> float | str:
    value = word.value
    assert value is not None
    return value if isinstance(value, float) else evaluate(value, variables)


def _in_range(value: float, address: str) -> float:
    if not math.isfinite(value) or abs(value) > LARGEST:
        raise ControlAlarm(AlarmNumber.VALUE_OUT_OF_RANGE, f"{address} is too large; at most {LARGEST:g} is expected")
    return value
