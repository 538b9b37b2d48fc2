"""Geometry of single blocks in programmed coordinates: arcs from their spellings, polynomials from PO words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.canon import Vector
from sim.interpreter.frames import add, cross, dot, norm, scaled, subtract

Plane = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class ArcShape:
    """An arc in programmed coordinates; `axis` unit, `sweep_rad` > 0 right hand about it."""

    centre: Vector
    axis: Vector
    sweep_rad: float


def unit_axis(index: int, sign: float = 1.0) -> Vector:
    """The unit vector of one axis."""
    return (sign if index == 0 else 0.0, sign if index == 1 else 0.0, sign if index == 2 else 0.0)


def arc_about(
    start: Vector,
    end: Vector,
    centre: Vector,
    plane: Plane,
    is_clockwise: bool,
    tolerance_mm: float,
    same_place_mm: float,
) -> ArcShape:
    """The arc from start to end about a centre given by I, J, K; start = end is a full circle.

    Radii at both ends may differ by `tolerance_mm`; the centre then moves onto the perpendicular bisector. Raises
    ControlAlarm where they differ more, where the centre of the same radius lies elsewhere, or the radius is 0.
    """
    u, v, w = plane
    at_start = (start[u] - centre[u], start[v] - centre[v])
    at_end = (end[u] - centre[u], end[v] - centre[v])
    radius, radius_end = math.hypot(*at_start), math.hypot(*at_end)
    if radius < same_place_mm:
        raise ControlAlarm(AlarmNumber.CIRCLE, "the arc has radius 0; a centre off the start is expected")
    if abs(radius - radius_end) > tolerance_mm:
        text = f"the arc does not close: radius {radius:.4f} at its start, {radius_end:.4f} at its end"
        raise ControlAlarm(AlarmNumber.CIRCLE, text)
    chord = (end[u] - start[u], end[v] - start[v])
    length = math.hypot(*chord)
    moved = [centre[u], centre[v]]
    if length > same_place_mm and radius != radius_end:
        _require_centre((-at_start[0], -at_start[1]), chord)
        shift = (at_start[0] + at_end[0]) * chord[0] / 2 + (at_start[1] + at_end[1]) * chord[1] / 2
        moved = [centre[u] + shift * chord[0] / length**2, centre[v] + shift * chord[1] / length**2]
        at_start = (start[u] - moved[0], start[v] - moved[1])
        at_end = (end[u] - moved[0], end[v] - moved[1])
    sweep = 2 * math.pi
    if length > same_place_mm:
        turn = math.atan2(
            at_start[0] * at_end[1] - at_start[1] * at_end[0], at_start[0] * at_end[0] + at_start[1] * at_end[1]
        )
        sweep = (-turn if is_clockwise else turn) % (2 * math.pi)
    placed = [0.0, 0.0, 0.0]
    placed[u], placed[v], placed[w] = moved[0], moved[1], start[w]
    return ArcShape((placed[0], placed[1], placed[2]), unit_axis(w, -1.0 if is_clockwise else 1.0), sweep)


def _require_centre(to_centre: tuple[float, float], chord: tuple[float, float]) -> None:
    """ControlAlarm where the centre that has the radius of the start from both ends lies in another direction.

    The direction from the start may turn by the root of 0.001 rad (list of alarms, 14040).
    """
    radius, half = math.hypot(*to_centre), math.hypot(*chord) / 2
    along, across = (chord[0] / half / 2, chord[1] / half / 2), (-chord[1] / half / 2, chord[0] / half / 2)
    height = math.sqrt(max(radius**2 - half**2, 0.0))
    ahead, aside = (
        to_centre[0] * along[0] + to_centre[1] * along[1],
        to_centre[0] * across[0] + to_centre[1] * across[1],
    )
    turn = abs(math.atan2(abs(aside), ahead) - math.atan2(height, half))
    if turn > math.sqrt(0.001):
        text = f"the arc does not close: for the radius {radius:.4f} at both ends its centre is"
        raise ControlAlarm(
            AlarmNumber.CIRCLE, f"{text} {math.degrees(turn):.1f} degrees aside; 1.8 at most are expected"
        )


def centre_from_radius(
    start: Vector,
    end: Vector,
    radius_mm: float,
    plane: Plane,
    is_clockwise: bool,
    tolerance_mm: float,
    same_place_mm: float,
) -> Vector:
    """The centre for CR=: sweep up to 180 degrees where positive, beyond where negative."""
    u, v, w = plane
    du, dv = end[u] - start[u], end[v] - start[v]
    chord = math.hypot(du, dv)
    if chord < same_place_mm:
        raise ControlAlarm(AlarmNumber.CIRCLE, "CR needs an end off the start; I, J, K are expected for a full circle")
    rise = radius_mm**2 - chord**2 / 4
    if abs(radius_mm) + tolerance_mm < chord / 2:
        text = f"CR={radius_mm:g} cannot reach the end; at least {chord / 2:.4f} is expected"
        raise ControlAlarm(AlarmNumber.CIRCLE, text)
    height = math.sqrt(max(rise, 0.0))
    side = (1.0 if is_clockwise else -1.0) * (-1.0 if radius_mm < 0 else 1.0)
    placed = [0.0, 0.0, 0.0]
    placed[u] = (start[u] + end[u]) / 2 + side * height * dv / chord
    placed[v] = (start[v] + end[v]) / 2 - side * height * du / chord
    placed[w] = start[w]
    return (placed[0], placed[1], placed[2])


def centre_from_angle(
    start: Vector, end: Vector, angle_rad: float, plane: Plane, is_clockwise: bool, same_place_mm: float
) -> Vector:
    """The centre for AR= with an end point: the arc turns through `angle_rad`."""
    u, v, _ = plane
    chord = math.hypot(end[u] - start[u], end[v] - start[v])
    if not 0 < angle_rad < 2 * math.pi or chord < same_place_mm:
        raise ControlAlarm(AlarmNumber.CIRCLE, "AR needs an angle above 0 and below 360 and an end off the start")
    radius = chord / (2 * math.sin(angle_rad / 2))
    signed = -radius if angle_rad > math.pi else radius
    return centre_from_radius(start, end, signed, plane, is_clockwise, 1e-6 * radius, same_place_mm)


def turned_about(point: Vector, centre: Vector, angle_rad: float, plane: Plane) -> Vector:
    """`point` turned about `centre` in the plane, counter-clockwise where positive; the third coordinate stays."""
    u, v, w = plane
    du, dv = point[u] - centre[u], point[v] - centre[v]
    placed = [0.0, 0.0, 0.0]
    placed[u] = centre[u] + du * math.cos(angle_rad) - dv * math.sin(angle_rad)
    placed[v] = centre[v] + du * math.sin(angle_rad) + dv * math.cos(angle_rad)
    placed[w] = point[w]
    return (placed[0], placed[1], placed[2])


def arc_through(start: Vector, middle: Vector, end: Vector) -> ArcShape | None:
    """CIP: the arc in space from start through middle to end; None where the three lie on a line."""
    a, b = subtract(middle, start), subtract(end, start)
    normal = cross(a, b)
    size = norm(normal)
    if size <= 1e-12 * max(norm(a) * norm(b), 1e-300):
        return None
    axis = scaled(normal, 1.0 / size)
    offset = cross(subtract(scaled(b, dot(a, a)), scaled(a, dot(b, b))), normal)
    centre = add(start, scaled(offset, 0.5 / size**2))
    return ArcShape(centre, axis, _sweep_about(start, end, centre, axis))


def arc_tangent(start: Vector, end: Vector, tangent: Vector, plane: Plane, same_place_mm: float) -> ArcShape | None:
    """CT: the arc in the plane that leaves start along `tangent`; None where the end lies straight ahead."""
    u, v, w = plane
    tu, tv = tangent[u], tangent[v]
    size = math.hypot(tu, tv)
    du, dv = end[u] - start[u], end[v] - start[v]
    chord = math.hypot(du, dv)
    if size < 1e-9 or chord < same_place_mm:
        raise ControlAlarm(AlarmNumber.CIRCLE, "CT needs a tangent in the plane and an end off the start")
    side = (tu * dv - tv * du) / (size * chord)
    if abs(side) < 1e-9:
        if tu * du + tv * dv > 0:
            return None
        raise ControlAlarm(AlarmNumber.CIRCLE, "CT cannot turn straight back; another end point is expected")
    radius = chord / (2 * side)
    placed = [0.0, 0.0, 0.0]
    placed[u], placed[v], placed[w] = start[u] - radius * tv / size, start[v] + radius * tu / size, start[w]
    centre = (placed[0], placed[1], placed[2])
    return arc_about(start, end, centre, plane, side < 0, 1e-6 * abs(radius), same_place_mm)


def _sweep_about(start: Vector, end: Vector, centre: Vector, axis: Vector) -> float:
    a, b = subtract(start, centre), subtract(end, centre)
    return math.atan2(dot(axis, cross(a, b)), dot(a, b)) % (2 * math.pi)


def polynomial(start: float, values: tuple[float, ...], end: float, length: float) -> tuple[float, ...]:
    """Coefficients of one axis from PO[axis]=(end, a2, a3 ...): a0 is where the axis stands, a1 follows from the end.

    >>> polynomial(0.0, (0.5,), 10.0, 2.0)
    (0.0, 4.0, 0.5)
    """
    higher = sum(value * length ** (power + 2) for power, value in enumerate(values))
    return (start, (end - start - higher) / length, *values)


def arc_length(radius_mm: float, sweep_rad: float, rise_mm: float) -> float:
    """Length of a helix."""
    return math.hypot(radius_mm * sweep_rad, rise_mm)


def curve_points(
    coefficients: tuple[Vector, ...], denominator: tuple[float, ...], length: float, steps: int = 64
) -> list[Vector]:
    """Points along a polynomial curve; their chords give its length to about 1e-4, and feeds need no more."""
    return [curve_point(coefficients, denominator, length * step / steps) for step in range(steps + 1)]


def curve_point(coefficients: tuple[Vector, ...], denominator: tuple[float, ...], p: float) -> Vector:
    """The point of a polynomial curve at parameter p, by Horner's rule."""
    x = y = z = w = 0.0
    for cx, cy, cz in reversed(coefficients):
        x, y, z = x * p + cx, y * p + cy, z * p + cz
    for c in reversed(denominator):
        w = w * p + c
    return (x / w, y / w, z / w)


def smallest_on(denominator: tuple[float, ...], length: float) -> float:
    """A lower bound of the denominator on [0, length]: the smallest Bernstein coefficient after subdivision."""
    degree = len(denominator) - 1
    scaled_terms = [value * length**power for power, value in enumerate(denominator)]
    pieces = [
        [sum(math.comb(i, k) / math.comb(degree, k) * scaled_terms[k] for k in range(i + 1)) for i in range(degree + 1)]
    ]
    for _ in range(8):
        if min(min(piece) for piece in pieces) > 0:
            break
        pieces = [half for piece in pieces for half in _halves(piece)]
    return min(min(piece) for piece in pieces)


def _halves(piece: list[float]) -> tuple[list[float], list[float]]:
    left, right, row = [piece[0]], [piece[-1]], piece
    while len(row) > 1:
        row = [(a + b) / 2 for a, b in pairwise(row)]
        left.append(row[0])
        right.append(row[-1])
    return left, right[::-1]
