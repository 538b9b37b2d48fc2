"""Directions and extents of canonical motions: where they leave and arrive, and the box they stay in."""

from __future__ import annotations

import math

from sim.interpreter.canon import Arc, Motion, Polynomial, Vector
from sim.interpreter.frames import add, cross, dot, norm, scaled, subtract
from sim.interpreter.moves import curve_point


def start_tangent(motion: Motion) -> Vector | None:
    """Unit direction in which the motion leaves its start, or None where it does not move."""
    if isinstance(motion, Arc):
        return _arc_tangent(motion, motion.start, 0.0)
    if isinstance(motion, Polynomial):
        return unit(curve_derivative(motion, 0.0)) or unit(
            subtract(curve_point(motion.coefficients, motion.denominator, 1e-3 * motion.length), motion.start)
        )
    return unit(subtract(motion.end, motion.start))


def end_tangent(motion: Motion) -> Vector | None:
    """Unit direction in which the motion arrives at its end, or None where it does not move."""
    if isinstance(motion, Arc):
        return _arc_tangent(motion, motion.end, motion.sweep_rad)
    if isinstance(motion, Polynomial):
        before = curve_point(motion.coefficients, motion.denominator, (1 - 1e-3) * motion.length)
        return unit(curve_derivative(motion, motion.length)) or unit(subtract(motion.end, before))
    return unit(subtract(motion.end, motion.start))


def curve_derivative(motion: Polynomial, p: float) -> Vector:
    """dc/dp of a polynomial motion, rational ones by the quotient rule."""
    value = curve_point(motion.coefficients, (1.0,), p)
    slope = (0.0, 0.0, 0.0)
    for power in range(len(motion.coefficients) - 1, 0, -1):
        slope = add(scaled(slope, p), scaled(motion.coefficients[power], float(power)))
    weight = sum(term * p**power for power, term in enumerate(motion.denominator))
    weight_slope = sum(power * term * p ** (power - 1) for power, term in enumerate(motion.denominator) if power)
    return scaled(subtract(scaled(slope, weight), scaled(value, weight_slope)), 1.0 / weight**2)


def extent(motion: Motion) -> tuple[Vector, Vector]:
    """Lowest and highest coordinates of the motion; polynomials by 33 points and their ends."""
    points = [motion.start, motion.end]
    if isinstance(motion, Polynomial):
        steps = [motion.length * step / 32 for step in range(1, 32)]
        points += [curve_point(motion.coefficients, motion.denominator, p) for p in steps]
    elif isinstance(motion, Arc):
        points += _arc_extremes(motion)
    low, high = [min(values) for values in zip(*points, strict=True)], [max(v) for v in zip(*points, strict=True)]
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])


def bounds(motion: Motion) -> tuple[Vector, Vector]:
    """A box that holds the motion: quicker to find than its `extent`, and never smaller."""
    if isinstance(motion, Arc) or (isinstance(motion, Polynomial) and motion.denominator != (1.0,)):
        return extent(motion)
    if not isinstance(motion, Polynomial):
        a, b = motion.start, motion.end
        low = (min(a[0], b[0]), min(a[1], b[1]), min(a[2], b[2]))
        return low, (max(a[0], b[0]), max(a[1], b[1]), max(a[2], b[2]))
    (low_x, low_y, low_z), (high_x, high_y, high_z) = motion.coefficients[0], motion.coefficients[0]
    power = 1.0
    for x, y, z in motion.coefficients[1:]:
        power *= motion.length
        low_x, high_x = low_x + min(x * power, 0.0), high_x + max(x * power, 0.0)
        low_y, high_y = low_y + min(y * power, 0.0), high_y + max(y * power, 0.0)
        low_z, high_z = low_z + min(z * power, 0.0), high_z + max(z * power, 0.0)
    return (low_x, low_y, low_z), (high_x, high_y, high_z)


def point_on_arc(arc: Arc, angle_rad: float) -> Vector:
    """The point of an arc after turning through `angle_rad` from its start."""
    radial, rise = _radial(arc)
    side = cross(arc.axis, radial)
    flat = add(scaled(radial, math.cos(angle_rad)), scaled(side, math.sin(angle_rad)))
    foot = subtract(arc.start, radial)
    return add(add(foot, flat), scaled(arc.axis, rise * angle_rad / arc.sweep_rad))


def _radial(arc: Arc) -> tuple[Vector, float]:
    """The radius vector at the start, square to the axis, and the rise along the axis over the whole arc."""
    out = subtract(arc.start, arc.centre)
    radial = subtract(out, scaled(arc.axis, dot(out, arc.axis)))
    return radial, dot(subtract(arc.end, arc.start), arc.axis)


def _arc_extremes(arc: Arc) -> list[Vector]:
    """Where a coordinate turns, in the first and the last turn: those between lie between."""
    radial, _ = _radial(arc)
    side = cross(arc.axis, radial)
    found = []
    for index in range(3):
        angle = math.atan2(side[index], radial[index]) % math.pi
        last = math.floor((arc.sweep_rad - angle) / math.pi)
        for turn in {0, 1, last - 1, last}:
            at = angle + turn * math.pi
            if 0.0 < at < arc.sweep_rad:
                found.append(point_on_arc(arc, at))
    return found


def _arc_tangent(arc: Arc, point: Vector, angle_rad: float) -> Vector | None:
    radial, rise = _radial(arc)
    out = subtract(point, arc.centre) if angle_rad else radial
    flat = cross(arc.axis, subtract(out, scaled(arc.axis, dot(out, arc.axis))))
    return unit(add(flat, scaled(arc.axis, rise / arc.sweep_rad)))


def unit(a: Vector) -> Vector | None:
    """The vector's direction, or None where it is too short to have one."""
    size = norm(a)
    return scaled(a, 1.0 / size) if size > 1e-12 else None
