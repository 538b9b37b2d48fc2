"""Splines as they grow: points come block by block, spans go out as soon as later points cannot change them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from sim.interpreter import canon
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.canon import Vector
from sim.interpreter.feeds import SHORTEST_MM, PathFeed
from sim.interpreter.frames import norm, scaled, subtract
from sim.interpreter.moves import curve_length
from sim.interpreter.outlet import Slot
from sim.interpreter.settings import KnotRule
from sim.interpreter.splines import Curve, akima_tangent, bspline_span, c2_tangents, hermite_span, mirrored

# A change of one point reaches the derivatives of a C2 cubic by a factor of at most 1/2 a point, so beyond this many
# points it is below the rounding of a double.
_C2_REACH = 64


@dataclass(frozen=True, slots=True)
class SplinePoint:
    """One programmed point: its block, canonical place, feed, PL and PW, and its place in the order of commands."""

    line: int
    block: int | None
    place: Vector
    feed: PathFeed
    interval: float | None
    weight: float
    slot: Slot


class SplineBuilder(ABC):
    """A spline that has begun at `start`; `last` is its last complete span."""

    def __init__(self, code: str, start: Vector) -> None:
        self.code = code
        self.last: canon.Polynomial | None = None
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
        feed = point.feed
        speed = feed.value
        if feed.is_inverse_time:
            speed = feed.along(curve_length(coefficients, curve.denominator, curve.length))
        self.last = canon.Polynomial(
            point.line, point.block, start, curve.end, coefficients, curve.denominator, curve.length, speed
        )
        point.slot.commands = [self.last]


class BSplineBuilder(SplineBuilder):
    """BSPLINE: control points with weights, knots from PL words by the rule of the settings, or uniform without PL."""

    def __init__(self, start: Vector, degree: int, rule: KnotRule) -> None:
        super().__init__("BSPLINE", start)
        self.degree = degree
        self._rule = rule
        lead = 3 if rule is KnotRule.NX else degree + 1
        self._knots = [0.0] * lead
        self._points: list[SplinePoint | None] = [None]
        self._spans_done = degree
        self._first = 0
        self._is_automatic = True

    @property
    def has_points(self) -> bool:
        """Whether a point beyond the start has come."""
        return self._count > 1

    @property
    def _count(self) -> int:
        return self._first + len(self._points)

    def add(self, point: SplinePoint) -> None:
        """A control point; raises ControlAlarm for weights and intervals the control does not take."""
        self._check(point)
        if self._rule is KnotRule.GENUA and not self.has_points and point.place == self._start:
            point.slot.commands = []
            return
        if not self.has_points:
            self._is_automatic = point.interval is None
        self._points.append(point)
        if self._count <= self.degree:
            point.slot.commands = []
        if point.interval is not None:
            self._knots.append(self._knots[-1] + point.interval)
            self._check_ends_meet()
            known = self._count + 2 if self._rule is KnotRule.NX else self._count + self.degree
            self._emit(known - self.degree - 1)
        else:
            self._emit(self._count - 1 - self.degree)

    def close(self, tangent: Vector | None) -> None:
        """The curve ends in its last control point, along the last leg of the polygon."""
        del tangent
        count, degree = self._count, self.degree
        if count <= degree:
            text = f"the BSPLINE has {count} points with its start; at least {degree + 1} are expected"
            raise ControlAlarm(AlarmNumber.SPLINE, text)
        if not self._is_automatic:
            top = self._knots[-1]
            self._knots += [top] * (count + degree + 1 - (self._first + len(self._knots)))
            if self._knot(count) != top:
                text = "the BSPLINE does not end in its last point; PL=0 is expected in its last block"
                raise ControlAlarm(AlarmNumber.SPLINE, text)
        self._emit(count - 1, is_last=True)

    def _check(self, point: SplinePoint) -> None:
        if not 0.0 < point.weight <= 3.0:
            raise ControlAlarm(AlarmNumber.SPLINE, f"PW={point.weight:g} is no weight; above 0 and up to 3 is expected")
        if point.interval is not None and point.interval < 0.0:
            raise ControlAlarm(AlarmNumber.SPLINE, f"PL={point.interval:g} is negative; 0 or more is expected")
        if self.has_points and self._is_automatic != (point.interval is None):
            raise ControlAlarm(
                AlarmNumber.SPLINE, "PL stands in some blocks of the BSPLINE only; in all or none is expected"
            )

    def _check_ends_meet(self) -> None:
        """The curve must start in the start, and a knot may repeat `degree` times inside before it breaks."""
        degree = self.degree
        newest = self._first + len(self._knots) - 1
        if newest == degree and self._knots[-1] != self._knots[0]:
            text = "the BSPLINE does not start where the axes stand; PL=0 is expected in its first block"
            raise ControlAlarm(AlarmNumber.SPLINE, text)
        if newest > degree and self._knot(newest - degree) == self._knots[-1]:
            text = f"PL=0 stands too often: the BSPLINE would break; at most {degree - 1} in a row inside are expected"
            raise ControlAlarm(AlarmNumber.SPLINE, text)

    def _knot(self, index: int) -> float:
        if self._is_automatic:
            return float(min(max(index - self.degree, 0), self._count - self.degree))
        return self._knots[index - self._first]

    def _emit(self, last_span: int, *, is_last: bool = False) -> None:
        degree = self.degree
        while self._spans_done <= last_span:
            j = self._spans_done
            point = self._points[j - self._first]
            assert point is not None
            curve = None
            knots = [self._knot(index) for index in range(j - degree + 1, j + degree + 1)]
            if knots[degree] > knots[degree - 1]:
                places = [self._place(index) for index in range(j - degree, j + 1)]
                weights = [self._weight(index) for index in range(j - degree, j + 1)]
                curve = bspline_span(places, weights, knots)
            self._give(curve, point)
            self._spans_done += 1
        if not is_last:
            self._forget(self._spans_done - degree)

    def _forget(self, before: int) -> None:
        drop = before - self._first
        if drop > 256:
            del self._points[:drop]
            if not self._is_automatic:
                del self._knots[:drop]
            self._first = before

    def _place(self, index: int) -> Vector:
        point = self._points[index - self._first]
        return self._start if point is None else point.place

    def _weight(self, index: int) -> float:
        point = self._points[index - self._first]
        return 1.0 if point is None else point.weight


class ThroughPointsBuilder(SplineBuilder):
    """What ASPLINE and CSPLINE share: points joined by cubics whose parameter is the chord length."""

    def __init__(
        self, code: str, start: Vector, start_condition: str, end_condition: str, tangent: Vector | None
    ) -> None:
        super().__init__(code, start)
        self.start_condition: Vector | str = _condition(start_condition[1:], tangent)
        self.end_code = end_condition
        self._places = [start]
        self._points: list[SplinePoint] = []
        self._slopes: list[Vector] = []
        self._chords: list[float] = []

    def add(self, point: SplinePoint) -> None:
        """A point to pass through; one that repeats the last is passed over."""
        by = subtract(point.place, self._places[-1])
        chord = norm(by)
        if chord < SHORTEST_MM:
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

    def __init__(self, start: Vector, start_condition: str, end_condition: str, tangent: Vector | None) -> None:
        super().__init__("ASPLINE", start, start_condition, end_condition, tangent)
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
        condition = _condition(self.end_code[1:], tangent)
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

    def __init__(self, start: Vector, start_condition: str, end_condition: str, tangent: Vector | None) -> None:
        super().__init__("CSPLINE", start, start_condition, end_condition, tangent)

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
        condition = _condition(self.end_code[1:], tangent)
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
