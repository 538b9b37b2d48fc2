"""Values of expressions: parameters, variables and functions of the control's language. Angles in degrees there."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from planner.gcode import Binary, Call, Expression, Name, Number, Text, Unary
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.vocabulary import refusal_of

Value = float | str
AXIS_NAMES = frozenset({"X", "Y", "Z", "X1", "Y1", "Z1"})


@dataclass(slots=True)
class Cell:
    """A defined variable: its type, dimensions, and values in row order (one where it is no array)."""

    type_name: str
    values: list[Value]
    dimensions: tuple[int, ...] = ()


@dataclass(slots=True)
class Variables:
    """R parameters and the variables in sight; `system` reads names that begin with $.

    `unset_read` are R parameters that were read before anything set them, `system_read` the names that were read with
    $: a control may give other values for both.
    """

    r_count: int
    system: Callable[[str, tuple[Value, ...]], Value]
    r: dict[int, float] = field(default_factory=dict)
    globals: dict[str, Cell] = field(default_factory=dict)
    scopes: list[dict[str, Cell]] = field(default_factory=list)
    unset_read: set[str] = field(default_factory=set)
    system_read: set[str] = field(default_factory=set)

    def find(self, name: str) -> Cell | None:
        """The variable of this name: of the running subprogram, else of the main program."""
        if self.scopes and name in self.scopes[-1]:
            return self.scopes[-1][name]
        return self.globals.get(name)

    def read(self, name: str, indices: tuple[Value, ...]) -> Value:
        """The value of R parameter, system variable or defined variable; ControlAlarm where there is none."""
        number = self._r_number(name, indices)
        if number is not None:
            if number not in self.r:
                self.unset_read.add(f"R{number}")
            return self.r.get(number, 0.0)
        if name.startswith("$"):
            self.system_read.add(name)
            return self.system(name, indices)
        if name in ("TRUE", "FALSE"):
            return 1.0 if name == "TRUE" else 0.0
        if name == "PI":
            return math.pi
        if name in AXIS_NAMES and self.find(name) is None:
            return name
        cell = self._cell(name)
        return cell.values[_place(cell, name, indices)]

    def write(self, name: str, indices: tuple[Value, ...], value: Value) -> None:
        """Assign; ControlAlarm for a name that is not defined or a value of the wrong type."""
        number = self._r_number(name, indices)
        if number is not None:
            self.r[number] = as_number(value)
            return
        if name == "R":
            shown = f"{as_number(value):g}"
            text = f"R{shown} sets nothing; R{shown}= is a parameter and CR={shown} the radius of an arc"
            raise ControlAlarm(AlarmNumber.NAME_UNKNOWN, text)
        cell = self._cell(name)
        cell.values[_place(cell, name, indices)] = converted(value, cell.type_name)

    def assign(self, target: Name, value: Value) -> None:
        """Write to the variable that a VAR argument names."""
        self.write(target.name, tuple(evaluate(index, self) for index in target.indices or ()), value)

    def is_known(self, name: str) -> bool:
        """Whether an assignment to this name is one to a parameter or variable."""
        return name == "R" or (name[0] == "R" and name[1:].isdigit()) or self.find(name) is not None

    def _cell(self, name: str) -> Cell:
        cell = self.find(name)
        if cell is None:
            raise ControlAlarm(AlarmNumber.NAME_UNKNOWN, f"the name {name} is not defined; a DEF before it is expected")
        return cell

    def _r_number(self, name: str, indices: tuple[Value, ...]) -> int | None:
        if name == "R" and len(indices) == 1:
            number = as_integer(indices[0])
        elif name[0] == "R" and name[1:].isdigit() and not indices:
            number = int(name[1:])
        else:
            return None
        if not 0 <= number < self.r_count:
            raise ControlAlarm(AlarmNumber.INDEX, f"R{number} does not exist; R0 to R{self.r_count - 1} do")
        return number


def evaluate(expression: Expression, variables: Variables) -> Value:
    """The value of an expression; ControlAlarm for unknown names, wrong types and undefined arithmetic."""
    match expression:
        case Number(value, _):
            return value
        case Text(text):
            return text
        case Name(name, indices):
            return variables.read(name, tuple(evaluate(index, variables) for index in indices or ()))
        case Call(name, arguments):
            return _function(name, [None if one is None else evaluate(one, variables) for one in arguments])
        case Unary(operator, operand):
            return _unary(operator, as_number(evaluate(operand, variables)))
        case Binary(operator, left, right):
            return _binary(operator, evaluate(left, variables), evaluate(right, variables))


def as_number(value: Value) -> float:
    """The value where a number is needed."""
    if isinstance(value, str):
        raise ControlAlarm(AlarmNumber.TYPE, f'the text "{value}" stands where a number is expected')
    return value


def as_integer(value: Value) -> int:
    """The value where a whole number is needed."""
    number = as_number(value)
    if number != math.floor(number):
        raise ControlAlarm(AlarmNumber.TYPE, f"{number:g} stands where a whole number is expected")
    return int(number)


def converted(value: Value, type_name: str) -> Value:
    """The value as a variable of this type stores it (INT rounds, BOOL is 0 or 1)."""
    if type_name in ("STRING", "AXIS"):
        if not isinstance(value, str):
            raise ControlAlarm(AlarmNumber.TYPE, f"{value:g} stands where a text is expected")
        return value
    number = as_number(value)
    if type_name in ("INT", "CHAR"):
        return float(math.floor(number + 0.5))
    return float(number != 0.0) if type_name == "BOOL" else number


def _place(cell: Cell, name: str, indices: tuple[Value, ...]) -> int:
    if len(indices) != len(cell.dimensions):
        raise ControlAlarm(AlarmNumber.INDEX, f"{name} has {len(cell.dimensions)} indices, not {len(indices)}")
    place = 0
    for index, size in zip(indices, cell.dimensions, strict=True):
        number = as_integer(index)
        if not 0 <= number < size:
            raise ControlAlarm(AlarmNumber.INDEX, f"index {number} of {name} is outside 0 to {size - 1}")
        place = place * size + number
    return place


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ControlAlarm(AlarmNumber.ARITHMETIC, "the result is too large; a finite number is expected")
    return value


def _unary(operator: str, value: float) -> float:
    match operator:
        case "-":
            return -value
        case "+":
            return value
        case "NOT":
            return float(value == 0.0)
        case _:
            return float(~as_integer(value))


def is_same(a: float, b: float) -> bool:
    """Whether the control's comparisons take two numbers for one: to 1e-12 of themselves (programming manual)."""
    return math.isclose(a, b, rel_tol=1e-12)


_COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "==": is_same,
    "<>": lambda a, b: not is_same(a, b),
    ">": lambda a, b: a > b and not is_same(a, b),
    "<": lambda a, b: a < b and not is_same(a, b),
    ">=": lambda a, b: a > b or is_same(a, b),
    "<=": lambda a, b: a < b or is_same(a, b),
}
_BITS: dict[str, Callable[[int, int], int]] = {
    "B_AND": lambda a, b: a & b,
    "B_OR": lambda a, b: a | b,
    "B_XOR": lambda a, b: a ^ b,
}
_LOGIC: dict[str, Callable[[bool, bool], bool]] = {
    "AND": lambda a, b: a and b,
    "OR": lambda a, b: a or b,
    "XOR": lambda a, b: a != b,
}


def are_equal(left: Value, right: Value) -> bool:
    """What == says of two values; a text and a number are never equal."""
    if isinstance(left, str) or isinstance(right, str):
        return left == right
    return is_same(left, right)


def _binary(operator: str, left: Value, right: Value) -> Value:
    if operator == "<<":
        return _shown(left) + _shown(right)
    if isinstance(left, str) and isinstance(right, str) and operator in ("==", "<>"):
        return float((left == right) == (operator == "=="))
    a, b = as_number(left), as_number(right)
    if operator in _COMPARISONS:
        return float(_COMPARISONS[operator](a, b))
    if operator in _BITS:
        return float(_BITS[operator](as_integer(a), as_integer(b)))
    if operator in _LOGIC:
        return float(_LOGIC[operator](a != 0.0, b != 0.0))
    return _arithmetic(operator, a, b)


def _arithmetic(operator: str, a: float, b: float) -> float:
    match operator:
        case "+":
            return _finite(a + b)
        case "-":
            return _finite(a - b)
        case "*":
            return _finite(a * b)
    if b == 0.0:
        raise ControlAlarm(AlarmNumber.ARITHMETIC, "division by 0; a divisor other than 0 is expected")
    match operator:
        case "/":
            return _finite(a / b)
        case "DIV":
            return float(math.trunc(_finite(a / b)))
        case _:
            return math.fmod(a, b)


def _shown(value: Value) -> str:
    return value if isinstance(value, str) else f"{value:.12g}"


def _degrees(function: Callable[[float], float]) -> Callable[[float], float]:
    return lambda value: math.degrees(function(value))


_ONE: dict[str, Callable[[float], float]] = {
    "SIN": lambda a: math.sin(math.radians(math.fmod(a, 360.0))),
    "COS": lambda a: math.cos(math.radians(math.fmod(a, 360.0))),
    "TAN": lambda a: math.tan(math.radians(math.fmod(a, 360.0))),
    "ASIN": _degrees(math.asin),
    "ACOS": _degrees(math.acos),
    "ATAN": _degrees(math.atan),
    "SQRT": math.sqrt,
    "POT": lambda a: a * a,
    "ABS": abs,
    "TRUNC": lambda a: float(math.trunc(a)),
    "ROUND": lambda a: float(math.floor(a + 0.5)),
    "ROUNDUP": lambda a: float(math.ceil(a)),
    "LN": math.log,
    "EXP": math.exp,
}
_TWO: dict[str, Callable[[float, float], float]] = {
    "ATAN2": lambda a, b: math.degrees(math.atan2(a, b)),
    "MINVAL": min,
    "MAXVAL": max,
}
FUNCTIONS = frozenset({*_ONE, *_TWO, "BOUND"})


def _function(name: str, arguments: list[Value | None]) -> float:
    if any(argument is None for argument in arguments):
        raise ControlAlarm(AlarmNumber.PARAMETERS, f"{name} lacks an argument; a value is expected")
    numbers = [as_number(argument) for argument in arguments if argument is not None]
    try:
        if name in _ONE and len(numbers) == 1:
            return _finite(_ONE[name](numbers[0]))
        if name in _TWO and len(numbers) == 2:
            return _TWO[name](numbers[0], numbers[1])
        if name == "BOUND" and len(numbers) == 3:
            return min(max(numbers[2], numbers[0]), numbers[1])
    except (ValueError, OverflowError):
        raise ControlAlarm(AlarmNumber.ARITHMETIC, f"{name}({numbers[0]:g}) is not defined") from None
    if name in FUNCTIONS:
        raise ControlAlarm(AlarmNumber.PARAMETERS, f"{name} has {len(numbers)} arguments; another count is expected")
    text = f"the function {name} is not known; a function such as SIN is expected"
    raise ControlAlarm(AlarmNumber.NAME_UNKNOWN, refusal_of(name) or text)
