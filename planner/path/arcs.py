"""Arcs in the pass's plane for controls without splines: few, each within a tolerance of the curve.

Neighbouring arcs share a point, which may lie off the curve by a part of the tolerance, but not a tangent: the corner
is of the order of the tolerance over the arc's length. Where an arc ends is chosen together with the next, (F17).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.path.curve import CurveTable, ExactCurve
from planner.path.model import ArcChain, Array

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
    for start in reaches:
        window = 2 * SECTIONS_AN_ARC
        while True:
            stop = min(start.section + window, last)
            ends, bends = _furthest(tube, start, stop)
            if stop == last or max(ends) < stop:
                break
            window *= 2
        for level, end, bend in zip(LEVELS, ends, bends, strict=True):
            if end > start.section and (level not in best or end > best[level].section):
                best[level] = Reach(end, level, bend, start)
    arrived = best.get(0.0)
    if arrived is not None and arrived.section == last:
        return [arrived]
    # A level that has run to the very end but off the curve steps back, so that the end itself is met.
    return [reach for reach in best.values() if reach.section < last] or [best[0.0]]


def _furthest(tube: Tube, start: Reach, stop: int) -> tuple[list[int], list[float]]:
    """For each level the furthest section up to `stop` that one arc reaches, and the arc's curvature."""
    origin = tube.at(start.section, start.level)
    sections = np.arange(start.section + 1, stop + 1)
    lower = tube.points[sections] - tube.width_mm * tube.normals[sections] - origin
    upper = tube.points[sections] + tube.width_mm * tube.normals[sections] - origin
    ends, bends = [], []
    for level in LEVELS:
        targets = tube.points[sections] + level * tube.width_mm * tube.normals[sections] - origin
        one, other = _bends(targets, lower), _bends(targets, upper)
        # A section behind the target bounds the curvature; the target's own and those ahead do not.
        is_behind = np.tri(len(sections), k=-1, dtype=bool)
        low = np.where(is_behind, np.minimum(one, other), -np.inf).max(axis=1)
        high = np.where(is_behind, np.maximum(one, other), np.inf).min(axis=1)
        fits = np.flatnonzero(low <= high)
        if not len(fits):
            ends.append(start.section)
            bends.append(0.0)
            continue
        chosen = int(fits[-1])
        ends.append(int(sections[chosen]))
        is_free = not np.isfinite(low[chosen])
        bends.append(0.0 if is_free else float(0.5 * (low[chosen] + high[chosen])))
    return ends, bends


def _bends(targets: Array, through: Array) -> Array:
    """Signed curvature (j, i) of the arc from the origin through points i to targets j; positive turns left."""
    chord = targets[:, None, :] - through[None, :, :]
    cross = through[None, :, 0] * targets[:, None, 1] - through[None, :, 1] * targets[:, None, 0]
    lengths = np.hypot(*through.T)[None, :] * np.hypot(*targets.T)[:, None] * np.hypot(chord[..., 0], chord[..., 1])
    return np.asarray(2.0 * cross / np.maximum(lengths, np.finfo(float).tiny))


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
