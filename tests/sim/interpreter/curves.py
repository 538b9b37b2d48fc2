"""What the tests of splines ask the interpreter for: the spans of a program, points on them, the alarm that ends it."""

from __future__ import annotations

import numpy as np

from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import Settings

ORIGIN = (0.0, 0.0, 0.0)


def spans_of(text: str, settings: Settings | None = None) -> list[canon.Polynomial]:
    found = list(interpret(text.encode(), settings or Settings(start_mm=ORIGIN)))
    assert not any(isinstance(command, canon.Alarm) for command in found), found[-1]
    return [command for command in found if isinstance(command, canon.Polynomial)]


def alarm_of(text: str, settings: Settings | None = None) -> str:
    found = list(interpret(text.encode(), settings or Settings(start_mm=ORIGIN)))[-1]
    assert isinstance(found, canon.Alarm)
    return found.text


def at(span: canon.Polynomial, p: float) -> np.ndarray:
    weight = sum(d * p**k for k, d in enumerate(span.denominator))
    return np.array([sum(c[axis] * p**k for k, c in enumerate(span.coefficients)) for axis in range(3)]) / weight


def worst(spans: list[canon.Polynomial], curve, start: float = 0.0) -> float:
    """Largest distance from a curve of the same parameter."""
    far, knot = 0.0, start
    for span in spans:
        for share in np.linspace(0, 1, 9):
            far = max(far, float(np.abs(at(span, share * span.length) - curve(knot + share * span.length)).max()))
        knot += span.length
    return far


def run_all(text: str) -> list[canon.Command]:
    return list(interpret(text.encode(), Settings(start_mm=(0.0, 0.0, 0.0))))
