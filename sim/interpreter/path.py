"""The path as it leaves the interpreter: splines end on it, compensation runs beside it, the working area bounds it."""

from __future__ import annotations

from sim.interpreter import canon, moves
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.bspline_builder import BSplineBuilder
from sim.interpreter.canon import Vector
from sim.interpreter.compensation import Compensator, Side
from sim.interpreter.frames import norm, scaled
from sim.interpreter.outlet import Outlet
from sim.interpreter.request import Request
from sim.interpreter.settings import Settings, Tool
from sim.interpreter.spline_builders import AkimaBuilder, CubicBuilder, SplineBuilder, SplinePoint
from sim.interpreter.state import State
from sim.interpreter.tangents import extent, start_tangent
from sim.interpreter.targets import path_feed
from sim.interpreter.travel import check_travel


class Path:
    """Takes motions and spline points in order and keeps position and last motion of the state."""

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

    def give(self, motion: canon.Motion) -> None:
        """One motion is decided: the spline before it ends on its tangent, limits hold, the state moves."""
        if self._spline is not None:
            self.finish_spline(start_tangent(motion))
        self._check_area(motion)
        self._beside_contour(motion)
        self._state.position_mm = motion.end
        self._state.last_motion = motion

    def spline_point(self, code: str, place: Vector, request: Request) -> None:
        """A point of ASPLINE, BSPLINE or CSPLINE at this canonical place."""
        state, block = self._state, request.block
        if state.compensation != "G40" or self._contour is not None:
            raise ControlAlarm(
                AlarmNumber.COMPENSATION, "splines are not compensated; G40 with a straight move is expected"
            )
        feed = path_feed(request, state, self._settings)
        request.polynomials.clear()
        if self._spline is not None and self._spline.code != code:
            self.finish_spline(None)
        spline = self._spline or self._new_spline(code)
        spline = self._of_degree(spline, request)
        spline.check = self._check_area
        self._spline = spline
        interval, weight = request.take("PL"), request.take("PW")
        if code != "BSPLINE" and (interval is not None or weight is not None):
            raise ControlAlarm(AlarmNumber.SPLINE, f"{code} takes neither PL nor PW; BSPLINE does")
        weight = 1.0 if weight is None else weight
        slot = self._outlet.reserve()
        state.position_mm = place
        spline.add(SplinePoint(block.line, block.number, place, feed, interval, weight, state.spline_end, slot))

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
        tool = None if state.tool_name else self._settings.tools.get(state.tool)
        if tool is None and self._settings.unknown_radius_mm is not None:
            tool = Tool(self._settings.unknown_radius_mm)
        if tool is None and state.edge:
            text = f"the radius of tool T{state.tool} is not known; name the job with --job (the mill: --nominal)"
            if state.tool_name:
                text = f'the radius of tool "{state.tool_name}" is not known; a job names its tools by number'
            raise ControlAlarm(AlarmNumber.COMPENSATION, text)
        radius = tool.radius_mm if tool is not None and state.edge else 0.0
        frame = state.frame
        normal = frame.direction(moves.unit_axis(state.plane_axes[2]))
        scale = norm(normal)
        sign = 1.0 if state.compensation == "G41" else -1.0
        return Side(
            scaled(normal, frame.handedness / scale),
            sign * radius,
            state.corner,
            state.feed_correction,
            self._settings.same_place_mm,
        )

    def _check_area(self, motion: canon.Motion) -> None:
        state = self._state
        check_travel(motion, state, self._settings)
        if not state.is_area_limited or state.area_min_mm == state.area_max_mm == (None, None, None):
            return
        low, high = extent(motion)
        for index, name in enumerate("XYZ"):
            lower, upper = state.area_min_mm[index], state.area_max_mm[index]
            if (lower is not None and low[index] < lower) or (upper is not None and high[index] > upper):
                text = f"the move leaves the working area in {name}; a move within G25 and G26 is expected"
                raise ControlAlarm(AlarmNumber.WORKING_AREA, text)

    def _new_spline(self, code: str) -> SplineBuilder:
        state = self._state
        if code == "BSPLINE":
            return BSplineBuilder(state.position_mm, state.spline_degree, self._settings.knot_rule)
        builder = AkimaBuilder if code == "ASPLINE" else CubicBuilder
        return builder(state.position_mm, state.spline_start, state.tangent, self._settings.same_place_mm)

    def _of_degree(self, spline: SplineBuilder, request: Request) -> SplineBuilder:
        """SD before or in the first block of a B-spline; it cannot change inside."""
        degree = request.take("SD")
        if degree is None:
            return spline
        if degree not in (2.0, 3.0) or not isinstance(spline, BSplineBuilder):
            raise ControlAlarm(AlarmNumber.SPLINE, f"SD={degree:g} is no degree of {spline.code}; BSPLINE takes 2 or 3")
        if spline.degree != degree:
            if spline.has_points:
                raise ControlAlarm(
                    AlarmNumber.SPLINE, "SD changes inside a BSPLINE; another motion code first is expected"
                )
            self._state.spline_degree = int(degree)
            return self._new_spline("BSPLINE")
        return spline
