"""What a single canonical move is to the rules: plunge, retract, air or reversal; its length and its directions."""

from __future__ import annotations

import math
from itertools import pairwise

from sim.interpreter import canon
from sim.interpreter.moves import curve_point
from sim.interpreter.tangents import extent

TURN_COSINE = 0.985
"""Cosine of 10 degrees: a move that turns by more than 170 degrees runs back; the strokes of an N or W do not."""
TURN_FLAT = 0.1
"""Two moves are compared where their unit directions, seen from above, multiply to more than this."""


def moves_xy(move: canon.Motion) -> bool:
    """Whether X or Y changes."""
    return move.start[:2] != move.end[:2]


def is_plunge(move: canon.Motion) -> bool:
    """Whether the move goes straight down."""
    return not moves_xy(move) and move.end[2] < move.start[2]


def is_retract(move: canon.Motion) -> bool:
    """Whether the move goes straight up."""
    return not moves_xy(move) and move.end[2] > move.start[2]


def is_into_hole(move: canon.Motion, hole: canon.Vector | None) -> bool:
    """Whether the move goes straight down, no deeper than the bottom of the hole at its place."""
    return hole is not None and not moves_xy(move) and move.end[:2] == hole[:2] and move.end[2] >= hole[2]


def is_air(move: canon.Motion, clear_z_mm: float) -> bool:
    """Whether a feed move touches the clear height: above it, down from it or up to it."""
    return max(move.start[2], move.end[2]) >= clear_z_mm and (not moves_xy(move) or heights_mm(move)[0] >= clear_z_mm)


def heights_mm(move: canon.Motion) -> tuple[float, float]:
    """The lowest and the highest Z of a move; an arc may have them between its ends."""
    if isinstance(move, canon.Arc):
        low, high = extent(move)
        return low[2], high[2]
    return min(move.start[2], move.end[2]), max(move.start[2], move.end[2])


def turns_back(before: canon.Vector | None, move: canon.Motion) -> bool:
    """Whether the move sets out against the direction before it, by more than 170 degrees seen from above."""
    if before is None:
        return False
    ahead = start_direction(move)
    flat = math.hypot(*before[:2]) * math.hypot(*ahead[:2])
    return flat > TURN_FLAT and before[0] * ahead[0] + before[1] * ahead[1] < -TURN_COSINE * flat


def length(move: canon.Motion) -> float:
    """Length of a move, mm; curves by eight chords."""
    if isinstance(move, canon.Arc):
        radius = math.dist(move.start, move.centre)
        return math.hypot(radius * move.sweep_rad, _along_axis(move))
    if isinstance(move, canon.Polynomial):
        points = [point_at(move, move.length * step / 8) for step in range(9)]
        return sum(math.dist(a, b) for a, b in pairwise(points))
    return math.dist(move.start, move.end)


def _along_axis(move: canon.Arc) -> float:
    return sum((e - s) * a for s, e, a in zip(move.start, move.end, move.axis, strict=True))


def point_at(move: canon.Polynomial, parameter: float) -> canon.Vector:
    """The point of a polynomial at this parameter."""
    return curve_point(move.coefficients, move.denominator, parameter)


def start_direction(move: canon.Motion) -> canon.Vector:
    """Unit direction at the start; (0, 0, 0) where there is none."""
    if isinstance(move, canon.Polynomial):
        return _unit(move.start, point_at(move, move.length * 1e-3))
    if isinstance(move, canon.Arc):
        return _tangent(move, move.start)
    return _unit(move.start, move.end)


def end_direction(move: canon.Motion) -> canon.Vector:
    """Unit direction at the end; (0, 0, 0) where there is none."""
    if isinstance(move, canon.Polynomial):
        return _unit(point_at(move, move.length * (1.0 - 1e-3)), move.end)
    if isinstance(move, canon.Arc):
        return _tangent(move, move.end)
    return _unit(move.start, move.end)


def _tangent(move: canon.Arc, at: canon.Vector) -> canon.Vector:
    ax, ay, az = move.axis
    x, y, z = (p - c for p, c in zip(at, move.centre, strict=True))
    return _unit((0.0, 0.0, 0.0), (ay * z - az * y, az * x - ax * z, ax * y - ay * x))


def _unit(start: canon.Vector, end: canon.Vector) -> canon.Vector:
    size = math.dist(start, end)
    if size == 0.0:
        return 0.0, 0.0, 0.0
    x, y, z = ((e - s) / size for s, e in zip(start, end, strict=True))
    return x, y, z
