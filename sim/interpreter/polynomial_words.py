"""POLY: polynomials from the PO and PL words of a block to canonical polynomials."""

from __future__ import annotations

from sim.interpreter import canon, moves
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.canon import Vector
from sim.interpreter.frames import add, scaled
from sim.interpreter.request import Request
from sim.interpreter.settings import Settings
from sim.interpreter.state import INCH_MM, State
from sim.interpreter.targets import Target, path_feed


def polynomial_motion(target: Target, request: Request, state: State, settings: Settings) -> canon.Polynomial | None:
    """The polynomial a block asks for; None where it stays in its start."""
    degree = max((len(values) for values in request.polynomials.values()), default=1)
    if degree > settings.poly_degree:
        text = f"the polynomial has degree {degree}; this control reads degree {settings.poly_degree} at most"
        raise ControlAlarm(AlarmNumber.POLYNOMIAL, text)
    length = request.take("PL")
    length = 1.0 if length is None else length
    if length <= 0:
        raise ControlAlarm(AlarmNumber.POLYNOMIAL, f"PL={length:g} is no interval; a value above 0 is expected")
    feed = path_feed(request, state, settings)
    factor = INCH_MM if state.is_inch else 1.0
    denominator = _denominator(request.polynomials.pop(None, None), length)
    weight = sum(term * length**power for power, term in enumerate(denominator))
    columns = []
    for axis in range(3):
        values = request.polynomials.get(axis)
        start, end = target.start[axis], target.end[axis]
        if values is None:
            columns.append(_multiplied(moves.polynomial(start, (), end, length), denominator))
        else:
            higher = tuple(value * factor for value in values[1:])
            columns.append(moves.polynomial(start, higher, end * weight, length))
    request.polynomials.clear()
    coefficients = _mapped(columns, denominator, target, state)
    if all(vector == (0.0, 0.0, 0.0) for vector in coefficients[1:]) and len(denominator) == 1:
        return None
    speed = feed.value
    if feed.depends_on_path:
        speed = feed.along(moves.curve_points(coefficients, denominator, length))
    line, block = request.block.line, request.block.number
    return canon.Polynomial(line, block, state.position_mm, target.canonical, coefficients, denominator, length, speed)


def _mapped(
    columns: list[tuple[float, ...]], denominator: tuple[float, ...], target: Target, state: State
) -> tuple[Vector, ...]:
    """Canonical coefficients: the linear part of the frame on all, its shift times the denominator."""
    count = max(2, *(len(_trimmed(column)) for column in columns))
    mapping = target.mapping
    vectors = [state.position_mm]
    for power in range(1, count):
        x, y, z = (column[power] if power < len(column) else 0.0 for column in columns)
        weight = denominator[power] if power < len(denominator) else 0.0
        vectors.append(add(mapping.frame.direction((x, y, z)), scaled(mapping.total_shift, weight)))
    return tuple(vectors)


def _denominator(values: tuple[float, ...] | None, length: float) -> tuple[float, ...]:
    if values is None:
        return (1.0,)
    terms = moves.polynomial(1.0, values[1:], values[0], length)
    if moves.smallest_on(terms, length) <= 0.0:
        raise ControlAlarm(AlarmNumber.POLYNOMIAL, "the denominator PO[] reaches 0; values above 0 are expected")
    return terms


def _multiplied(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, ...]:
    if len(b) == 1:
        return a
    terms = [0.0] * (len(a) + len(b) - 1)
    for i, left in enumerate(a):
        for j, right in enumerate(b):
            terms[i + j] += left * right
    return tuple(terms)


def _trimmed(terms: tuple[float, ...]) -> tuple[float, ...]:
    count = len(terms)
    while count > 1 and terms[count - 1] == 0.0:
        count -= 1
    return terms[:count]
