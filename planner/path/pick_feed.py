"""Pick feeds: where driving planes must stand so that every gap reaches the asked scallop in one place.

All gaps are solved together. Each sweep measures the true maximum of every gap and how it moves with its two planes;
as every gap depends on its own two planes only, Newton's equations for the whole chain are solved from the first
plane to the last in one go. Derivation: EQUATIONS.md, section 5; the outcome is that of the thesis's (3.25)-(3.27).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from planner.path.border import Border, border_of
from planner.path.coverage import (
    BorderHeights,
    GapCusps,
    border_cusps,
    border_heights,
    guess_from,
    inner_cusps,
    stretches,
)
from planner.path.offset import OffsetSurface
from planner.path.scallop import Cusps, Held, Reaches, solve_reaches
from planner.path.seeds import Seeds

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class ChainEnd(Enum):
    """How the search for pick feeds ended; the value is the sentence for the user."""

    SETTLED = "every gap reaches the asked scallop in one place"
    RAN_OUT = "the pick feeds did not settle within their sweeps"
    LOST = "a scallop between two passes could not be measured"


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
class PickFeeds:
    """Driving planes `planes_mm` (passes,), the measured peaks between them, and how the search ended."""

    planes_mm: Array
    peaks: Peaks
    end: ChainEnd


@dataclass(frozen=True, slots=True)
class Ground:
    """A surface ready for planning: in the frame of the passes (+x along them), with seeds and sampled border."""

    surface: OffsetSurface
    seeds: Seeds
    border: Border
    station_mm: float


def survey(ground: Ground, planes_mm: Array, height_mm: float) -> Peaks:
    """The true maxima of all gaps, of the first and of the last strip, for these planes."""
    heights = border_heights(ground.surface, ground.border, planes_mm)
    ends = border_cusps(ground.surface, ground.border, heights, planes_mm)
    gap, x = _stations(*stretches(ends), ground.station_mm)
    inner = inner_cusps(ground.surface, ground.seeds, planes_mm, gap, x, height_mm)
    tops = _tops(ground, inner, planes_mm)
    first_mm, first_by = _strip_peak(ground, heights, planes_mm, 0)
    last_mm, _ = _strip_peak(ground, heights, planes_mm, len(planes_mm))
    return _highest(len(planes_mm) - 1, (ends, inner, tops), (first_mm, first_by, last_mm))


def solve_pick_feeds(ground: Ground, scallop_mm: float, *, accuracy_mm: float, sweeps: int = 12) -> PickFeeds:
    """The fewest parallel planes whose passes leave at most `scallop_mm` anywhere, each as far on as it can be.

    `accuracy_mm` bounds what is left open of each gap's height. The first pass is the furthest that keeps the border
    before it, the last the first that keeps the border behind it.
    """
    planes = _first_chain(ground, scallop_mm)
    end = ChainEnd.RAN_OUT
    for _ in range(sweeps):
        peaks = survey(ground, planes, scallop_mm)
        if peaks.missed:
            end = ChainEnd.LOST
            break
        is_open = peaks.height_mm > 0
        error = np.max(np.abs(np.append(peaks.height_mm[is_open], peaks.first_mm) - scallop_mm))
        if error <= accuracy_mm:
            end = ChainEnd.SETTLED
            break
        planes = _newton_chain(planes, peaks, scallop_mm)
    planes = _with_last(ground, planes, scallop_mm, accuracy_mm)
    return PickFeeds(planes, survey(ground, planes, scallop_mm), end)


def even_planes(ground: Ground, pick_feed_mm: float) -> Array:
    """Planes this far apart, centred on the patch so that both border strips are at most half as wide."""
    y = ground.border.points.centre[1]
    low, high = float(y.min()), float(y.max())
    count = max(int(np.ceil((high - low) / pick_feed_mm - 1e-9)), 1)
    inset = (high - low - (count - 1) * pick_feed_mm) / 2
    return np.asarray(low + inset + pick_feed_mm * np.arange(count), dtype=np.float64)


def lay_ground(surface: OffsetSurface, seeds: Seeds, *, pick_feed_mm: float) -> Ground:
    """The ground for passes about this far apart: the border is sampled five times as densely."""
    span = np.sqrt(np.ptp(seeds.centres, axis=1).prod() / max(_span_count(surface), 1))
    border = border_of(surface, spacing_mm=pick_feed_mm / 5)
    return Ground(surface, seeds, border, station_mm=float(min(surface.radius_mm, span / 2)))


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


def _span_count(surface: OffsetSurface) -> int:
    return len(surface.patch.basis_u.starts) * len(surface.patch.basis_v.starts)


def _first_chain(ground: Ground, scallop_mm: float) -> Array:
    """A guess of all planes: step by the least local pick feed, beyond the last border point."""
    inside = _inside(ground)
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


def _inside(ground: Ground) -> Array:
    """The seeds on the patch itself."""
    (u_low, u_high), (v_low, v_high) = ground.surface.patch.domain
    u, v = ground.seeds.parameters
    return ground.seeds.parameters[:, (u >= u_low) & (u <= u_high) & (v >= v_low) & (v <= v_high)]


def _newton_chain(planes_mm: Array, peaks: Peaks, scallop_mm: float) -> Array:
    """Moves of all planes from the linearised heights, eq. (16); a gap changes by at most 40 % a sweep."""
    feeds = np.diff(planes_mm)
    moves = np.zeros(len(planes_mm))
    limit = 0.4 * float(feeds[0])
    moves[0] = np.clip((scallop_mm - peaks.first_mm) / max(peaks.first_by, 1e-9), -limit, limit)
    grown = 1.0
    for gap in range(len(feeds)):
        height = peaks.height_mm[gap]
        if height > 0 and peaks.by_b[gap] > 0:
            wanted = (scallop_mm - height - peaks.by_a[gap] * moves[gap]) / peaks.by_b[gap] - moves[gap]
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
        if _strip(ground, planes_mm[: last + 1])[0] <= scallop_mm + accuracy_mm:
            planes_mm = planes_mm[: last + 1]
            break
    before = float(planes_mm[-2]) if len(planes_mm) > 1 else -np.inf
    floor = min(_edge_behind(ground.border, before), float(planes_mm[-1]))
    place, best = min(float(planes_mm[-1]), y_high - 0.3 * feed), float(planes_mm[-1])
    for _ in range(20):
        height, by_plane = _strip(ground, np.append(planes_mm[:-1], place))
        if height <= scallop_mm + accuracy_mm:
            best = min(best, place)
        if abs(height - scallop_mm) <= accuracy_mm or by_plane >= 0:
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


def _strip(ground: Ground, planes_mm: Array) -> tuple[float, float]:
    """The greatest height behind the last of these planes, and its change by that plane."""
    last = planes_mm[-1:]
    return _strip_peak(ground, border_heights(ground.surface, ground.border, last), last, 1)


def _stations(gap: Indices, start: Array, stop: Array, spacing_mm: float) -> tuple[Indices, Array]:
    """Places along each stretch, both ends included, at most `spacing_mm` apart and at least 5."""
    counts = np.maximum(np.ceil((stop - start) / spacing_mm), 4).astype(np.intp) + 1
    owner = np.repeat(np.arange(len(gap)), counts)
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = rank / (counts[owner] - 1)
    return gap[owner], start[owner] + share * (stop - start)[owner]


def _tops(ground: Ground, inner: GapCusps, planes_mm: Array, rounds: int = 3) -> GapCusps:
    """The highest interior maximum of every gap: the slope's zero between two stations, by repeated interpolation."""
    cusps, gap = inner.cusps, inner.gap
    rises = (gap[1:] == gap[:-1]) & (cusps.slope[:-1] > 0) & (cusps.slope[1:] < 0)
    left = np.flatnonzero(rises)
    top, place = _hermite_top(*_bracket(cusps, left, left + 1))
    best = _best_of_each(gap[left], top)
    left, place, right = left[best], place[best], left[best] + 1
    low, high = cusps.take(left), cusps.take(right)
    found = inner_cusps(ground.surface, ground.seeds, planes_mm, gap[left], place, 0.0, guess_from(low))
    for _ in range(rounds):
        is_before = found.cusps.slope > 0
        low, high = _choose(is_before, found.cusps, low), _choose(is_before, high, found.cusps)
        _, place = _hermite_top(low.x, high.x, low.height_mm, high.height_mm, low.slope, high.slope)
        found = inner_cusps(ground.surface, ground.seeds, planes_mm, gap[left], place, 0.0, guess_from(found.cusps))
    return found


def _bracket(cusps: Cusps, left: Indices, right: Indices) -> Iterator[Array]:
    for values in (cusps.x, cusps.height_mm, cusps.slope):
        yield values[left]
        yield values[right]


def _choose(flags: NDArray[np.bool_], yes: Cusps, no: Cusps) -> Cusps:
    names = Cusps.__slots__
    return Cusps(*(np.where(flags, getattr(yes, name), getattr(no, name)) for name in names))


def _hermite_top(
    x_low: Array, x_high: Array, h_low: Array, h_high: Array, slope_low: Array, slope_high: Array
) -> tuple[Array, Array]:
    """The maximum of the cubic through two points with a rising slope first and a falling one after, eq. (14)."""
    run = np.maximum(x_high - x_low, 1e-300)
    rise = (h_high - h_low) / run
    bend = 3 * (slope_low + slope_high - 2 * rise)
    mid = 3 * rise - 2 * slope_low - slope_high
    root = np.sqrt(np.maximum(mid**2 - bend * slope_low, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.nan_to_num(slope_low / (root - mid), nan=0.5)
    share = np.clip(share, 0.0, 1.0)
    height = h_low + run * share * (slope_low + share * (mid + share * bend / 3))
    return height, x_low + share * run


def _best_of_each(gap: Indices, height: Array) -> Indices:
    """The index of the highest entry of each gap."""
    order = np.lexsort((height, gap))
    is_last = np.append(gap[order][1:] != gap[order][:-1], True) if len(gap) else np.zeros(0, dtype=bool)
    return np.asarray(order[is_last], dtype=np.intp)


def _highest(gaps: int, groups: tuple[GapCusps, ...], strips: tuple[float, float, float]) -> Peaks:
    """The highest cusp of each gap among all groups."""
    gap = np.concatenate([group.gap for group in groups])
    names = Cusps.__slots__
    every = Cusps(*(np.concatenate([getattr(group.cusps, n) for group in groups], axis=-1) for n in names))
    best = _best_of_each(gap, np.where(every.is_found, every.height_mm, -np.inf))
    columns = [np.zeros(gaps) for _ in range(4)]
    for column, values in zip(columns, (every.height_mm, every.by_a, every.by_b, every.x), strict=True):
        column[gap[best]] = values[best]
    foot = np.zeros((2, gaps))
    foot[:, gap[best]] = every.foot[:, best]
    height, by_a, by_b, x = columns
    return Peaks(height, by_a, by_b, x, foot, *strips, int((~every.is_found).sum()))


def _strip_peak(ground: Ground, heights: BorderHeights, planes_mm: Array, gap: int) -> tuple[float, float]:
    """The greatest height on the border before the first (gap 0) or behind the last pass; its change by the plane."""
    chosen = np.flatnonzero(heights.gap == gap)
    if not len(chosen):
        return 0.0, 1.0
    levels, reaches = (heights.above, heights.upper) if gap == 0 else (heights.below, heights.lower)
    plane_mm = float(planes_mm[0 if gap == 0 else -1])
    at = int(chosen[np.argmax(levels[chosen])])
    best = float(levels[at]), float(reaches.by_plane[at])
    for stretch in (at, at - 1):
        ends = np.array([stretch, stretch + 1]) % len(levels)
        if (heights.gap[ends] == gap).all() and np.isfinite(levels[ends]).all():
            best = max(best, _stretch_peak(ground, int(ends[0]), ends, levels, reaches, plane_mm))
    return best


def _stretch_peak(
    ground: Ground, stretch: int, ends: Indices, levels: Array, reaches: Reaches, plane_mm: float, rounds: int = 4
) -> tuple[float, float]:
    """The maximum inside one stretch of the border, or (-inf, 1) if the height has none there."""
    border = ground.border
    axis = 0 if border.held[stretch] == Held.V.value else 1
    known = sorted((border.parameters[axis, j], levels[j], reaches.along[axis, j]) for j in ends)
    best = -np.inf, 1.0
    if not (known[0][0] < known[1][0] and known[0][2] > 0 > known[1][2]):
        return best
    for _ in range(rounds):
        pairs = zip(*known, strict=True)
        _, place = _hermite_top(*(np.array([value]) for pair in pairs for value in pair))
        held = np.array([border.value[stretch]])
        under = ground.surface.evaluate(*((place, held) if axis == 0 else (held, place)))
        top = solve_reaches(ground.surface, under, np.array([plane_mm]), reaches.on_pass[:, ends[:1]])
        if not top.is_found[0]:
            return best
        best = max(best, (float(top.height_mm[0]), float(top.by_plane[0])))
        slope = float(top.along[axis, 0])
        known[0 if slope > 0 else 1] = (place[0], top.height_mm[0], slope)
    return best
