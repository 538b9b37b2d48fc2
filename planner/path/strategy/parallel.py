"""Parallel passes: driving planes side by side, at pick feeds from the scallop or at a fixed distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.errors import InputRejected
from planner.path.coverage import border_cusps, border_heights, crossings
from planner.path.gouge import check_beyond, check_creases, check_radius, check_reach, tool_side
from planner.path.model import DrivingPlane
from planner.path.offset import OffsetSurface
from planner.path.one_sided import with_one_sided
from planner.path.peaks import Ground, Peaks, lay_ground, survey
from planner.path.pick_feed import ChainEnd, even_planes, left_for_exact_mm, local_pick_feed, solve_pick_feeds
from planner.path.runs import Pieces, closes, pass_runs
from planner.path.seeds import Seeds, sow
from planner.path.standing import with_traced
from planner.path.strategy.roll_over import roll_over, within_patch
from planner.path.trace import TracedCurve, trace
from planner.surface.curvature import survey as survey_patch
from planner.surface.patch import NurbsPatch

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

FURTHEST_OUT = 0.6  # of the ball's radius, past the edge


@dataclass(frozen=True, slots=True)
class Layout:
    """Traced passes in order, and what they leave: `planes_mm` (planes,), `peaks` of the gaps between planes.

    `pass_of[i]` is the pass that curve i is a piece of; pieces of a pass follow each other. `gouge_mm` is the deepest
    that a ball touching one place of the patch was found to cut into another.
    """

    curves: tuple[TracedCurve, ...]
    pass_of: Indices
    planes_mm: Array
    peaks: Peaks
    ground: Ground
    gouge_mm: float


@dataclass(frozen=True, slots=True)
class Wishes:
    """What the operation asks for; exactly one of `scallop_mm` and `pick_feed_mm` is given.

    `high_mm` is how far a pass as written may stand from the exact one: the scallop holds for the written ones.
    """

    radius_mm: float
    angle_rad: float
    scallop_mm: float | None
    pick_feed_mm: float | None
    stock_mm: float = 0.0
    rolls_over: bool = False
    high_mm: float = 0.0


def lay_parallel(patch: NurbsPatch, wishes: Wishes, *, accuracy_mm: float, reading_mm: float = 1e-5) -> Layout:
    """Traced passes over one patch; raises InputRejected with one sentence for what this ball cannot cut.

    Scallops are solved to `accuracy_mm`; passes have nodes so near that they are read within `reading_mm`.
    """
    ground = prepare(patch, wishes)
    on_patch = ground.seeds.within(patch.domain)
    gouge_mm = check_reach(ground.surface, on_patch, accuracy_mm)
    if wishes.scallop_mm is not None:
        feeds = solve_pick_feeds(ground, wishes.scallop_mm, accuracy_mm=accuracy_mm, high_mm=wishes.high_mm)
        if feeds.end is not ChainEnd.SETTLED:
            raise InputRejected(f"{patch.name}: {feeds.end.value}{_place(feeds.peaks)}", remedy="give pick_feed_mm")
        planes_mm, peaks, within = feeds.planes_mm, feeds.peaks, feeds.peaks
    else:
        assert wishes.pick_feed_mm is not None
        planes_mm = even_planes(ground, wishes.pick_feed_mm)
        within = survey(ground, planes_mm, wishes.pick_feed_mm**2 / (8 * wishes.radius_mm))[0]
        peaks = with_one_sided(ground, planes_mm, within)
    if wishes.rolls_over:
        return _over_the_edge(ground, planes_mm, (within, peaks), wishes, accuracy_mm, reading_mm)
    curves = run_passes(ground, planes_mm, wishes.angle_rad, accuracy_mm=reading_mm)
    peaks = with_traced(ground, planes_mm, within, peaks, curves)
    on_passes = np.concatenate([curve.parameters for curve in curves]).T
    gouge_mm = max(gouge_mm, check_beyond(ground.surface, on_passes, on_patch, accuracy_mm))
    return Layout(tuple(curves), np.arange(len(curves)), planes_mm, peaks, ground, gouge_mm)


def prepare(patch: NurbsPatch, wishes: Wishes) -> Ground:
    """The patch turned into the frame of the passes, checked, offset, seeded, its border sampled."""
    seen = survey_patch(patch)
    side = tool_side(seen)
    check_creases(patch)
    check_radius(seen, side, wishes.radius_mm, wishes.stock_mm)
    surface = OffsetSurface(patch.turned(wishes.angle_rad), wishes.radius_mm, side, wishes.stock_mm)
    seeds = _seeds(surface, 2 * wishes.radius_mm)
    if wishes.pick_feed_mm is not None:
        least_mm = wishes.pick_feed_mm
        _check_count(surface, seeds, least_mm, "pick_feed_mm")
    else:
        assert wishes.scallop_mm is not None
        inside = seeds.within(patch.domain)
        least_mm = float(local_pick_feed(surface, inside, wishes.scallop_mm).min())
        # What path_mm leaves of the scallop is planned, and pick feeds go with the square root of it.
        left = left_for_exact_mm(wishes.scallop_mm, wishes.high_mm, wishes.radius_mm) / wishes.scallop_mm
        _check_count(surface, seeds, least_mm * max(left, 0.0) ** 0.5, "scallop_mm")
    return lay_ground(surface, seeds, pick_feed_mm=least_mm)


def _seeds(surface: OffsetSurface, reach_mm: float) -> Seeds:
    """Seeds over the patch and this far beyond it, as dense as spans are few."""
    spans = len(surface.patch.basis_u.starts) * len(surface.patch.basis_v.starts)
    return sow(surface, reach_mm=reach_mm, a_span=2 if spans > 400 else 4 if spans > 25 else 16)


def _check_count(
    surface: OffsetSurface, seeds: Seeds, pick_feed_mm: float, key: str, most: int = 20_000, longest_mm: float = 5e6
) -> None:
    """Raises InputRejected where the patch would take more passes, or a longer way, than a plan can hold in memory.

    Its borders are sampled as finely as its passes lie, so the longer side counts.
    """
    inside = seeds.within(surface.patch.domain)
    sides_mm = np.ptp(surface.evaluate(inside[0], inside[1]).contact[:2], axis=1)
    passes, cut_mm = (float(size) / max(pick_feed_mm, 1e-12) for size in (sides_mm.max(), sides_mm.prod()))
    problem = ""
    if not passes <= most:
        problem = f"{passes:.3g} passes, more than {most}"
    elif not cut_mm <= longest_mm:
        problem = f"{cut_mm / 1e6:.3g} km of passes, more than {longest_mm / 1e6:g} km"
    if problem:
        what = f"{surface.patch.name} is {sides_mm[0]:.4g} x {sides_mm[1]:.4g} mm: {key} asks for about {problem}"
        finer = " or a smaller path_mm, which leaves it more," if key == "scallop_mm" else ""
        remedy = f"give a larger {key}{finer} or cut the part in pieces"
        raise InputRejected(what, remedy=remedy, key=("operation", 0, key))


def _place(peaks: Peaks) -> str:
    """Where the highest gap is, for a message."""
    if not len(peaks.height_mm):
        return ""
    u, v = peaks.foot[:, int(np.argmax(peaks.height_mm))]
    return f", near (u, v) = ({u:.4g}, {v:.4g})"


def _over_the_edge(
    ground: Ground, planes_mm: Array, found: tuple[Peaks, Peaks], wishes: Wishes, accuracy_mm: float, reading_mm: float
) -> Layout:
    """The passes in these planes, and more, over the edge of the patch.

    `found` are the peaks up to the border, without and with what it holds where one pass alone reaches it.
    """
    out_mm = min(_feed_at_border(ground, wishes), FURTHEST_OUT * wishes.radius_mm)
    rolling = roll_over(ground.surface, planes_mm, out_mm=out_mm, pick_feed_mm=wishes.pick_feed_mm)
    needed = _needed_runs(ground, planes_mm, join_mm=0.0)
    if not rolling.covers(needed.owner, needed.x):
        what = f"{ground.surface.patch.name} falls too steeply to its edge, or runs too nearly along the passes there"
        raise InputRejected(
            f"{what}, for passes to roll over it", remedy='use edge = "to-border", or another angle_deg'
        )
    seeds = _seeds(rolling.surface, 1.1 * out_mm)
    gouge_mm = check_reach(rolling.surface, seeds.within(rolling.surface.rim), accuracy_mm)
    planes = [DrivingPlane(wishes.angle_rad, float(rolling.planes_mm[one])) for one in rolling.plane]
    spacing_mm = ground.station_mm / 2
    curves = trace(rolling.surface, seeds, planes, rolling.runs, spacing_mm=spacing_mm, accuracy_mm=reading_mm)
    return Layout(
        tuple(within_patch(curve, ground.surface) for curve in curves),
        rolling.owner,
        rolling.planes_mm,
        rolling.peaks_of(with_traced(ground, planes_mm, *found, curves)),
        ground,
        gouge_mm,
    )


def _feed_at_border(ground: Ground, wishes: Wishes) -> float:
    """The pick feed, or the largest that the scallop allows anywhere at the border, (15)."""
    if wishes.pick_feed_mm is not None:
        return wishes.pick_feed_mm
    assert wishes.scallop_mm is not None
    return float(local_pick_feed(ground.surface, ground.border.parameters, wishes.scallop_mm).max())


def _needed_runs(ground: Ground, planes_mm: Array, *, join_mm: float) -> Pieces:
    """Where passes up to the border must run."""
    heights = border_heights(ground.surface, ground.border, planes_mm)
    ends = border_cusps(ground.surface, ground.border, heights, planes_mm)
    crossed = crossings(ground.surface, ground.border, planes_mm)
    return pass_runs(ground.surface, planes_mm, heights, ends, crossed, join_mm=join_mm)


def run_passes(ground: Ground, planes_mm: Array, angle_rad: float, *, accuracy_mm: float) -> list[TracedCurve]:
    """Every pass traced where it is needed: one curve a connected piece, in order of planes, then along +w."""
    join_mm = 2 * float(np.diff(planes_mm).max(initial=ground.station_mm))
    needed = _needed_runs(ground, planes_mm, join_mm=join_mm)
    if not len(needed.owner):
        raise InputRejected("no pass meets the part", remedy="check angle_deg, pick_feed_mm and the surface")
    short = np.maximum(join_mm / 4 - (needed.x[:, 1] - needed.x[:, 0]), 0.0) / 2
    runs = needed.x + np.stack([-short, short], axis=1)
    planes = [DrivingPlane(angle_rad, float(planes_mm[one])) for one in needed.owner]
    # Across a seam the parameters leap, and stand on no other sheet.
    ends = None if any(closes(ground.surface)) else (needed.x, needed.parameters)
    spacing_mm = ground.station_mm / 2
    return trace(ground.surface, ground.seeds, planes, runs, spacing_mm=spacing_mm, accuracy_mm=accuracy_mm, ends=ends)
