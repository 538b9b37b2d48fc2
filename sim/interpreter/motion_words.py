"""Moves: from the axis words of a block and the modal state to canonical motions."""

from __future__ import annotations

import math
from dataclasses import dataclass

from planner.gcode import ModalGroup
from planner.gcode.codes import SPLINE_CODES
from sim.interpreter import canon, moves
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.canon import Vector
from sim.interpreter.compensation import Compensator, Side
from sim.interpreter.feeds import PathFeed
from sim.interpreter.frames import add, norm, scaled, subtract
from sim.interpreter.mapping import Mapping, mapping_of
from sim.interpreter.outlet import Outlet
from sim.interpreter.request import Coordinate, Request
from sim.interpreter.settings import G28, Settings
from sim.interpreter.spline_builders import AkimaBuilder, BSplineBuilder, CubicBuilder, SplineBuilder, SplinePoint
from sim.interpreter.state import INCH_MM, State
from sim.interpreter.tangents import extent, start_tangent


@dataclass(frozen=True, slots=True)
class Target:
    """Where a block goes: programmed start and end, canonical end, and the mapping between."""

    mapping: Mapping
    start: Vector
    end: Vector
    canonical: Vector


class Mover:
    """Turns requests for motion into canonical motions and keeps position and tangent of the state."""

    def __init__(self, settings: Settings, state: State, outlet: Outlet) -> None:
        self._settings, self._state, self._outlet = settings, state, outlet
        self._spline: SplineBuilder | None = None
        self._contour: Compensator | None = None

    @property
    def is_waiting(self) -> bool:
        """Whether a spline or a compensated contour has begun that has not ended."""
        return self._spline is not None or self._contour is not None

    def finish_spline(self, tangent: Vector | None) -> None:
        """The spline, if one runs, ends here; `tangent` is the direction of what follows, or None."""
        spline, self._spline = self._spline, None
        if spline is not None:
            spline.close(tangent)
            if spline.last is not None:
                self._state.last_motion = spline.last

    def finish(self) -> None:
        """Complete whatever waits for more blocks."""
        self.finish_spline(None)
        contour, self._contour = self._contour, None
        if contour is not None:
            contour.close()

    def move(self, request: Request) -> None:
        """Carry out the move a block asks for, if it asks for one."""
        state = self._state
        one_shot = request.code(ModalGroup.ONE_SHOT)
        code = request.code(ModalGroup.MOTION)
        if code is not None and code != state.motion:
            state.motion = code
            state.spline_degree = 3
            self._announced_degree(request)
        if one_shot is not None:
            self._special(one_shot, request)
        elif request.is_geometry:
            self._exact_stop(request)
            self._by_code(request)

    def _announced_degree(self, request: Request) -> None:
        """BSPLINE SD=2 in a block without points holds for the points that follow."""
        if request.is_geometry or "SD" not in request.numbers:
            return
        degree = request.take("SD")
        if self._state.motion != "BSPLINE" or degree not in (2.0, 3.0):
            raise ControlAlarm(AlarmNumber.SPLINE, f"SD={degree:g} is no degree here; BSPLINE takes 2 or 3")
        self._state.spline_degree = int(degree)

    def _by_code(self, request: Request) -> None:
        motion = self._state.motion
        target = self._target(request)
        if motion == "G0":
            self._rapid(target, request)
        elif motion in ("G2", "G3", "CIP", "CT"):
            self._arc(motion, target, request)
        elif motion == "POLY":
            self._polynomial(target, request)
        elif motion in SPLINE_CODES:
            self._spline_point(motion, target, request)
        else:
            self._straight(target, request)

    def _exact_stop(self, request: Request) -> None:
        if request.code(ModalGroup.EXACT_STOP_ONCE) is not None:
            self._outlet.put(canon.ExactStopOnce(request.block.line, request.block.number))

    def _target(self, request: Request) -> Target:
        """The end of a move; axis words and the ends of PO words count."""
        state = self._state
        is_suppressed = request.code(ModalGroup.SUPPRESSION) is not None
        mapping = mapping_of(state, self._settings, is_suppressed=is_suppressed)
        start = mapping.inverse_point(state.position_mm)
        factor = INCH_MM if state.is_inch else 1.0
        ends = dict(request.axes)
        for axis, values in request.polynomials.items():
            if axis is not None:
                ends[axis] = Coordinate(values[0], None, 0)
        programmed = {axis: _absolute(ends[axis], start[axis], factor, state) for axis in ends}
        request.axes.clear()
        end, canonical = mapping.moved_to(state.position_mm, programmed)
        return Target(mapping, start, end, canonical)

    def _feed(self, request: Request) -> PathFeed:
        state = self._state
        if state.feed is None:
            text = "a feed move without feed; F is expected in this block or before"
            raise ControlAlarm(AlarmNumber.NO_FEED, text, request.column_of(ModalGroup.MOTION))
        if state.feed_type == "G93":
            return PathFeed(state.feed, True)
        value = state.feed * (INCH_MM if state.is_feed_inch else 1.0)
        if state.feed_type == "G95":
            if not state.spindle_direction or state.spindle_rpm == 0.0:
                raise ControlAlarm(
                    AlarmNumber.NO_SPINDLE, "G95 feeds by turns of a spindle that stands; M3 is expected"
                )
            value *= state.spindle_rpm
        return PathFeed(value, False)

    def _group_length(self, by: Vector) -> float | None:
        axes = self._state.feed_axes
        return None if axes is None else math.sqrt(sum(by[axis] ** 2 for axis in axes))

    def _give(self, motion: canon.Motion) -> None:
        """One motion is decided: the spline before it ends on its tangent, limits hold, the state moves."""
        if self._spline is not None:
            self.finish_spline(start_tangent(motion))
        self._check_area(motion)
        self._beside_contour(motion)
        self._state.position_mm = motion.end
        self._state.last_motion = motion

    def _beside_contour(self, motion: canon.Motion) -> None:
        """Straight out, or by the compensated contour that G41 or G42 has begun."""
        state = self._state
        if state.compensation == "G40" and self._contour is None:
            self._outlet.put(motion)
            return
        if state.compensation == "G40":
            contour, self._contour = self._contour, None
            assert contour is not None
            contour.leave(motion, self._outlet.reserve())
            return
        side = self._side()
        if self._contour is None:
            self._contour = Compensator(side, state.position_mm)
        elif (self._contour.side.normal, self._contour.side.offset_mm) != (side.normal, side.offset_mm):
            text = "side, radius or plane change inside a compensated contour; G40 before is expected"
            raise ControlAlarm(AlarmNumber.COMPENSATION, text)
        self._contour.side = side
        self._contour.push(motion, self._outlet.reserve())

    def _side(self) -> Side:
        state = self._state
        tool = self._settings.tools.get(state.tool)
        if tool is None and state.edge:
            text = f"the radius of tool T{state.tool} is not known; a tool of the table is expected"
            raise ControlAlarm(AlarmNumber.COMPENSATION, text)
        radius = tool.radius_mm if tool is not None and state.edge else 0.0
        frame = state.frame
        normal = frame.direction(moves.unit_axis(state.plane_axes[2]))
        scale = norm(normal)
        sign = 1.0 if state.compensation == "G41" else -1.0
        return Side(scaled(normal, frame.handedness / scale), sign * radius, state.corner, state.feed_correction)

    def _check_area(self, motion: canon.Motion) -> None:
        state = self._state
        if not state.is_area_limited or state.area_min_mm == state.area_max_mm == (None, None, None):
            return
        low, high = extent(motion)
        for index, name in enumerate("XYZ"):
            lower, upper = state.area_min_mm[index], state.area_max_mm[index]
            if (lower is not None and low[index] < lower) or (upper is not None and high[index] > upper):
                text = f"the move leaves the working area in {name}; a move within G25 and G26 is expected"
                raise ControlAlarm(AlarmNumber.WORKING_AREA, text)

    def _rapid(self, target: Target, request: Request) -> None:
        state = self._state
        request.polynomials.clear()
        if target.canonical != state.position_mm:
            self._give(canon.Rapid(request.block.line, request.block.number, state.position_mm, target.canonical))

    def _straight(self, target: Target, request: Request) -> None:
        state = self._state
        request.polynomials.clear()
        start, end = state.position_mm, target.canonical
        feed = self._feed(request)
        if end != start:
            by = subtract(end, start)
            speed = feed.along(norm(by), self._group_length(by))
            self._give(canon.Line(request.block.line, request.block.number, start, end, speed))

    def _arc(self, code: str, target: Target, request: Request) -> None:
        feed = self._feed(request)
        end, shape = target.end, None
        if code == "CT":
            self.finish_spline(None)
            shape = moves.arc_tangent(
                target.start, end, self._programmed_tangent(target.mapping), self._state.plane_axes
            )
        elif code == "CIP":
            middle = self._middle(target, request)
            shape = moves.arc_through(target.start, middle, end)
        else:
            end, shape = self._circle(code == "G2", target, request)
        turns = request.take("TURN") or 0.0
        if not 0 <= turns <= 999 or turns != int(turns):
            raise ControlAlarm(AlarmNumber.CIRCLE, "TURN takes whole turns from 0 to 999")
        if shape is None:
            self._straight(target, request)
            return
        self._give_arc(shape, end, shape.sweep_rad + 2 * math.pi * turns, target.mapping, feed, request)

    def _give_arc(
        self, shape: moves.ArcShape, end: Vector, sweep_rad: float, mapping: Mapping, feed: PathFeed, request: Request
    ) -> None:
        frame = mapping.frame
        is_in_space = self._state.motion == "CIP"
        if frame.arc_scale((0, 1, 2) if is_in_space else self._state.plane_axes[:2]) is None:
            raise ControlAlarm(AlarmNumber.FRAME, "an arc under SCALE with different factors; equal ones are expected")
        start, canonical_end, centre = self._state.position_mm, mapping.point(end), mapping.point(shape.centre)
        across = frame.direction(shape.axis)
        axis = scaled(across, frame.handedness / norm(across))
        out = subtract(start, centre)
        rise = sum((b - a) * n for a, b, n in zip(start, canonical_end, axis, strict=True))
        along = sum(o * n for o, n in zip(out, axis, strict=True))
        radius = norm(subtract(out, scaled(axis, along)))
        speed = feed.along(moves.arc_length(radius, sweep_rad, rise))
        block = request.block
        self._give(canon.Arc(block.line, block.number, start, canonical_end, centre, axis, sweep_rad, speed))

    def _middle(self, target: Target, request: Request) -> Vector:
        if not request.middles:
            raise ControlAlarm(AlarmNumber.CIRCLE, "CIP lacks its middle point; I1=, J1=, K1= are expected")
        factor = INCH_MM if self._state.is_inch else 1.0
        values = list(target.start)
        for index, coordinate in request.middles.items():
            values[index] = _absolute(coordinate, target.start[index], factor, self._state)
        request.middles.clear()
        return (values[0], values[1], values[2])

    def _programmed_tangent(self, mapping: Mapping) -> Vector:
        tangent = self._state.tangent
        if tangent is None:
            raise ControlAlarm(AlarmNumber.CIRCLE, "CT follows no move; a line or an arc before it is expected")
        there = mapping.inverse_point(add(self._state.position_mm, tangent))
        return subtract(there, mapping.inverse_point(self._state.position_mm))

    def _circle(self, is_clockwise: bool, target: Target, request: Request) -> tuple[Vector, moves.ArcShape]:
        """End and shape of G2 or G3 by I J K, CR= or AR=."""
        plane, tolerance = self._state.plane_axes, self._settings.arc_tolerance_mm
        start, end = target.start, target.end
        factor = INCH_MM if self._state.is_inch else 1.0
        radius, angle_deg = request.take("CR"), request.take("AR")
        centre = self._centre(start, factor, request)
        if (radius is not None) + (angle_deg is not None) + (centre is not None) == 0:
            raise ControlAlarm(AlarmNumber.CIRCLE, "the arc has no centre; I, J, K, CR= or AR= is expected")
        if radius is not None and (centre is not None or angle_deg is not None):
            raise ControlAlarm(AlarmNumber.CIRCLE, "the arc has CR= beside another centre; one of them is expected")
        if radius is not None:
            centre = moves.centre_from_radius(start, end, radius * factor, plane, is_clockwise, tolerance)
        elif angle_deg is not None and centre is not None:
            angle = math.radians(angle_deg)
            if not 0 < angle_deg < 360 or any(abs(end[i] - start[i]) > moves.SAME_PLACE_MM for i in plane[:2]):
                text = "AR= with a centre takes an angle above 0 and below 360 and no end point"
                raise ControlAlarm(AlarmNumber.CIRCLE, text)
            turned = list(moves.turned_about(start, centre, -angle if is_clockwise else angle, plane))
            turned[plane[2]] = end[plane[2]]
            end = (turned[0], turned[1], turned[2])
        elif angle_deg is not None:
            centre = moves.centre_from_angle(start, end, math.radians(angle_deg), plane, is_clockwise)
        assert centre is not None
        return end, moves.arc_about(start, end, centre, plane, is_clockwise, tolerance)

    def _centre(self, start: Vector, factor: float, request: Request) -> Vector | None:
        """I, J, K count from the start unless AC says otherwise; those of the plane's axes only."""
        plane = self._state.plane_axes
        if not request.centres:
            return None
        values = list(start)
        for index in plane[:2]:
            coordinate = request.centres.pop(index, None)
            if coordinate is not None:
                base = 0.0 if coordinate.is_absolute else start[index]
                values[index] = base + coordinate.value * factor
        return (values[0], values[1], values[2])

    def _polynomial(self, target: Target, request: Request) -> None:
        length = request.take("PL")
        length = 1.0 if length is None else length
        if length <= 0:
            raise ControlAlarm(AlarmNumber.POLYNOMIAL, f"PL={length:g} is no interval; a value above 0 is expected")
        feed = self._feed(request)
        factor = INCH_MM if self._state.is_inch else 1.0
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
        self._give_polynomial(columns, denominator, length, target, feed, request)

    def _give_polynomial(
        self,
        columns: list[tuple[float, ...]],
        denominator: tuple[float, ...],
        length: float,
        target: Target,
        feed: PathFeed,
        request: Request,
    ) -> None:
        count = max(2, *(len(_trimmed(column)) for column in columns))
        mapping, start = target.mapping, self._state.position_mm
        vectors = []
        for power in range(count):
            x, y, z = (column[power] if power < len(column) else 0.0 for column in columns)
            moved = mapping.frame.direction((x, y, z))
            weight = denominator[power] if power < len(denominator) else 0.0
            vectors.append(add(moved, scaled(add(mapping.frame.shift, mapping.shift), weight)))
        vectors[0] = start
        coefficients = tuple(vectors)
        if all(vector == (0.0, 0.0, 0.0) for vector in coefficients[1:]) and len(denominator) == 1:
            return
        speed = (
            feed.along(moves.curve_length(coefficients, denominator, length)) if feed.is_inverse_time else feed.value
        )
        block = request.block
        self._give(
            canon.Polynomial(
                block.line, block.number, start, target.canonical, coefficients, denominator, length, speed
            )
        )

    def _spline_point(self, code: str, target: Target, request: Request) -> None:
        state, block = self._state, request.block
        if state.compensation != "G40" or self._contour is not None:
            raise ControlAlarm(
                AlarmNumber.COMPENSATION, "splines are not compensated; G40 with a straight move is expected"
            )
        feed = self._feed(request)
        request.polynomials.clear()
        if self._spline is not None and self._spline.code != code:
            self.finish_spline(None)
        if self._spline is None:
            self._spline = self._new_spline(code)
        self._spline_degree(self._spline, request)
        spline = self._spline
        interval, weight = request.take("PL"), request.take("PW")
        if code != "BSPLINE" and (interval is not None or weight is not None):
            raise ControlAlarm(AlarmNumber.SPLINE, f"{code} takes neither PL nor PW; BSPLINE does")
        weight = 1.0 if weight is None else weight
        slot = self._outlet.reserve()
        state.position_mm = target.canonical
        spline.add(SplinePoint(block.line, block.number, target.canonical, feed, interval, weight, slot))

    def _new_spline(self, code: str) -> SplineBuilder:
        state = self._state
        if code == "BSPLINE":
            return BSplineBuilder(state.position_mm, state.spline_degree, self._settings.knot_rule)
        builder = AkimaBuilder if code == "ASPLINE" else CubicBuilder
        return builder(state.position_mm, state.spline_start, state.spline_end, state.tangent)

    def _spline_degree(self, spline: SplineBuilder, request: Request) -> None:
        """SD before or in the first block of a B-spline; it cannot change inside."""
        degree = request.take("SD")
        if degree is None:
            return
        if degree not in (2.0, 3.0) or not isinstance(spline, BSplineBuilder):
            raise ControlAlarm(AlarmNumber.SPLINE, f"SD={degree:g} is no degree of {spline.code}; BSPLINE takes 2 or 3")
        if spline.degree != degree:
            if spline.has_points:
                raise ControlAlarm(
                    AlarmNumber.SPLINE, "SD changes inside a BSPLINE; another motion code first is expected"
                )
            self._spline = BSplineBuilder(self._state.position_mm, int(degree), self._settings.knot_rule)
            self._state.spline_degree = int(degree)

    def _special(self, code: str, request: Request) -> None:
        """G74, G75 and the ISO dialect's G28: rapids to places the machine knows."""
        if code == "G28":
            self._iso_reference(request)
            return
        axes = {**request.machine_axes, **request.axes}
        request.machine_axes.clear()
        request.axes.clear()
        if not axes:
            raise ControlAlarm(AlarmNumber.PARAMETERS, f"{code} names no axis; X1=0 is expected")
        place = self._settings.reference_point_mm
        if code == "G75":
            number = request.take("FP")
            number = 1.0 if number is None else number
            if number not in (1.0, 2.0, 3.0, 4.0):
                raise ControlAlarm(AlarmNumber.PARAMETERS, f"FP={number:g} is no fixed point; 1 to 4 is expected")
            place = self._settings.fixed_points_mm.get(int(number), place)
        self._to_machine_place(place, set(axes), request)

    def _iso_reference(self, request: Request) -> None:
        if self._settings.g28 is G28.ALARM:
            text = "G28 is a code of the ISO dialect; G74, G75 or SUPA is expected"
            raise ControlAlarm(AlarmNumber.UNKNOWN_G, text, request.column_of(ModalGroup.ONE_SHOT))
        axes = set(request.axes)
        if self._settings.g28 is G28.IGNORE:
            request.axes.clear()
            return
        self._rapid(self._target(request), request)
        self._to_machine_place(self._settings.reference_point_mm, axes, request)

    def _to_machine_place(self, place: Vector, axes: set[int], request: Request) -> None:
        mapping = mapping_of(self._state, self._settings, is_suppressed=True)
        end, canonical = mapping.moved_to(self._state.position_mm, {axis: place[axis] for axis in axes})
        self._rapid(Target(mapping, end, end, canonical), request)


def _absolute(coordinate: Coordinate, start: float, factor: float, state: State) -> float:
    is_absolute = coordinate.is_absolute
    if is_absolute is None:
        is_absolute = state.dimension == "G90"
    return coordinate.value * factor if is_absolute else start + coordinate.value * factor


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
