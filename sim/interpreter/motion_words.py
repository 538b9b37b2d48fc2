"""Moves: from the axis words of a block and the modal state to canonical motions."""

from __future__ import annotations

from dataclasses import dataclass, field

from planner.gcode import ModalGroup
from planner.gcode.codes import SPLINE_CODES
from sim.interpreter import canon
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.arc_words import arc_motion
from sim.interpreter.canon import Vector
from sim.interpreter.mapping import mapping_of
from sim.interpreter.outlet import Outlet
from sim.interpreter.path import Path
from sim.interpreter.polynomial_words import polynomial_motion
from sim.interpreter.request import Request
from sim.interpreter.settings import G28, Settings
from sim.interpreter.state import State
from sim.interpreter.targets import Target, path_feed, target_of


@dataclass(slots=True)
class Frames:
    """In which coordinates blocks have moved, those of subprograms too, until somebody clears it.

    `machine_axes` went to places of the machine's own; `offsets` were in force for the other moves.
    """

    machine_axes: set[int] = field(default_factory=set)
    offsets: set[str] = field(default_factory=set)

    def clear(self) -> None:
        """Nothing has moved yet."""
        self.machine_axes.clear()
        self.offsets.clear()


class Mover:
    """Turns requests for motion into canonical motions."""

    def __init__(self, settings: Settings, state: State, outlet: Outlet) -> None:
        self._settings, self._state, self._outlet = settings, state, outlet
        self.frames = Frames()
        self.path = Path(settings, state, outlet)

    def move(self, request: Request) -> None:
        """Carry out the move a block asks for, if it asks for one."""
        one_shot = request.code(ModalGroup.ONE_SHOT)
        self.set_motion(request)
        self._announced_degree(request)
        if one_shot is not None:
            self._special(one_shot, request)
        elif request.is_geometry:
            self._exact_stop(request)
            if request.code(ModalGroup.SUPPRESSION) is None:
                self.frames.offsets.add(self._state.work_offset)
            else:
                self.frames.machine_axes |= request.axes.keys() | {
                    axis for axis in request.polynomials if axis is not None
                }
            self._by_code(request)

    def set_motion(self, request: Request) -> None:
        """The motion code of a block holds from here on."""
        state = self._state
        code = request.code(ModalGroup.MOTION)
        if code is not None and code != state.motion:
            state.motion = code
            state.spline_degree = 3

    def _announced_degree(self, request: Request) -> None:
        """SD=2 in a block without points holds for the points that follow."""
        if request.is_geometry or "SD" not in request.numbers:
            return
        degree = request.take("SD")
        if self._state.motion != "BSPLINE" or degree not in (2.0, 3.0):
            raise ControlAlarm(AlarmNumber.SPLINE, f"SD={degree:g} is no degree here; BSPLINE takes 2 or 3")
        if self.path.is_waiting and degree != self._state.spline_degree:
            raise ControlAlarm(AlarmNumber.SPLINE, "SD changes inside a BSPLINE; another motion code first is expected")
        self._state.spline_degree = int(degree)

    def _by_code(self, request: Request) -> None:
        state = self._state
        motion = state.motion
        target = target_of(request, state, self._settings)
        if motion == "G0":
            self._rapid(target, request)
        elif motion in ("G2", "G3", "CIP", "CT"):
            self._arc(motion, target, request)
        elif motion == "POLY":
            curve = polynomial_motion(target, request, state, self._settings)
            if curve is not None:
                self.path.give(curve)
        elif motion in SPLINE_CODES:
            request.polynomials.clear()
            self.path.spline_point(motion, target.canonical, request)
        else:
            self._straight(target, request)

    def _arc(self, code: str, target: Target, request: Request) -> None:
        if code == "CT":
            self.path.finish_spline(None)
        arc = arc_motion(code, target, request, self._state, self._settings)
        if arc is None:
            self._straight(target, request)
        else:
            self.path.give(arc)

    def _exact_stop(self, request: Request) -> None:
        if request.code(ModalGroup.EXACT_STOP_ONCE) is not None:
            self._outlet.put(canon.ExactStopOnce(request.block.line, request.block.number))

    def _rapid(self, target: Target, request: Request, *, is_machine: bool = False) -> None:
        state, block = self._state, request.block
        request.polynomials.clear()
        if target.canonical != state.position_mm:
            is_machine = is_machine or request.code(ModalGroup.SUPPRESSION) is not None
            self.path.give(canon.Rapid(block.line, block.number, state.position_mm, target.canonical, is_machine))

    def _straight(self, target: Target, request: Request) -> None:
        state = self._state
        request.polynomials.clear()
        start, end = state.position_mm, target.canonical
        feed = path_feed(request, state, self._settings)
        if end != start:
            speed = feed.along((start, end))
            self.path.give(canon.Line(request.block.line, request.block.number, start, end, speed))

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
        self._rapid(target_of(request, self._state, self._settings), request)
        self._to_machine_place(self._settings.reference_point_mm, axes, request)

    def _to_machine_place(self, place: Vector, axes: set[int], request: Request) -> None:
        mapping = mapping_of(self._state, self._settings, is_suppressed=True)
        end, canonical = mapping.moved_to(self._state.position_mm, {axis: place[axis] for axis in axes})
        self.frames.machine_axes |= axes
        self._rapid(Target(mapping, end, end, canonical), request, is_machine=True)
