"""Where a block goes and how fast: programmed ends, their canonical places, and the feed in force."""

from __future__ import annotations

from dataclasses import dataclass

from planner.gcode import ModalGroup
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.canon import Vector
from sim.interpreter.feeds import PathFeed
from sim.interpreter.mapping import Mapping, mapping_of
from sim.interpreter.request import Coordinate, Request
from sim.interpreter.settings import Settings
from sim.interpreter.state import INCH_MM, State


@dataclass(frozen=True, slots=True)
class Target:
    """Where a block goes: programmed start and end, canonical end, and the mapping between."""

    mapping: Mapping
    start: Vector
    end: Vector
    canonical: Vector


def target_of(request: Request, state: State, settings: Settings) -> Target:
    """The end of a move; axis words and the ends of PO words count."""
    is_suppressed = request.code(ModalGroup.SUPPRESSION) is not None
    mapping = mapping_of(state, settings, is_suppressed=is_suppressed)
    start = mapping.inverse_point(state.position_mm)
    factor = INCH_MM if state.is_inch else 1.0
    ends = dict(request.axes)
    for axis, values in request.polynomials.items():
        if axis is not None:
            ends[axis] = Coordinate(values[0], None, 0)
    programmed = {axis: absolute(ends[axis], start[axis], factor, state) for axis in ends}
    request.axes.clear()
    end, canonical = mapping.moved_to(state.position_mm, programmed)
    return Target(mapping, start, end, canonical)


def path_feed(request: Request, state: State, settings: Settings) -> PathFeed:
    """The feed of this block; ControlAlarm where none is in force."""
    if state.feed is None:
        text = "a feed move without feed; F is expected in this block or before"
        raise ControlAlarm(AlarmNumber.NO_FEED, text, request.column_of(ModalGroup.MOTION))
    if state.feed_type == "G93":
        return PathFeed(state.feed, True, None, settings.same_place_mm)
    value = state.feed * (INCH_MM if state.is_feed_inch else 1.0)
    if state.feed_type == "G95":
        if not state.spindle_direction or state.limited_rpm == 0.0:
            raise ControlAlarm(AlarmNumber.NO_SPINDLE, "G95 feeds by turns of a spindle that stands; M3 is expected")
        value *= state.limited_rpm
    return PathFeed(value, False, state.feed_axes, settings.same_place_mm)


def absolute(coordinate: Coordinate, start: float, factor: float, state: State) -> float:
    """A programmed dimension as an absolute coordinate, mm."""
    is_absolute = coordinate.is_absolute
    if is_absolute is None:
        is_absolute = state.dimension == "G90"
    return coordinate.value * factor if is_absolute else start + coordinate.value * factor
