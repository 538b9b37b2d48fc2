"""BSPLINE as it grows: control points and knots block by block."""

from __future__ import annotations

from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.canon import Vector
from sim.interpreter.settings import KnotRule
from sim.interpreter.spline_builders import SplineBuilder, SplinePoint
from sim.interpreter.splines import bspline_span


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
            raise self._refusal(text)
        if not self._is_automatic:
            top = self._knots[-1]
            self._knots += [top] * (count + degree + 1 - (self._first + len(self._knots)))
            if self._knot(count) != top:
                text = "the BSPLINE does not end in its last point; PL=0 is expected in its last block"
                raise self._refusal(text)
            if self._knot(count - 1) == top:
                text = (
                    "PL=0 stands too often at the end: the BSPLINE would end before its last point; fewer are expected"
                )
                raise self._refusal(text)
        self._emit(count - 1, is_last=True)

    def _refusal(self, text: str) -> ControlAlarm:
        """An alarm at the last point's block."""
        last = self._points[-1]
        line, block = (None, None) if last is None else (last.line, last.block)
        return ControlAlarm(AlarmNumber.SPLINE, text, line=line, block=block)

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
