"""Splines as they grow: points come block by block, spans go out as soon as later points cannot change them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

from sim.interpreter import canon
from sim.interpreter.canon import Vector
from sim.interpreter.feeds import PathFeed
from sim.interpreter.frames import norm, scaled, subtract
from sim.interpreter.moves import curve_points
from sim.interpreter.outlet import Slot
from sim.interpreter.splines import Curve, akima_tangent, c2_tangents, hermite_span, mirrored

# A change of one point reaches the derivatives of a C2 cubic by a factor of at most 1/2 a point, so beyond this many
# points it is below the rounding of a double.
_C2_REACH = 64


@dataclass(frozen=True, slots=True)
class SplinePoint:
    """One programmed point: its block, canonical place, feed, PL and PW, the end condition in force, and its slot."""

    line: int
    block: int | None
    place: Vector
    feed: PathFeed
    interval: float | None
    weight: float
    end_code: str
    slot: Slot


class SplineBuilder(ABC):
    """A spline that has begun at `start`; `last` is its last complete span. `check` may refuse a span."""

    def __init__(self, code: str, start: Vector) -> None:
        self.code = code
        self.last: canon.Polynomial | None = None
        self.check: Callable[[canon.Motion], None] | None = None
        self._start = start

    @abstractmethod
    def add(self, point: SplinePoint) -> None:
        """The next programmed point; spans that it decides fill their slots."""

    @abstractmethod
    def close(self, tangent: Vector | None) -> None:
        """No more points; `tangent` is the direction of the move that follows. All slots are filled after this."""

    def _give(self, curve: Curve | None, point: SplinePoint) -> None:
        """Fill the point's slot with its span; None where the span has no length."""
        if curve is None:
            point.slot.commands = []
            return
        start = self._start if self.last is None else self.last.end
        coefficients = (start, *curve.coefficients[1:])
        speed = point.feed.value
        if point.feed.depends_on_path:
            speed = point.feed.along(curve_points(coefficients, curve.denominator, curve.length))
        self.last = canon.Polynomial(
            point.line, point.block, start, curve.end, coefficients, curve.denominator, curve.length, speed
        )
        if self.check is not None:
            self.check(self.last)
        point.slot.commands = [self.last]


class ThroughPointsBuilder(SplineBuilder):
    """What ASPLINE and CSPLINE share: points joined by cubics whose parameter is the chord length."""

    def __init__(
        self, code: str, start: Vector, start_condition: str, tangent: Vector | None, same_place_mm: float
    ) -> None:
        super().__init__(code, start)
        self._same_place_mm = same_place_mm
        self.start_condition: Vector | str = _condition(start_condition[1:], tangent)
        self._places = [start]
        self._points: list[SplinePoint] = []
        self._slopes: list[Vector] = []
        self._chords: list[float] = []

    def add(self, point: SplinePoint) -> None:
        """A point to pass through; one that repeats the last is passed over."""
        by = subtract(point.place, self._places[-1])
        chord = norm(by)
        if chord < self._same_place_mm:
            point.slot.commands = []
            return
        self._places.append(point.place)
        self._points.append(point)
        self._chords.append(chord)
        self._slopes.append(scaled(by, 1.0 / chord))
        self._grow()

    @abstractmethod
    def _grow(self) -> None:
        """Give the spans that a new point decides."""

    def _span(self, index: int, leaving: Vector, arriving: Vector) -> None:
        curve = hermite_span(self._places[index], self._places[index + 1], leaving, arriving, self._chords[index])
        self._give(curve, self._points[index])

    def _drop(self, count: int) -> None:
        for values in (self._places, self._points, self._slopes, self._chords):
            del values[:count]


class AkimaBuilder(ThroughPointsBuilder):
    """ASPLINE: the derivative at a point depends on two points on either side."""

    def __init__(self, start: Vector, start_condition: str, tangent: Vector | None, same_place_mm: float) -> None:
        super().__init__("ASPLINE", start, start_condition, tangent, same_place_mm)
        self._before: tuple[Vector, Vector] | None = None
        self._leaving: Vector | None = None

    def _grow(self) -> None:
        """With slopes 0, 1, 2 known, span 0 is decided."""
        if len(self._slopes) < 3:
            return
        if self._before is None:
            self._begin()
        self._next(self._slopes[1], self._slopes[2])

    def _begin(self) -> None:
        first, second = self._slopes[0], self._slopes[1] if len(self._slopes) > 1 else self._slopes[0]
        ghost = mirrored(first, second)
        self._before = (mirrored(ghost, first), ghost)

    def _next(self, right: Vector, after: Vector) -> None:
        """Give span 0; `right` and `after` are the two slopes behind it."""
        assert self._before is not None
        before, left, slope = self._before[0], self._before[1], self._slopes[0]
        arriving = akima_tangent(left, slope, right, after)
        leaving = self._leaving
        if leaving is None:
            leaving = self._first_tangent(akima_tangent(before, left, slope, right), slope, arriving)
        self._span(0, leaving, arriving)
        self._leaving, self._before = arriving, (left, slope)
        self._drop(1)

    def _first_tangent(self, free: Vector, slope: Vector, arriving: Vector) -> Vector:
        if not isinstance(self.start_condition, str):
            return self.start_condition
        return _natural(slope, arriving) if self.start_condition == "NAT" else free

    def close(self, tangent: Vector | None) -> None:
        """The last spans, with slopes mirrored beyond the end."""
        if not self._slopes:
            return
        if self._before is None:
            self._begin()
        slopes = self._slopes
        behind = slopes[-2] if len(slopes) > 1 else (self._before or (slopes[0], slopes[0]))[1]
        ghost = mirrored(slopes[-1], behind)
        beyond = [*slopes[1:], ghost, mirrored(ghost, slopes[-1])]
        condition = _condition(self._points[-1].end_code[1:], tangent)
        while len(self._slopes) > 1:
            self._next(beyond[0], beyond[1])
            beyond.pop(0)
        self._finish(beyond[0], beyond[1], condition)

    def _finish(self, right: Vector, after: Vector, condition: Vector | str) -> None:
        assert self._before is not None
        before, left, slope = self._before[0], self._before[1], self._slopes[0]
        arriving = akima_tangent(left, slope, right, after) if isinstance(condition, str) else condition
        leaving = self._leaving
        if leaving is None:
            leaving = self._first_tangent(akima_tangent(before, left, slope, right), slope, arriving)
        if condition == "NAT":
            arriving = _natural(slope, leaving)
        self._span(0, leaving, arriving)
        self._drop(1)


class CubicBuilder(ThroughPointsBuilder):
    """CSPLINE: the C2 cubic; solved over a window long enough that what lies beyond it does not count."""

    def __init__(self, start: Vector, start_condition: str, tangent: Vector | None, same_place_mm: float) -> None:
        super().__init__("CSPLINE", start, start_condition, tangent, same_place_mm)

    def _grow(self) -> None:
        if len(self._slopes) < 3 * _C2_REACH:
            return
        tangents = c2_tangents(self._slopes, self._chords, self.start_condition, "NAT")
        for index in range(_C2_REACH):
            self._span(index, tangents[index], tangents[index + 1])
        self.start_condition = tangents[_C2_REACH]
        self._drop(_C2_REACH)

    def close(self, tangent: Vector | None) -> None:
        """Solve what is left with the end condition."""
        if not self._slopes:
            return
        condition = _condition(self._points[-1].end_code[1:], tangent)
        tangents = c2_tangents(self._slopes, self._chords, self.start_condition, condition)
        for index in range(len(self._slopes)):
            self._span(index, tangents[index], tangents[index + 1])
        self._drop(len(self._slopes))


def _condition(code: str, tangent: Vector | None) -> Vector | str:
    """TAN with a neighbouring move gives its direction; without one the end is natural."""
    if code == "TAN":
        return "NAT" if tangent is None else tangent
    return code


def _natural(slope: Vector, other: Vector) -> Vector:
    """The derivative at an end without curvature, from the span's mean slope and the derivative at its other end."""
    return scaled(subtract(scaled(slope, 3.0), other), 0.5)
