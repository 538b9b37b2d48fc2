"""Arcs in the pass's plane for controls without splines: few, each within a tolerance of the curve.

Neighbouring arcs share a point, which may lie off the curve by a part of the tolerance, but not a tangent: the corner
is of the order of the tolerance over the arc's length. Where an arc ends is chosen together with the next, (F17).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.path.curve import CurveTable, ExactCurve
from planner.path.model import ArcChain, Array
from planner.path.plane_spline import Index

SECTIONS_AN_ARC = 14
MARGIN = 0.96
LEVELS = np.array([-0.9, 0.0, 0.9])


@dataclass(frozen=True, slots=True)
class Tube:
    """Sections across the curve: `points` (m, 2), unit `normals` (m, 2), half width `width_mm`."""

    points: Array
    normals: Array
    width_mm: float

    def at(self, section: int, level: float) -> Array:
        """The point of a section at this share of the half width."""
        return np.asarray(self.points[section] + level * self.width_mm * self.normals[section])


@dataclass(frozen=True, slots=True)
class Reach:
    """The furthest arc into one level: it ends at `section`, with this curvature, after `before` (None: start)."""

    section: int
    level: float
    bend: float
    before: Reach | None


def arc_chain(curve: ExactCurve, tolerance_mm: float, closer: int = 1) -> tuple[ArcChain, float]:
    """Few arcs within the tolerance of the curve, ends on the curve's ends, and the distance they keep, mm.

    They keep it at sections, which stand `closer` times as close where the curvature changes too fast for the usual.
    """
    arc = _sections(curve, tolerance_mm, closer)
    points, tangents = (found[:, :, 0].T for found in CurveTable([curve]).read(np.array([0]), arc[:, None]))
    normals = np.stack([-tangents[:, 1], tangents[:, 0]], axis=1)
    tube = Tube(points, normals, MARGIN * tolerance_mm)
    reaches = [Reach(0, 0.0, 0.0, None)]
    last = len(arc) - 1
    while reaches[0].section < last:
        reaches = _advance(tube, reaches)
    return _chain(tube, reaches[0]), tolerance_mm


def _sections(curve: ExactCurve, tolerance_mm: float, closer: int) -> Array:
    """Arc lengths so close that a longest arc, found from the change of curvature, crosses about 14 of them."""
    arc = curve.arc_mm - curve.arc_mm[0]
    change = np.abs(np.diff(curve.curvatures)) / np.diff(arc)
    near = np.pad(change, 1, mode="edge")
    change = np.maximum(np.maximum(near[:-2], near[2:]), change)
    bend = np.maximum(np.abs(curve.curvatures[1:]), np.abs(curve.curvatures[:-1]))
    density = SECTIONS_AN_ARC * np.cbrt(change / (192.0 * tolerance_mm))
    # An arc of constant curvature needs sections, too: eight a radian, and some on the whole curve.
    density = np.maximum(np.maximum(density, 8.0 * bend), 2 * SECTIONS_AN_ARC / arc[-1])
    rising = np.append(0.0, np.cumsum(closer * density * np.diff(arc)))
    return np.asarray(np.interp(np.linspace(0.0, rising[-1], int(np.ceil(rising[-1])) + 2), rising, arc))


def _advance(tube: Tube, reaches: list[Reach]) -> list[Reach]:
    """One more arc from each reach: the furthest for each level, or the end of the curve alone once it is reached."""
    last = len(tube.points) - 1
    best: dict[float, Reach] = {}
    for start, ends, bends in _furthest_of(tube, reaches):
        for level, end, bend in zip(LEVELS, ends, bends, strict=True):
            if end > start.section and (level not in best or end > best[level].section):
                best[level] = Reach(end, level, bend, start)
    arrived = best.get(0.0)
    if arrived is not None and arrived.section == last:
        return [arrived]
    # A level that has run to the very end but off the curve steps back, so that the end itself is met.
    return [reach for reach in best.values() if reach.section < last] or [best[0.0]]


def _furthest_of(tube: Tube, reaches: list[Reach]) -> list[tuple[Reach, list[int], list[float]]]:
    """Each reach with the furthest section for every level, and the arcs' curvatures; windows grow until they do."""
    last, window = len(tube.points) - 1, 2 * SECTIONS_AN_ARC
    found: dict[int, tuple[Reach, list[int], list[float]]] = {}
    open_ = list(range(len(reaches)))
    while open_:
        ends, bends = _furthest(tube, [reaches[at] for at in open_], window)
        found |= {at: (reaches[at], *both) for at, *both in zip(open_, ends.tolist(), bends.tolist(), strict=True)}
        open_ = [at for at in open_ if max(found[at][1]) == reaches[at].section + window < last]
        window *= 2
    return [found[at] for at in range(len(reaches))]


def _furthest(tube: Tube, starts: list[Reach], window: int) -> tuple[Index, Array]:
    """For each start and level the furthest of the next sections that one arc reaches, and its curvature, (r, l)."""
    last = len(tube.points) - 1
    first = np.array([start.section for start in starts])
    count = min(window, last - int(first.min()))
    sections = first[:, None] + np.arange(1, count + 1)
    is_there = sections <= last
    points, normals = tube.points[np.minimum(sections, last)], tube.normals[np.minimum(sections, last)]
    origins = np.array([tube.at(start.section, start.level) for start in starts])[:, None]
    lower, upper = points - tube.width_mm * normals - origins, points + tube.width_mm * normals - origins
    shifts = (LEVELS * tube.width_mm)[:, None, None] * normals[:, None]
    targets = points[:, None] + shifts - origins[:, None]
    one, other = _bends(targets, lower), _bends(targets, upper)
    # A section behind the target bounds the curvature; the target's own and those ahead do not.
    is_behind = np.tri(count, k=-1, dtype=bool)
    low = np.where(is_behind, np.minimum(one, other), -np.inf).max(axis=-1)
    high = np.where(is_behind, np.maximum(one, other), np.inf).min(axis=-1)
    fits = (low <= high) & is_there[:, None]
    chosen = count - 1 - fits[..., ::-1].argmax(axis=-1)
    low, high = (np.take_along_axis(side, chosen[..., None], axis=-1)[..., 0] for side in (low, high))
    is_free = ~np.isfinite(low)
    bends = 0.5 * (np.where(is_free, 0.0, low) + np.where(is_free, 0.0, high))
    return first[:, None] + 1 + chosen, bends


def _bends(targets: Array, through: Array) -> Array:
    """Signed curvature (r, l, j, i) of the arc from the origin through points (r, i, 2) to targets (r, l, j, 2).

    Positive turns left.
    """
    x, y = through[:, None, None, :, 0], through[:, None, None, :, 1]
    to_x, to_y = targets[..., 0, None], targets[..., 1, None]
    lengths = np.hypot(x, y) * np.hypot(to_x, to_y) * np.hypot(to_x - x, to_y - y)
    return np.asarray(2.0 * (x * to_y - y * to_x) / np.maximum(lengths, np.finfo(float).tiny))


def _chain(tube: Tube, end: Reach) -> ArcChain:
    """The arcs that led to this reach; an arc flatter than a thousandth of the tolerance is a line."""
    points, centres, turns = [tube.at(end.section, end.level)], [], []
    while end.before is not None:
        start, stop = tube.at(end.before.section, end.before.level), points[-1]
        chord = stop - start
        length = float(np.hypot(chord[0], chord[1]))
        is_line = length**2 * abs(end.bend) < 8e-3 * tube.width_mm
        # The centre lies on the chord's bisector, to the left of an arc that turns left.
        height = 0.0 if is_line else np.sqrt(max(1.0 / end.bend**2 - length**2 / 4, 0.0)) * np.sign(end.bend)
        middle = 0.5 * (start + stop)
        centres.append(middle + height / length * np.array([-chord[1], chord[0]]))
        turns.append(0 if is_line else int(np.sign(end.bend)))
        points.append(start)
        end = end.before
    return ArcChain(np.array(points[::-1]), np.array(centres[::-1]), np.array(turns[::-1], dtype=np.int8))
