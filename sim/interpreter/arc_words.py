"""Arcs from their spellings in a block: I J K, CR=, AR=, CIP, CT, TURN= to canonical arcs."""

from __future__ import annotations

import math

from msgspec.structs import replace

from sim.interpreter import canon, moves
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.canon import Vector
from sim.interpreter.feeds import PathFeed
from sim.interpreter.frames import add, dot, norm, scaled, subtract
from sim.interpreter.mapping import Mapping
from sim.interpreter.request import Request
from sim.interpreter.settings import Settings
from sim.interpreter.state import INCH_MM, State
from sim.interpreter.tangents import point_on_arc
from sim.interpreter.targets import Target, absolute, path_feed


def arc_motion(code: str, target: Target, request: Request, state: State, settings: Settings) -> canon.Arc | None:
    """The arc a block asks for; None where its three points, or tangent and end, lie on a line."""
    feed, near_mm = path_feed(request, state, settings), settings.same_place_mm
    end: Vector = target.end
    shape: moves.ArcShape | None
    if code == "CT":
        shape = moves.arc_tangent(
            target.start, end, _programmed_tangent(target.mapping, state), state.plane_axes, near_mm
        )
    elif code == "CIP":
        if norm(subtract(end, target.start)) < near_mm:
            text = "CIP ends where it starts, which leaves its plane open; two arcs make a full circle"
            raise ControlAlarm(AlarmNumber.CIRCLE, text)
        shape = moves.arc_through(target.start, _middle(target, request, state), end)
    else:
        end, shape = _circle(code == "G2", target, request, state, settings)
    turns = request.take("TURN") or 0.0
    if not 0 <= turns <= 999 or turns != int(turns):
        raise ControlAlarm(AlarmNumber.CIRCLE, "TURN takes whole turns from 0 to 999")
    if shape is None:
        return None
    sweep_rad = shape.sweep_rad + 2 * math.pi * turns
    frame = target.mapping.frame
    if frame.arc_scale((0, 1, 2) if code == "CIP" else state.plane_axes[:2]) is None:
        raise ControlAlarm(AlarmNumber.FRAME, "an arc under SCALE with different factors; equal ones are expected")
    start, canonical_end = state.position_mm, target.mapping.point(end)
    centre, across = target.mapping.point(shape.centre), frame.direction(shape.axis)
    axis = scaled(across, frame.handedness / norm(across))
    line, block = request.block.line, request.block.number
    arc = canon.Arc(line, block, start, canonical_end, centre, axis, sweep_rad, feed.value)
    return replace(arc, feed_mm_min=_speed(arc, feed)) if feed.depends_on_path else arc


def _speed(arc: canon.Arc, feed: PathFeed) -> float:
    out = subtract(arc.start, arc.centre)
    radius = norm(subtract(out, scaled(arc.axis, dot(out, arc.axis))))
    length = moves.arc_length(radius, arc.sweep_rad, dot(subtract(arc.end, arc.start), arc.axis))
    steps = math.ceil(arc.sweep_rad / math.radians(2.0))
    return feed.along([point_on_arc(arc, arc.sweep_rad * step / steps) for step in range(steps + 1)], length)


def _middle(target: Target, request: Request, state: State) -> Vector:
    if not request.middles:
        raise ControlAlarm(AlarmNumber.CIRCLE, "CIP lacks its middle point; I1=, J1=, K1= are expected")
    factor = INCH_MM if state.is_inch else 1.0
    values = list(target.start)
    for index, coordinate in request.middles.items():
        values[index] = absolute(coordinate, target.start[index], factor, state)
    request.middles.clear()
    return (values[0], values[1], values[2])


def _programmed_tangent(mapping: Mapping, state: State) -> Vector:
    tangent = state.tangent
    if tangent is None:
        raise ControlAlarm(AlarmNumber.CIRCLE, "CT follows no move; a line or an arc before it is expected")
    there = mapping.inverse_point(add(state.position_mm, tangent))
    return subtract(there, mapping.inverse_point(state.position_mm))


def _circle(
    is_clockwise: bool, target: Target, request: Request, state: State, settings: Settings
) -> tuple[Vector, moves.ArcShape]:
    """End and shape of G2 or G3 by I J K, CR= or AR=."""
    plane = state.plane_axes
    start, end = target.start, target.end
    tolerance_mm, near_mm = settings.arc_tolerance_mm, settings.same_place_mm
    factor = INCH_MM if state.is_inch else 1.0
    radius, angle_deg = request.take("CR"), request.take("AR")
    centre = _centre(start, factor, request, state)
    if (radius is not None) + (angle_deg is not None) + (centre is not None) == 0:
        raise ControlAlarm(AlarmNumber.CIRCLE, "the arc has no centre; I, J, K, CR= or AR= is expected")
    if radius is not None and (centre is not None or angle_deg is not None):
        raise ControlAlarm(AlarmNumber.CIRCLE, "the arc has CR= beside another centre; one of them is expected")
    if radius is not None:
        centre = moves.centre_from_radius(start, end, radius * factor, plane, is_clockwise, tolerance_mm, near_mm)
    elif angle_deg is not None and centre is not None:
        angle = math.radians(angle_deg)
        if not 0 < angle_deg < 360 or any(abs(end[i] - start[i]) > near_mm for i in plane[:2]):
            text = "AR= with a centre takes an angle above 0 and below 360 and no end point"
            raise ControlAlarm(AlarmNumber.CIRCLE, text)
        turned = list(moves.turned_about(start, centre, -angle if is_clockwise else angle, plane))
        turned[plane[2]] = end[plane[2]]
        end = (turned[0], turned[1], turned[2])
    elif angle_deg is not None:
        centre = moves.centre_from_angle(start, end, math.radians(angle_deg), plane, is_clockwise, near_mm)
    assert centre is not None
    tolerance_mm = max(tolerance_mm, settings.arc_tolerance_share * math.dist(start, centre))
    return end, moves.arc_about(start, end, centre, plane, is_clockwise, tolerance_mm, near_mm)


def _centre(start: Vector, factor: float, request: Request, state: State) -> Vector | None:
    """I, J, K count from the start unless AC says otherwise; those of the plane's axes only."""
    plane = state.plane_axes
    if not request.centres:
        return None
    values = list(start)
    for index in plane[:2]:
        coordinate = request.centres.pop(index, None)
        if coordinate is not None:
            base = 0.0 if coordinate.is_absolute else start[index]
            values[index] = base + coordinate.value * factor
    for index, coordinate in request.centres.items():
        first, second = ("IJK"[one] for one in plane[:2])
        text = f"{'IJK'[index]} is not of the working plane {state.plane}; {first} and {second} are expected"
        raise ControlAlarm(AlarmNumber.CIRCLE, text, coordinate.column)
    return (values[0], values[1], values[2])
