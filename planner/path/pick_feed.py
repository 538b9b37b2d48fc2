"""Pick feeds: where driving planes must stand so that every gap reaches the asked scallop in one place.

All gaps are solved together. Each sweep measures the true maximum of every gap and how it moves with its two planes;
as every gap depends on its own two planes only, Newton's equations for the whole chain are solved from the first
plane to the last in one go. Derivation: EQUATIONS.md, section 5; the outcome is that of the thesis's (3.25)-(3.27).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from planner.path.border import Border
from planner.path.coverage import GapCusps
from planner.path.offset import OffsetSurface
from planner.path.one_sided import with_one_sided
from planner.path.peaks import Ground, Peaks, strip_behind, survey, survey_at

Array = NDArray[np.float64]

NEAR_CEILING = (1e-6, 0.01)  # of a pick feed: nearer than this to one that is too wide no gap is made


class ChainEnd(Enum):
    """How the search for pick feeds ended; the value is the sentence for the user."""

    SETTLED = "every gap reaches the asked scallop in one place"
    RAN_OUT = "the pick feeds did not settle within their sweeps"
    LOST = "a scallop between two passes could not be measured"
    OPEN = "no last pass brings the border behind it down to the asked scallop"


@dataclass(frozen=True, slots=True)
class Brackets:
    """The widest pick feeds (passes - 1,) known to be too narrow, and the narrowest known to be too wide."""

    floor_mm: Array
    ceiling_mm: Array


@dataclass(frozen=True, slots=True)
class PickFeeds:
    """Driving planes `planes_mm` (passes,), the measured peaks between them, and how the search ended."""

    planes_mm: Array
    peaks: Peaks
    end: ChainEnd


def solve_pick_feeds(
    exact: Ground, scallop_mm: float, *, accuracy_mm: float, high_mm: float = 0.0, sweeps: int = 160
) -> PickFeeds:
    """The fewest parallel planes whose passes leave at most `scallop_mm` anywhere, each as far on as it can be.

    Passes may stand `high_mm` off the exact ones, eq. (18); the peaks that are returned are those of the exact ones.
    `accuracy_mm` bounds what is left open of each gap's height. The first pass is the furthest that keeps the border
    before it, the last the first that keeps the border behind it. Between full surveys the chain is settled on all
    maxima that the surveys have found, so that two that outdo each other in turn are both kept in sight.
    """
    ground = replace(exact, surface=replace(exact.surface, high_mm=high_mm))
    planes = _first_chain(ground, left_for_exact_mm(scallop_mm, high_mm, ground.surface.radius_mm))
    peaks, tops = survey(ground, planes, scallop_mm, coarse=4)
    peaks = replace(peaks, missed=0)  # what a wide search loses, the full one may find
    end, is_full, is_strict = ChainEnd.RAN_OUT, False, False
    known = Brackets(np.zeros(len(planes) - 1), np.full(len(planes) - 1, np.inf))
    for _ in range(sweeps):
        known = _brackets(known, planes, peaks, scallop_mm, accuracy_mm)
        is_settled = _error(planes, peaks, known, scallop_mm) <= accuracy_mm
        if is_settled and is_full and peaks.missed:
            end = ChainEnd.LOST  # before the planes stand still, a cusp that is not found may be none
            break
        if is_settled and is_full:
            # Places that one pass alone reaches come and go while the planes move far: they count at the end.
            is_strict, peaks = True, with_one_sided(ground, planes, peaks, scallop_mm)
            is_settled = _error(planes, peaks, known, scallop_mm) <= accuracy_mm and not peaks.missed
            if is_settled:
                end = ChainEnd.SETTLED
                break
        if not is_settled:
            planes = _newton_chain(planes, peaks, known, scallop_mm)
        is_full = is_settled
        if is_full:
            tops = tops.with_more(survey(ground, planes, scallop_mm)[1])
            known = replace(known, floor_mm=0 * known.floor_mm)  # with more maxima a feed may be too wide after all
        peaks = survey_at(ground, planes, tops)
        peaks = with_one_sided(ground, planes, peaks, scallop_mm) if is_strict else peaks
    planes = _with_last(ground, planes, scallop_mm, accuracy_mm)
    peaks, tops = _trimmed(ground, peaks, tops, planes, scallop_mm)
    peaks = with_one_sided(ground, planes, peaks, scallop_mm)
    end = _judged(peaks, scallop_mm + accuracy_mm) if end is ChainEnd.SETTLED else end
    if high_mm:
        peaks = replace(survey_at(exact, planes, tops), missed=peaks.missed)
        peaks = with_one_sided(exact, planes, peaks, scallop_mm - high_mm)
    return PickFeeds(planes, peaks, end)


def left_for_exact_mm(scallop_mm: float, high_mm: float, radius_mm: float) -> float:
    """How high exact passes may leave a cusp on level ground where the written ones stand `high_mm` off, eq. (18)."""
    return scallop_mm - high_mm * radius_mm / (radius_mm - scallop_mm)


def _judged(peaks: Peaks, most_mm: float) -> ChainEnd:
    """How a settled chain ended, by what the planes that were kept leave: at most `most_mm`, or not."""
    if float(peaks.height_mm.max(initial=0.0)) > most_mm:
        return ChainEnd.LOST
    return ChainEnd.OPEN if peaks.last_mm > most_mm else ChainEnd.SETTLED


def _brackets(known: Brackets, planes_mm: Array, peaks: Peaks, scallop_mm: float, accuracy_mm: float) -> Brackets:
    """The brackets with what these peaks say.

    At some feeds the height jumps, because the upper pass misses the part beyond, or a piece of the border comes into
    the gap, and Newton's method would step over them again and again. A bracket holds only as long as the lower pass
    of its gap stands still.
    """
    is_off = _off(planes_mm, peaks, known, scallop_mm) > accuracy_mm
    is_first_off = abs(peaks.first_mm - scallop_mm) > accuracy_mm
    is_still: NDArray[np.bool_] = np.cumsum(np.append(is_first_off, is_off))[:-1] == 0
    floor_mm, ceiling_mm = np.where(is_still, known.floor_mm, 0.0), np.where(is_still, known.ceiling_mm, np.inf)
    feeds = np.diff(planes_mm)
    is_narrow = is_still & (peaks.height_mm > 0) & (peaks.height_mm < scallop_mm - accuracy_mm) & (peaks.by_b > 0)
    is_wide = is_still & (peaks.height_mm > scallop_mm + accuracy_mm)
    floor_mm = np.where(is_narrow, np.maximum(floor_mm, feeds), floor_mm)
    ceiling_mm = np.where(is_wide, np.minimum(ceiling_mm, feeds), ceiling_mm)
    # A floor that the ceiling has come down to was seen while the lower pass stood a trifle elsewhere: it is none.
    is_stale = is_wide & (ceiling_mm - floor_mm < NEAR_CEILING[0] * feeds)
    return Brackets(np.where(is_stale, 0.0, floor_mm), ceiling_mm)


def _off(planes_mm: Array, peaks: Peaks, known: Brackets, scallop_mm: float) -> Array:
    """How far every gap (passes - 1,) is from the asked height.

    A gap that stays below it wherever its upper pass may stand is not waited for. Below a ceiling that is one whose
    slope does not lead to that height, where what is missing is ten times as large a share as what is left of the feed.
    """
    feeds = np.diff(planes_mm)
    room = known.ceiling_mm - feeds
    near = np.clip(0.1 * (1 - peaks.height_mm / scallop_mm), *NEAR_CEILING) * feeds
    with np.errstate(invalid="ignore"):
        is_jump = (room < near) & (peaks.height_mm + peaks.by_b * room < scallop_mm)
    is_widest = (peaks.by_b <= 0) | is_jump
    is_open = (peaks.height_mm > 0) & ~(is_widest & (peaks.height_mm < scallop_mm))
    return np.where(is_open, np.abs(peaks.height_mm - scallop_mm), 0.0)


def _error(planes_mm: Array, peaks: Peaks, known: Brackets, scallop_mm: float) -> float:
    """How far the worst gap, or the first strip, is from the asked height."""
    off = _off(planes_mm, peaks, known, scallop_mm)
    return max(float(off.max(initial=0.0)), abs(peaks.first_mm - scallop_mm))


def _trimmed(
    ground: Ground, peaks: Peaks, tops: GapCusps, planes_mm: Array, scallop_mm: float
) -> tuple[Peaks, GapCusps]:
    """The peaks and the interior maxima of the planes that were kept, the last gap measured anew."""
    if len(planes_mm) < 3:
        return survey(ground, planes_mm, scallop_mm)
    last, of_last = survey(ground, planes_mm[-2:], scallop_mm)
    kept = len(planes_mm) - 2
    is_kept = tops.gap < kept
    tops = GapCusps(tops.gap[is_kept], tops.cusps.take(is_kept)).with_more(GapCusps(of_last.gap + kept, of_last.cusps))

    def joined(name: str) -> Array:
        return np.concatenate([getattr(peaks, name)[..., :kept], getattr(last, name)], axis=-1)

    trimmed = replace(
        peaks,
        height_mm=joined("height_mm"),
        by_a=joined("by_a"),
        by_b=joined("by_b"),
        x=joined("x"),
        foot=joined("foot"),
        last_mm=last.last_mm,
        missed=peaks.missed + last.missed,
    )
    return trimmed, tops


def even_planes(ground: Ground, pick_feed_mm: float) -> Array:
    """Planes this far apart, centred on the patch so that both border strips are at most half as wide."""
    y = ground.border.points.centre[1]
    low, high = float(y.min()), float(y.max())
    count = max(int(np.ceil((high - low) / pick_feed_mm - 1e-9)), 1)
    inset = (high - low - (count - 1) * pick_feed_mm) / 2
    return np.asarray(low + inset + pick_feed_mm * np.arange(count), dtype=np.float64)


def local_pick_feed(surface: OffsetSurface, parameters: Array, scallop_mm: float) -> Array:
    """Pick feed (m,) for this scallop from slope and curvature across the pass at each place (2, m), eq. (15)."""
    found = surface.evaluate(parameters[0], parameters[1])
    normal = found.normal
    length = np.hypot(normal[0], normal[2])
    across = np.stack([-normal[0] * normal[1] / length, length])
    determinant = found.centre_u[0] * found.centre_v[1] - found.centre_u[1] * found.centre_v[0]
    step_u = (across[0] * found.centre_v[1] - across[1] * found.centre_v[0]) / determinant
    step_v = (across[1] * found.centre_u[0] - across[0] * found.centre_u[1]) / determinant
    turn = step_u * found.normal_u + step_v * found.normal_v
    ahead = step_u * found.centre_u + step_v * found.centre_v
    bend = np.clip(surface.radius_mm * (turn * ahead).sum(axis=0), -10.0, 0.9)
    return np.asarray(length * 2 * np.sqrt(scallop_mm * (2 * surface.radius_mm - scallop_mm) / (1 - bend)))


def _first_chain(ground: Ground, scallop_mm: float) -> Array:
    """A guess of all planes: step by the least local pick feed, beyond the last border point."""
    inside = ground.seeds.within(ground.surface.patch.domain)
    y = ground.surface.evaluate(inside[0], inside[1]).centre[1]
    feed = local_pick_feed(ground.surface, inside, scallop_mm)
    low, high = float(y.min()), float(y.max())
    bins = np.clip(((y - low) / max(high - low, 1e-12) * 32).astype(np.intp), 0, 31)
    least = np.full(32, np.inf)
    np.minimum.at(least, bins, feed)
    middles = low + (np.arange(32) + 0.5) * (high - low) / 32
    known = np.isfinite(least)
    planes = [low + 0.4 * float(least[known][0])]
    while planes[-1] < high + float(least[known][-1]):
        planes.append(planes[-1] + float(np.interp(planes[-1], middles[known], least[known])))
    return np.array(planes)


def _newton_chain(planes_mm: Array, peaks: Peaks, known: Brackets, scallop_mm: float) -> Array:
    """Moves of all planes from the linearised heights, eq. (16); a gap changes by at most 40 % a sweep.

    A gap that would go more than half the way across its bracket goes to its middle; one that stays below the asked
    height keeps its feed.
    """
    feeds = np.diff(planes_mm)
    is_left = (_off(planes_mm, peaks, known, scallop_mm) == 0) & (peaks.by_b > 0)
    moves = np.zeros(len(planes_mm))
    limit = 0.4 * float(feeds[0])
    moves[0] = np.clip((scallop_mm - peaks.first_mm) / max(peaks.first_by, 1e-9), -limit, limit)
    grown = 1.0
    for gap in range(len(feeds)):
        height, floor_mm, ceiling_mm = peaks.height_mm[gap], known.floor_mm[gap], known.ceiling_mm[gap]
        wanted = 0.0 if is_left[gap] else None
        if height > 0 and peaks.by_b[gap] > 0 and wanted is None:
            wanted = (scallop_mm - height - peaks.by_a[gap] * moves[gap]) / peaks.by_b[gap] - moves[gap]
        elif height > scallop_mm:  # only the lower pass comes there: the upper one must come nearer
            wanted = -0.1 * feeds[gap]
        if wanted and abs(wanted) > (ceiling_mm - floor_mm) / 2:
            wanted = (floor_mm + ceiling_mm) / 2 - feeds[gap]
        if wanted is not None:
            grown = 1 + float(np.clip(wanted / feeds[gap], -0.4, 0.4))
        moves[gap + 1] = moves[gap] + (grown - 1) * feeds[gap]
    return planes_mm + moves


def _with_last(ground: Ground, planes_mm: Array, scallop_mm: float, accuracy_mm: float) -> Array:
    """The planes up to the first pass that keeps the border behind it, that one drawn back as far as sense goes.

    It is drawn back until it just keeps the border, but not so far that it no longer touches a side of the patch that
    lies wholly behind the pass before it: that side is the edge it is there to finish.
    """
    y_high = float(ground.border.points.centre[1].max())
    feed = float(np.diff(planes_mm).max(initial=0.0))
    for last in range(int(np.searchsorted(planes_mm, y_high - 3 * feed)), len(planes_mm)):
        if strip_behind(ground, planes_mm[: last + 1])[0] <= scallop_mm + accuracy_mm:
            planes_mm = planes_mm[: last + 1]
            break
    before = float(planes_mm[-2]) if len(planes_mm) > 1 else -np.inf
    floor = min(_edge_behind(ground.border, before), float(planes_mm[-1]))
    place, best = min(float(planes_mm[-1]), y_high - 0.3 * feed), float(planes_mm[-1])
    for _ in range(20):
        height, by_plane = strip_behind(ground, np.append(planes_mm[:-1], place))
        if height <= scallop_mm + accuracy_mm:
            best = min(best, place)
        if abs(height - scallop_mm) <= accuracy_mm or by_plane >= 0 or best <= floor:
            break
        place = float(np.clip(place - (height - scallop_mm) / by_plane, before, planes_mm[-1]))
    return np.append(planes_mm[:-1], max(best, floor))


def _edge_behind(border: Border, plane_mm: float) -> float:
    """The least y of a side whose ball centres all stand behind this plane; minus infinity if no side does."""
    y = border.points.centre[1]
    sides = [
        y[(border.held == held) & (border.value == value)]
        for held, value in set(zip(border.held, border.value, strict=True))
    ]
    return max((float(side.min()) for side in sides if side.min() > plane_mm), default=-np.inf)
