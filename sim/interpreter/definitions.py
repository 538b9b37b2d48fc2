"""DEF and PROC: variables come into being, arguments become parameters."""

from __future__ import annotations

import math

from planner.gcode import Expression, Name
from planner.gcode.statement import Define, Procedure, Variable
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.request import AXES, CENTRES, MACHINE_AXES, MIDDLES, NUMBERS
from sim.interpreter.values import Cell, Value, Variables, as_integer, converted, evaluate

_TAKEN = frozenset({*AXES, *CENTRES, *MIDDLES, *MACHINE_AXES, *NUMBERS, "G", "M", "N", "R", "H"})


def define(statement: Define, variables: Variables, max_elements: int) -> None:
    """DEF: each name gets its values, 0 or empty where none is given."""
    scope = variables.scopes[-1] if variables.scopes else variables.globals
    for variable in statement.variables:
        if variable.name in _TAKEN or (variable.name[0] == "R" and variable.name[1:].isdigit()):
            raise ControlAlarm(AlarmNumber.DEFINED_TWICE, f"{variable.name} is an address; another name is expected")
        scope[variable.name] = _cell(variable, variables, max_elements)


def _cell(variable: Variable, variables: Variables, max_elements: int) -> Cell:
    dimensions = tuple(as_integer(evaluate(size, variables)) for size in variable.dimensions)
    count = math.prod(dimensions)
    if any(size < 1 for size in dimensions) or count > max_elements:
        text = f"the array {variable.name} has {count} elements; 1 to {max_elements} are expected"
        raise ControlAlarm(AlarmNumber.INDEX, text)
    empty: Value = "" if variable.type_name in ("STRING", "AXIS") else 0.0
    values: list[Value] = [empty] * count
    given = variable.initial_list if variable.initial_list is not None else (variable.initial,)
    if len(given) > count:
        raise ControlAlarm(AlarmNumber.INDEX, f"{variable.name} is given {len(given)} values; {count} are expected")
    for place, value in enumerate(given):
        if value is not None:
            values[place] = converted(evaluate(value, variables), variable.type_name)
    return Cell(variable.type_name, values, dimensions)


def bind(
    procedure: Procedure, given: tuple[Expression | None, ...], values: list[Value | None], variables: Variables
) -> dict[str, Name]:
    """PROC: parameters of the innermost scope from the call's values; returns what goes back to VAR parameters."""
    if len(values) > len(procedure.parameters):
        text = f"{procedure.name} takes {len(procedure.parameters)} arguments, not {len(values)}"
        raise ControlAlarm(AlarmNumber.PARAMETERS, text)
    scope = variables.scopes[-1]
    back: dict[str, Name] = {}
    for place, parameter in enumerate(procedure.parameters):
        value = values[place] if place < len(values) else None
        if value is None:
            value = evaluate(parameter.initial, variables) if parameter.initial is not None else None
        if value is None:
            value = "" if parameter.type_name in ("STRING", "AXIS") else 0.0
        scope[parameter.name] = Cell(parameter.type_name, [converted(value, parameter.type_name)])
        expression = given[place] if place < len(given) else None
        if parameter.is_reference and expression is not None:
            if not isinstance(expression, Name):
                text = f"{parameter.name} of {procedure.name} is a VAR argument; the name of a variable is expected"
                raise ControlAlarm(AlarmNumber.PARAMETERS, text)
            back[parameter.name] = expression
    return back
