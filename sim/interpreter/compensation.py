"""Tool radius compensation in the working plane (G41, G42): the tool's centre runs beside the programmed contour.

Every contour element waits for the next, whose direction decides where it ends: at an outer corner an arc about the
corner (G450) or the crossing of the lines (G451), at an inner corner the crossing of the two offset curves. NORM: the
first and last point stand square to the contour. Moves square to the plane keep the centre's place in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from msgspec.structs import replace

from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.canon import Arc, Line, Motion, Polynomial, Rapid, Vector
from sim.interpreter.frames import add, cross, dot, norm, scaled, subtract
from sim.interpreter.outlet import Slot
from sim.interpreter.tangents import end_tangent, start_tangent, unit

_SHARPEST_MITRE = -0.5


@dataclass(frozen=True, slots=True)
class Side:
    """Where the tool runs: `normal` of the plane (unit), `offset_mm` > 0 to the left of travel, < 0 to the right.

    Places nearer than `same_place_mm` are one, a turn of less than `straight_rad` is none.
    """

    normal: Vector
    offset_mm: float
    corner: str
    feed_correction: str
    same_place_mm: float
    straight_rad: float = 1e-9

    def flat(self, a: Vector) -> Vector:
        """The part of a vector in the plane."""
        return subtract(a, scaled(self.normal, dot(a, self.normal)))

    def beside(self, point: Vector, tangent: Vector) -> Vector:
        """The centre's place beside a contour point."""
        return add(point, scaled(cross(self.normal, tangent), self.offset_mm))


@dataclass(slots=True)
class Element:
    """A contour element that waits: its motion, flat tangents, slot, where its offset starts, and arcs before it."""

    motion: Line | Arc | Rapid
    leaving: Vector
    arriving: Vector
    slot: Slot
    start: Vector
    before: list[Motion]
    is_approach: bool = False


class Compensator:
    """Offsets one contour; `push` takes its elements in order, `leave` the straight move that ends it (G40)."""

    def __init__(self, side: Side, position: Vector) -> None:
        self.side = side
        self._place = position
        self._waiting: Element | None = None
        self._lifts: list[tuple[Motion, Slot]] = []
        self._has_begun = False

    def push(self, motion: Motion, slot: Slot) -> None:
        """The next element; ControlAlarm for what cannot be offset."""
        if isinstance(motion, Polynomial):
            raise ControlAlarm(AlarmNumber.COMPENSATION, "splines and polynomials are not compensated; G40 is expected")
        leaving, arriving = self._tangent(start_tangent(motion)), self._tangent(end_tangent(motion))
        if leaving is None or arriving is None:
            self._lift(motion, slot)
            return
        if not self._has_begun:
            if isinstance(motion, Arc):
                raise ControlAlarm(
                    AlarmNumber.COMPENSATION, "G41 and G42 begin with a straight move; G0 or G1 is expected"
                )
            self._has_begun = True
            self._waiting = Element(motion, leaving, arriving, slot, self._place, [], is_approach=True)
            return
        if isinstance(motion, Arc):
            motion = self._at_contour_feed(motion)
        element = Element(motion, leaving, arriving, slot, self._place, [])
        if self._waiting is not None:
            self._join(self._waiting, element)
        self._waiting = element

    def leave(self, motion: Motion, slot: Slot) -> None:
        """The move with G40: the contour ends square, then straight to the programmed end."""
        if isinstance(motion, Arc | Polynomial):
            raise ControlAlarm(AlarmNumber.COMPENSATION, "G40 ends with a straight move; G0 or G1 is expected")
        self.close()
        slot.commands = self._straight(motion, self._place, motion.end)

    def close(self) -> None:
        """The contour ends square to its last element."""
        if self._waiting is not None:
            element = self._waiting
            self._finish(element, element.motion.end if element.is_approach else self._square_end(element))
            self._waiting = None
        for motion, slot in self._lifts:
            self._give_lift(motion, slot)
        self._lifts.clear()

    def _tangent(self, tangent: Vector | None) -> Vector | None:
        return None if tangent is None else unit(self.side.flat(tangent))

    def _square_end(self, element: Element) -> Vector:
        return self.side.beside(element.motion.end, element.arriving)

    def _lift(self, motion: Motion, slot: Slot) -> None:
        if self._waiting is None:
            self._give_lift(motion, slot)
        else:
            self._lifts.append((motion, slot))

    def _give_lift(self, motion: Motion, slot: Slot) -> None:
        height = dot(subtract(motion.end, self._place), self.side.normal)
        slot.commands = self._straight(motion, self._place, add(self._place, scaled(self.side.normal, height)))
        self._place = add(self._place, scaled(self.side.normal, height))

    def _join(self, first: Element, second: Element) -> None:
        """Decide where the offset of `first` ends and that of `second` starts."""
        corner = first.motion.end
        if first.is_approach:
            self._finish(first, self.side.beside(corner, second.leaving))
            second.start = self._risen()
            return
        turn = dot(cross(first.arriving, second.leaving), self.side.normal)
        ahead = dot(first.arriving, second.leaving)
        is_outer = turn * self.side.offset_mm < 0 or (abs(turn) < self.side.straight_rad and ahead < 0)
        is_smooth = abs(turn) < self.side.straight_rad and ahead > 0
        is_mitred = self.side.corner == "G451" and ahead > _SHARPEST_MITRE and _are_lines(first, second)
        if is_smooth or (is_outer and not is_mitred):
            self._finish(first, self._square_end(first))
        else:
            self._finish(first, self._crossing(first, second, corner))
        second.start = self._risen()
        if is_outer and not is_smooth and not is_mitred:
            self._round(second, self._place, ahead)

    def _risen(self) -> Vector:
        """Give the moves square to the plane that stand between two elements; where the centre is then."""
        for motion, slot in self._lifts:
            self._give_lift(motion, slot)
        self._lifts.clear()
        return self._place

    def _round(self, second: Element, start: Vector, ahead: float) -> None:
        """An arc about the outer corner, away from the contour."""
        side = self.side
        height = dot(subtract(start, second.motion.start), side.normal)
        corner = add(second.motion.start, scaled(side.normal, height))
        end = side.beside(corner, second.leaving)
        axis = scaled(side.normal, -math.copysign(1.0, side.offset_mm))
        sweep = math.acos(max(-1.0, min(1.0, ahead)))
        motion = second.motion
        if isinstance(motion, Rapid):
            second.before.append(Rapid(motion.line, motion.block, start, end))
        elif sweep > side.straight_rad:
            second.before.append(Arc(motion.line, motion.block, start, end, corner, axis, sweep, motion.feed_mm_min))
        second.start = self._place = end

    def _finish(self, element: Element, end: Vector) -> None:
        """Give the offset element from its start to `end` (in the plane; the height is the contour's)."""
        side, motion = self.side, element.motion
        end = add(side.flat(end), scaled(side.normal, dot(motion.end, side.normal)))
        if isinstance(motion, Arc):
            moved = self._offset_arc(element, motion, end)
        else:
            if not element.is_approach and dot(subtract(end, element.start), element.leaving) < -side.same_place_mm:
                raise _too_small()
            moved = self._straight(motion, element.start, end)
        element.slot.commands = [*element.before, *moved]
        self._place = end

    def _straight(self, motion: Motion, start: Vector, end: Vector) -> list[Motion]:
        """The straight move from start to end in place of `motion`; nothing where the two are one."""
        if norm(subtract(end, start)) < self.side.same_place_mm:
            return []
        if isinstance(motion, Rapid):
            return [replace(motion, start=start, end=end)]
        return [Line(motion.line, motion.block, start, end, motion.feed_mm_min)]

    def _offset_arc(self, element: Element, arc: Arc, end: Vector) -> list[Motion]:
        side = self.side
        out, back = side.flat(subtract(element.start, arc.centre)), side.flat(subtract(end, arc.centre))
        turn = math.atan2(dot(arc.axis, cross(out, back)), dot(out, back)) % (2 * math.pi)
        sweep = turn + 2 * math.pi * round((arc.sweep_rad - turn) / (2 * math.pi))
        if not 0.0 < sweep <= arc.sweep_rad + 1e-6:
            raise _too_small()
        return [replace(arc, start=element.start, end=end, sweep_rad=sweep)]

    def _at_contour_feed(self, arc: Arc) -> Arc:
        """The arc at the feed of the tool's centre, by the feed correction in force in its own block."""
        side = self.side
        factor = self._arc_radius(arc) / norm(side.flat(subtract(arc.start, arc.centre)))
        is_corrected = side.feed_correction == "CFC" or (side.feed_correction == "CFIN" and factor < 1.0)
        return replace(arc, feed_mm_min=arc.feed_mm_min * factor) if is_corrected else arc

    def _arc_radius(self, arc: Arc) -> float:
        inward = math.copysign(1.0, dot(arc.axis, self.side.normal)) * self.side.offset_mm
        radius = norm(self.side.flat(subtract(arc.start, arc.centre))) - inward
        if radius <= self.side.same_place_mm:
            raise ControlAlarm(
                AlarmNumber.COMPENSATION, "the arc's radius is not above the tool's; a smaller tool is expected"
            )
        return radius

    def _crossing(self, first: Element, second: Element, corner: Vector) -> Vector:
        """Where the two offset curves cross, nearest to the corner."""
        if _are_lines(first, second):
            a, b = cross(self.side.normal, first.arriving), cross(self.side.normal, second.leaving)
            return add(corner, scaled(add(a, b), self.side.offset_mm / (1.0 + dot(a, b))))
        if isinstance(first.motion, Arc) and isinstance(second.motion, Arc):
            found = self._circles(first.motion, second.motion)
        elif isinstance(first.motion, Arc):
            found = self._line_circle(self.side.beside(corner, second.leaving), second.leaving, first.motion)
        else:
            assert isinstance(second.motion, Arc)
            found = self._line_circle(self._square_end(first), first.arriving, second.motion)
        if not found:
            raise _too_small()
        return min(found, key=lambda point: norm(self.side.flat(subtract(point, corner))))

    def _line_circle(self, point: Vector, along: Vector, arc: Arc) -> list[Vector]:
        radius = self._arc_radius(arc)
        to_centre = self.side.flat(subtract(arc.centre, point))
        foot = dot(to_centre, along)
        rest = radius**2 - dot(to_centre, to_centre) + foot**2
        if rest < 0.0:
            return []
        return [add(point, scaled(along, foot + sign * math.sqrt(rest))) for sign in (-1.0, 1.0)]

    def _circles(self, first: Arc, second: Arc) -> list[Vector]:
        a, b = self._arc_radius(first), self._arc_radius(second)
        between = self.side.flat(subtract(second.centre, first.centre))
        distance = norm(between)
        if distance < self.side.same_place_mm:
            return []
        along = scaled(between, 1.0 / distance)
        foot = (distance**2 + a**2 - b**2) / (2 * distance)
        rest = a**2 - foot**2
        if rest < 0.0:
            return []
        base, across = add(first.centre, scaled(along, foot)), cross(self.side.normal, along)
        return [add(base, scaled(across, sign * math.sqrt(rest))) for sign in (-1.0, 1.0)]


def _are_lines(first: Element, second: Element) -> bool:
    return not isinstance(first.motion, Arc) and not isinstance(second.motion, Arc)


def _too_small() -> ControlAlarm:
    text = "the contour is too narrow for the tool's radius; a smaller tool or a wider contour is expected"
    return ControlAlarm(AlarmNumber.CONTOUR, text)
