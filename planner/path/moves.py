"""The order of passes and the way each runs, and the moves between them.

Rapids move Z alone or XY alone: up, across, down, and the last way down at plunge feed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from planner.path.model import ArcChain, Array, Cut, Pass, PlaneSpline, Polyline, Shape


@dataclass(frozen=True, slots=True)
class AirMoves:
    """What the tool travels without cutting, mm: at rapid speed and at plunge feed."""

    rapid_mm: float
    plunge_mm: float


def ways(planes_mm: Sequence[float], pattern: str) -> list[Cut]:
    """Which way each pass runs: zigzag turns at every new plane, one-way climbs.

    With the spindle clockwise and the uncut side toward the plane's normal, climb milling runs against +w.

    >>> [way.value for way in ways([1.0, 2.0, 2.0, 3.0], "zigzag")]
    ['forward', 'backward', 'backward', 'forward']
    """
    if pattern == "one-way":
        return [Cut.BACKWARD] * len(planes_mm)
    turns = np.cumsum([0, *(after != before for before, after in pairwise(planes_mm))])
    return [Cut.BACKWARD if turn % 2 else Cut.FORWARD for turn in turns]


def in_order(passes: Sequence[Pass], pattern: str) -> tuple[Pass, ...]:
    """The passes, given plane by plane along +w, in the order and direction they are cut."""
    directions = ways([one.plane.offset_mm for one in passes], pattern)
    ordered: list[Pass] = []
    group: list[Pass] = []
    for index, (one, way) in enumerate(zip(passes, directions, strict=True)):
        group.append(one if way is Cut.FORWARD else _reversed(one))
        is_last = index + 1 == len(passes) or passes[index + 1].plane != one.plane
        if is_last:
            ordered.extend(group if way is Cut.FORWARD else group[::-1])
            group = []
    return tuple(ordered)


def air_moves(passes: Sequence[Pass], clearance_z_mm: float, safe_z_mm: float) -> AirMoves:
    """The moves before, between and after passes, from and to the safe height; heights of the ball's centre."""
    ends = [one.plane.to_work(end_points(one.shape)) for one in passes]
    plunge = sum(max(clearance_z_mm - float(pair[0, 2]), 0.0) for pair in ends)
    lifts = sum(max(clearance_z_mm - float(pair[1, 2]), 0.0) for pair in ends)
    across = sum(float(np.hypot(*(after[0, :2] - before[1, :2]))) for before, after in pairwise(ends))
    return AirMoves(lifts + across + 2 * (safe_z_mm - clearance_z_mm), plunge)


def nodes_of(shape: Shape) -> Array:
    """Control points or vertices of a shape in its plane, (n, 2) of (w, z), mm; the first and last are its ends."""
    return shape.control_points if isinstance(shape, PlaneSpline) else shape.points


def corners_of(shape: Shape) -> Array:
    """Points (n, 2) that box a shape in its plane: its nodes, and the lowest and highest places of arcs between them.

    Arcs never turn back in w. Control points may stand outside the curve, never inside.
    """
    if not isinstance(shape, ArcChain):
        return nodes_of(shape)
    begin, end = shape.points[:-1], shape.points[1:]
    below = shape.turns * (end[:, 0] - begin[:, 0]) > 0  # counter-clockwise along +w an arc runs below its centre
    radius_mm = np.hypot(*(begin - shape.centres).T)
    tips = shape.centres + np.stack([np.zeros(len(below)), np.where(below, -radius_mm, radius_mm)], axis=1)
    is_on = (shape.turns != 0) & ((shape.centres[:, 0] - begin[:, 0]) * (shape.centres[:, 0] - end[:, 0]) < 0)
    return np.concatenate([shape.points, tips[is_on]])


def end_points(shape: Shape) -> Array:
    """First and last point of a shape in its plane, (2, 2) of (w, z), mm."""
    return nodes_of(shape)[[0, -1]]


def _reversed(one: Pass) -> Pass:
    return replace(one, shape=_turned(one.shape), break_points=one.break_points[::-1])


def _turned(shape: Shape) -> Shape:
    if isinstance(shape, PlaneSpline):
        knots = (shape.knots[0] + shape.knots[-1]) - shape.knots[::-1]
        return PlaneSpline(shape.degree, knots, shape.control_points[::-1])
    if isinstance(shape, Polyline):
        return Polyline(shape.points[::-1])
    return ArcChain(shape.points[::-1], shape.centres[::-1], np.asarray(-shape.turns[::-1], dtype=np.int8))
