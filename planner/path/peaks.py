"""The highest cusp of every gap and the greatest heights on the border: continuous maxima, not samples.

A cusp line's maximum is an end of the line on the border or a place where its slope along the pass is zero
(eqs. 3.20-3.24 of the thesis). Stations along each line find where the slope changes its sign; they stand closer where
the line between two of them, read from these, does not agree with the line itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.path.border import Border, border_of
from planner.path.border_tops import hermite_top, tops_between
from planner.path.coverage import (
    BorderHeights,
    GapCusps,
    best_of_each,
    border_cusps,
    border_heights,
    border_jumps,
    guess_from,
    inner_cusps,
    stretches,
)
from planner.path.offset import OffsetSurface
from planner.path.scallop import CuspGuess, Cusps
from planner.path.seeds import Seeds

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Peaks:
    """The highest cusp of every gap, arrays (passes - 1,); height 0 where no cusp lies on the patch.

    `by_a`, `by_b` are the changes of the height with the lower and the upper plane; `x` and `foot` (2, ...) say where.
    `first_mm`, `last_mm` are the greatest heights that the first and last pass leave on the border beyond them,
    `first_by` the change of the first with its plane. `missed` counts cusps that Newton's method did not find.
    """

    height_mm: Array
    by_a: Array
    by_b: Array
    x: Array
    foot: Array
    first_mm: float
    first_by: float
    last_mm: float
    missed: int


@dataclass(frozen=True, slots=True)
class Ground:
    """A surface ready for planning: in the frame of the passes (+x along them), with seeds and sampled border."""

    surface: OffsetSurface
    seeds: Seeds
    border: Border
    station_mm: float


def survey(ground: Ground, planes_mm: Array, height_mm: float, *, coarse: int = 1) -> tuple[Peaks, GapCusps]:
    """The true maxima of all gaps, of the first and of the last strip, and the interior maxima by themselves.

    `height_mm` is where Newton starts; `coarse` spreads the stations that many times further.
    """
    heights = border_heights(ground.surface, ground.border, planes_mm)
    ends = border_cusps(ground.surface, ground.border, heights, planes_mm)
    gaps, start, stop = stretches(ends, border_jumps(ground.border, heights))
    stretch, x = _stations(start, stop, coarse * ground.station_mm)
    inner = inner_cusps(ground.surface, ground.seeds, planes_mm, gaps[stretch], x, height_mm)
    inner = _called_back(ground, inner, stretch, x, planes_mm)
    if coarse == 1:
        inner, stretch = _closer(ground, inner, stretch, planes_mm, ends, within_mm=1e-4 * height_mm)
    tops = _inside(ground, _tops(ground, inner, stretch, planes_mm))
    missed = int((~inner.cusps.is_found).sum())
    return _peaks(ground, heights, planes_mm, ends, tops, missed), tops


def survey_at(ground: Ground, planes_mm: Array, tops: GapCusps) -> Peaks:
    """The maxima as `survey` finds them if the interior ones stay in place: cheap, for planes that moved a little.

    A maximum from which the planes have moved far may be none any more: where its cusp is not found it is left out.
    """
    heights = border_heights(ground.surface, ground.border, planes_mm)
    ends = border_cusps(ground.surface, ground.border, heights, planes_mm)
    guess = guess_from(tops.cusps)
    moved = inner_cusps(ground.surface, ground.seeds, planes_mm, tops.gap, tops.cusps.x, 0.0, guess)
    lost = np.flatnonzero(~moved.cusps.is_found)
    if len(lost):
        again = inner_cusps(ground.surface, ground.seeds, planes_mm, tops.gap[lost], tops.cusps.x[lost], 0.0)
        moved = moved.with_more(again)
    return _peaks(ground, heights, planes_mm, ends, _inside(ground, moved), 0)


def profile(ground: Ground, planes_mm: Array, gap: int, count: int) -> tuple[Array, Array]:
    """The cusp line of one gap: places x and heights, about `count` of each, inside the border."""
    heights = border_heights(ground.surface, ground.border, planes_mm)
    ends = border_cusps(ground.surface, ground.border, heights, planes_mm)
    gaps, start, stop = stretches(ends, border_jumps(ground.border, heights))
    start, stop = start[gaps == gap], stop[gaps == gap]
    _, x = _stations(start, stop, max(float(np.sum(stop - start)) / count, 1e-3))
    found = inner_cusps(ground.surface, ground.seeds, planes_mm, np.full(len(x), gap), x, 0.0).cusps
    return x[found.is_found], found.height_mm[found.is_found]


def strip_behind(ground: Ground, planes_mm: Array) -> tuple[float, float]:
    """The greatest height on the border behind the last of these planes, and its change by that plane."""
    last = planes_mm[-1:]
    return _strip_peak(ground, border_heights(ground.surface, ground.border, last), last, 1)


def lay_ground(surface: OffsetSurface, seeds: Seeds, *, pick_feed_mm: float) -> Ground:
    """The ground for passes about this far apart: the border is sampled four times as densely."""
    spans = len(surface.patch.basis_u.starts) * len(surface.patch.basis_v.starts)
    span = np.sqrt(np.ptp(seeds.centres, axis=1).prod() / spans)
    border = border_of(surface, spacing_mm=pick_feed_mm / 4)
    return Ground(surface, seeds, border, station_mm=float(min(surface.radius_mm, span)))


def _stations(start: Array, stop: Array, spacing_mm: float) -> tuple[Indices, Array]:
    """Places along each stretch and its index: both ends included, at most `spacing_mm` apart and at least 5."""
    counts = np.maximum(np.ceil((stop - start) / spacing_mm), 4).astype(np.intp) + 1
    owner = np.repeat(np.arange(len(start)), counts)
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = rank / (counts[owner] - 1)
    return owner, start[owner] + share * (stop - start)[owner]


def _called_back(
    ground: Ground, inner: GapCusps, stretch: Indices, x: Array, planes_mm: Array, rounds: int = 3
) -> GapCusps:
    """The stations at places `x` (m,), those off the patch solved anew from what lies on it on both sides of them.

    Their lines run on the patch; but beside a slot it may be carried on from one side over the other.
    """
    for _ in range(rounds):
        is_good = _is_inside(ground, inner, room=1e-6)
        bad, good = np.flatnonzero(~is_good), np.flatnonzero(is_good)
        if not len(bad) or not len(good):
            break
        after = np.minimum(np.searchsorted(good, bad), len(good) - 1)
        sides = np.stack([good[np.maximum(after - 1, 0)], good[after]])
        is_own = stretch[sides] == stretch[bad]
        sides = np.where(is_own, sides, sides[::-1])
        bad, sides = bad[is_own.any(axis=0)], sides[:, is_own.any(axis=0)]
        share = np.clip((x[bad] - x[sides[0]]) / np.maximum(x[sides[1]] - x[sides[0]], 1e-12), 0.0, 1.0)
        low, high = (_start(inner.cusps.take(side)) for side in sides)
        near = CuspGuess(*(one + share * (other - one) for one, other in zip(low, high, strict=True)))
        again = inner_cusps(ground.surface, ground.seeds, planes_mm, inner.gap[bad], x[bad], 0.0, near)
        kept = np.delete(np.arange(len(x)), bad)
        both = GapCusps(inner.gap[kept], inner.cusps.take(kept)).with_more(again)
        order = np.argsort(np.append(kept, bad))
        inner = GapCusps(both.gap[order], both.cusps.take(order))
    return inner


def _closer(
    ground: Ground,
    inner: GapCusps,
    stretch: Indices,
    planes_mm: Array,
    ends: GapCusps,
    *,
    within_mm: float,
    rounds: int = 8,
) -> tuple[GapCusps, Indices]:
    """Stations halved until cubics (14) read every line within `within_mm` where it may be the highest of its gap.

    The middle between two stations is solved and held against the cubic through their heights and slopes.
    """
    highest = np.zeros(len(planes_mm))
    for known in (inner, ends):
        np.maximum.at(highest, known.gap, np.where(known.cusps.is_found, known.cusps.height_mm, 0.0))
    left = np.flatnonzero(stretch[1:] == stretch[:-1])
    for _ in range(rounds):
        low, high = inner.cusps.take(left), inner.cusps.take(left + 1)
        near = CuspGuess(*((one + other) / 2 for one, other in zip(_start(low), _start(high), strict=True)))
        run = high.x - low.x
        gap = inner.gap[left]
        middle = inner_cusps(ground.surface, ground.seeds, planes_mm, gap, low.x + run / 2, 0.0, near)
        height, slope = middle.cusps.height_mm, middle.cusps.slope
        read = (low.height_mm + high.height_mm) / 2 + run / 8 * (low.slope - high.slope)
        turn = 1.5 * (high.height_mm - low.height_mm) - run / 4 * (low.slope + high.slope) - run * slope
        off = np.maximum(np.abs(height - read), np.abs(turn) / 4)
        np.maximum.at(highest, gap, np.where(middle.cusps.is_found, height, 0.0))
        # Between two stations a cubic rises above the higher of them by at most a quarter of run times slope.
        climb = run / 4 * np.maximum(np.abs(low.slope), np.abs(high.slope))
        top = np.maximum(height, np.maximum(low.height_mm, high.height_mm)) + climb + 4 * off
        is_open = middle.cusps.is_found & (off > within_mm) & (top > highest[gap])
        inner = inner.with_more(middle)
        stretch = np.append(stretch, stretch[left])
        is_new = np.append(np.zeros(len(stretch) - len(left), dtype=bool), is_open)
        order = np.lexsort((inner.cusps.x, stretch))
        inner, stretch, is_new = GapCusps(inner.gap[order], inner.cusps.take(order)), stretch[order], is_new[order]
        at = np.flatnonzero(is_new)
        if not len(at):
            break
        left = np.sort(np.append(at - 1, at))
    return inner, stretch


def _start(cusps: Cusps) -> tuple[Array, ...]:
    """Foot, height and both balls, as CuspGuess has them."""
    return cusps.foot, cusps.height_mm, cusps.on_a, cusps.on_b


def _tops(ground: Ground, inner: GapCusps, stretch: Indices, planes_mm: Array, rounds: int = 3) -> GapCusps:
    """Interior maxima: the slope's zero between two stations, by repeated interpolation.

    Of each gap those are followed that promise nine tenths of its highest.
    """
    cusps, gap = inner.cusps, inner.gap
    rises = (stretch[1:] == stretch[:-1]) & (cusps.slope[:-1] > 0) & (cusps.slope[1:] < 0)
    left = np.flatnonzero(rises)
    top, place = hermite_top(*_bracket(cusps, left, left + 1))
    best = best_of_each(gap[left], top)
    highest = np.zeros(len(planes_mm))
    highest[gap[left[best]]] = top[best]
    best = np.flatnonzero(top >= 0.9 * highest[gap[left]])
    left, place, right = left[best], place[best], left[best] + 1
    low, high = cusps.take(left), cusps.take(right)
    found = inner_cusps(ground.surface, ground.seeds, planes_mm, gap[left], place, 0.0, guess_from(low))
    for _ in range(rounds):
        is_before = found.cusps.slope > 0
        low, high = _choose(is_before, found.cusps, low), _choose(is_before, high, found.cusps)
        _, place = hermite_top(low.x, high.x, low.height_mm, high.height_mm, low.slope, high.slope)
        found = inner_cusps(ground.surface, ground.seeds, planes_mm, gap[left], place, 0.0, guess_from(found.cusps))
    return found


def _inside(ground: Ground, found: GapCusps) -> GapCusps:
    """The cusps that were found on the patch."""
    is_inside = _is_inside(ground, found)
    return GapCusps(found.gap[is_inside], found.cusps.take(is_inside))


def _is_inside(ground: Ground, found: GapCusps, room: float = 0.0) -> NDArray[np.bool_]:
    """Which cusps (k,) were found on the patch, or no further off it than `room` of its domain."""
    low, high = np.array(ground.surface.patch.domain).T[:, :, None]
    slack = room * (high - low)
    is_on = (found.cusps.foot >= low - slack) & (found.cusps.foot <= high + slack)
    return np.asarray(found.cusps.is_found & is_on.all(axis=0))


def _bracket(cusps: Cusps, left: Indices, right: Indices) -> Iterator[Array]:
    for values in (cusps.x, cusps.height_mm, cusps.slope):
        yield values[left]
        yield values[right]


def _choose(flags: NDArray[np.bool_], yes: Cusps, no: Cusps) -> Cusps:
    names = Cusps.__slots__
    return Cusps(*(np.where(flags, getattr(yes, name), getattr(no, name)) for name in names))


def _peaks(
    ground: Ground, heights: BorderHeights, planes_mm: Array, ends: GapCusps, tops: GapCusps, missed: int
) -> Peaks:
    """The highest cusp of each gap among the ends of its lines and its interior maxima."""
    both = ends.with_more(tops)
    gap, every = both.gap, both.cusps
    best = best_of_each(gap, np.where(every.is_found, every.height_mm, -np.inf))
    best = best[every.is_found[best]]
    height, by_a, by_b, x = (np.zeros(len(planes_mm) - 1) for _ in range(4))
    foot = np.zeros((2, len(planes_mm) - 1))
    for column, values in ((height, every.height_mm), (by_a, every.by_a), (by_b, every.by_b), (x, every.x)):
        column[gap[best]] = values[best]
    foot[:, gap[best]] = every.foot[:, best]
    first_mm, first_by = _strip_peak(ground, heights, planes_mm, 0)
    last_mm, _ = _strip_peak(ground, heights, planes_mm, len(planes_mm))
    missed += int((~every.is_found).sum())
    return Peaks(height, by_a, by_b, x, foot, first_mm, first_by, last_mm, missed)


def _strip_peak(ground: Ground, heights: BorderHeights, planes_mm: Array, gap: int) -> tuple[float, float]:
    """The greatest height on the border before the first (gap 0) or behind the last pass; its change by the plane."""
    chosen = np.flatnonzero(heights.gap == gap)
    if not len(chosen):
        return 0.0, 1.0
    levels, reaches = (heights.above, heights.upper) if gap == 0 else (heights.below, heights.lower)
    plane_mm = float(planes_mm[0 if gap == 0 else -1])
    at = int(chosen[np.argmax(levels[chosen])])
    best = float(levels[at]), float(reaches.by_plane[at])
    chosen = chosen[np.isfinite(levels[chosen])]
    onward = ground.border.after(chosen)
    chosen = chosen[(heights.gap[onward] == gap) & np.isfinite(levels[onward])]
    planes, least = np.full(len(chosen), plane_mm), np.full(len(chosen), 0.9 * best[0])
    _, tops = tops_between(ground.surface, ground.border, chosen, planes, (levels, reaches), least)
    heights_mm = np.where(tops.is_found, tops.height_mm, -np.inf)
    return max([best, *zip(heights_mm.tolist(), tops.by_plane.tolist(), strict=True)])
