"""What a set of passes leaves on a patch: the cusps of every gap, the heights along the border, where passes must run.

Frame: passes in planes y = const, sorted. A surface point belongs to the gap in which its own ball centre lies. The
surface is judged inside its border only; passes may run on beyond it, on the extended patch.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.path.border import Border
from planner.path.newton import locate
from planner.path.offset import OffsetPoints, OffsetSurface
from planner.path.scallop import CuspGuess, Cusps, Held, Reaches, solve_cusps, solve_reaches
from planner.path.seeds import Seeds

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

ASTRAY = 0.5  # of a ball's way: no further off its middle lies the middle of parameters on one sheet
ROUNDING_MM = 1e-6  # of places that are solved for
DEEPEST = 1e-3  # of the ball's radius: deeper than this no ball cuts into the border


@dataclass(frozen=True, slots=True)
class BorderHeights:
    """The border under the passes: `gap` (m,) counts the planes at or below each sample's centre.

    `below`, `above` are the heights left by the two neighbouring passes, infinite where there is none; `best` (m,) is
    the index of the pass that cuts lowest (-1: none), `x` (m,) where its ball stands then.
    """

    gap: Indices
    below: Array
    above: Array
    best: Indices
    x: Array
    lower: Reaches
    upper: Reaches


@dataclass(frozen=True, slots=True)
class GapCusps:
    """Cusps of gaps: `gap` (k,) is the index of the lower pass of each, `cusps` the solved points."""

    gap: Indices
    cusps: Cusps

    def with_more(self, other: GapCusps) -> GapCusps:
        """These and the other cusps."""
        names = (field.name for field in fields(Cusps))
        both = {
            name: np.concatenate([getattr(self.cusps, name), getattr(other.cusps, name)], axis=-1) for name in names
        }
        return GapCusps(np.concatenate([self.gap, other.gap]), Cusps(**both))


def border_heights(surface: OffsetSurface, border: Border, planes_mm: Array) -> BorderHeights:
    """Heights along the border left by the passes on either side, eq. (13)."""
    count = len(border.value)
    gap = np.searchsorted(planes_mm, border.points.centre[1])
    both, heights = _reach(surface, border, planes_mm, np.concatenate([gap - 1, gap]))
    lower, upper = both.take(slice(count)), both.take(slice(count, None))
    below, above = heights[:count], heights[count:]
    is_lower = below <= above
    best = np.where(np.isfinite(np.minimum(below, above)), np.where(is_lower, gap - 1, gap), -1)
    return BorderHeights(gap, below, above, best, np.where(is_lower, lower.x, upper.x), lower, upper)


def border_cusps(surface: OffsetSurface, border: Border, heights: BorderHeights, planes_mm: Array) -> GapCusps:
    """The points of the border that two neighbouring passes leave equally high: where cusp lines end, eq. (12)."""
    here = np.arange(len(heights.gap))
    there = border.after(here)
    has_both = np.isfinite(heights.below) & np.isfinite(heights.above)
    lead = np.where(has_both, heights.below, 0.0) - np.where(has_both, heights.above, 0.0)
    is_end = (heights.gap == heights.gap[there]) & has_both & has_both[there]
    chosen = np.flatnonzero(is_end & ((lead > 0) != (lead[there] > 0)))
    onward = there[chosen]
    share = lead[chosen] / (lead[chosen] - lead[onward])
    gap = heights.gap[chosen] - 1

    def between(values: Array) -> Array:
        return np.asarray(values[..., chosen] + share * (values[..., onward] - values[..., chosen]))

    guess = CuspGuess(
        between(border.parameters),
        between(heights.below),
        between(heights.lower.on_pass),
        between(heights.upper.on_pass),
    )
    planes = planes_mm[gap], planes_mm[gap + 1]
    return GapCusps(gap, solve_cusps(surface, planes, border.held[chosen], border.value[chosen], guess))


def border_jumps(border: Border, heights: BorderHeights) -> tuple[Indices, Array]:
    """Where the nearer pass changes on the border although one of both reaches it on one side only: gap (k,), x (k,).

    Behind a fold of the patch as it would go on a pass ends, and with it the cusp line.
    """
    here = np.arange(len(heights.gap))
    there = border.after(here)
    has_both = np.isfinite(heights.below) & np.isfinite(heights.above)
    is_known, is_upper = heights.best >= 0, heights.above < heights.below
    is_jump = is_known & is_known[there] & (heights.gap == heights.gap[there]) & (is_upper != is_upper[there])
    at = np.flatnonzero(is_jump & ~(has_both & has_both[there]))
    x = border.points.centre[0]
    return heights.gap[at] - 1, np.where(has_both[at], x[at], x[there[at]])


def stretches(ends: GapCusps, jumps: tuple[Indices, Array]) -> tuple[Indices, Array, Array]:
    """Where cusp lines run inside the border: gap (k,), and the x where each stretch begins and stops."""
    gap = np.append(ends.gap[ends.cusps.is_found], jumps[0])
    x = np.append(ends.cusps.x[ends.cusps.is_found], jumps[1])
    order = np.lexsort((x, gap))
    gap, x = gap[order], x[order]
    first = np.searchsorted(gap, gap)
    rank = np.arange(len(gap)) - first
    is_start = (rank % 2 == 0)[:-1] & (gap[1:] == gap[:-1])
    at = np.flatnonzero(is_start)
    return gap[at], x[at], x[at + 1]


def inner_cusps(
    surface: OffsetSurface,
    seeds: Seeds,
    planes_mm: Array,
    gap: Indices,
    x: Array,
    height_mm: Array | float,
    near: CuspGuess | None = None,
) -> GapCusps:
    """Cusps of these gaps at places x, started half-way between the passes or from `near`."""
    planes = planes_mm[gap], planes_mm[gap + 1]
    if near is None:
        near = _middle_guess(surface, seeds, planes, x, height_mm)
    held = np.full(len(x), Held.PLACE.value)
    return GapCusps(gap, solve_cusps(surface, planes, held, x, near))


def guess_from(cusps: Cusps) -> CuspGuess:
    """Newton's start at cusps that were solved before."""
    return CuspGuess(*(getattr(cusps, field.name) for field in fields(CuspGuess)))


def crossings(surface: OffsetSurface, border: Border, planes_mm: Array) -> tuple[Indices, Array, Array]:
    """Where the contact point of each pass crosses the border: pass (k,), x of the ball, parameters (2, k)."""
    y = border.points.centre[1]
    here = np.arange(len(y))
    there = border.after(here)
    low, high = np.minimum(y, y[there]), np.maximum(y, y[there])
    first, last = np.searchsorted(planes_mm, low, side="right"), np.searchsorted(planes_mm, high, side="right")
    stretch = np.repeat(here, last - first)
    passes = np.repeat(first, last - first) + np.arange(len(stretch))
    passes -= np.repeat(np.cumsum(last - first) - (last - first), last - first)
    onward = there[stretch]
    share = (planes_mm[passes] - y[stretch]) / (y[onward] - y[stretch])
    start, stop = border.parameters[:, stretch], border.parameters[:, onward]
    parameters = start + share * (stop - start)
    runs_u = (border.held[stretch] == Held.V.value).astype(np.float64)
    for _ in range(8):
        found = surface.evaluate(parameters[0], parameters[1])
        climb = np.where(runs_u > 0, found.centre_u[1], found.centre_v[1])
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.nan_to_num((planes_mm[passes] - found.centre[1]) / climb)
        # A side that runs along the pass has its crossing anywhere, but not beyond the stretch.
        parameters = np.clip(
            parameters + np.stack([runs_u * step, (1 - runs_u) * step]),
            np.minimum(start, stop),
            np.maximum(start, stop),
        )
    found = surface.evaluate(parameters[0], parameters[1])
    return passes, found.centre[0], parameters


def best_of_each(gap: Indices, height: Array) -> Indices:
    """The index of the highest entry of each gap."""
    order = np.lexsort((height, gap))
    is_last = np.append(gap[order][1:] != gap[order][:-1], True) if len(gap) else np.zeros(0, dtype=bool)
    return np.asarray(order[is_last], dtype=np.intp)


def _reach(surface: OffsetSurface, border: Border, planes_mm: Array, passes: Indices) -> tuple[Reaches, Array]:
    """Heights by the pass of each sample, the ring gone round as often as `passes` is long.

    Infinite where there is no such pass, where it runs further away than R, or where it cannot reach the sample.
    """
    ring = len(border.value)
    index = np.arange(len(passes)) % ring
    has_pass = (passes >= 0) & (passes < len(planes_mm))
    away = planes_mm[np.clip(passes, 0, len(planes_mm) - 1)] - border.points.centre[1, index]
    chosen = np.flatnonzero(has_pass & (np.abs(away) < surface.radius_mm))
    under = border.points.take(index[chosen])
    planes = planes_mm[passes[chosen]]
    start = border.parameters[:, index[chosen]]
    found = solve_reaches(surface, under, planes, start + away[chosen] * _across(under))
    found = _on_sheet(surface, under, start, found, away[chosen])
    lost = np.flatnonzero(~found.is_found)
    if len(lost):
        target = np.stack([under.centre[0, lost], planes[lost]])
        guess, _, _ = locate(surface, target, start[:, lost], residual_mm=0.01, steps=12)
        again = solve_reaches(surface, under.take(lost), planes[lost], guess)
        again = _on_sheet(surface, under.take(lost), start[:, lost], again, away[chosen][lost])
        found = found.replaced(lost, again)
    height = np.full(len(passes), np.inf)
    height[chosen] = np.where(found.is_found, found.height_mm, np.inf)
    spread = {field.name: _scatter(getattr(found, field.name), chosen, len(passes)) for field in fields(Reaches)}
    return Reaches(**spread), height


def _on_sheet(surface: OffsetSurface, under: OffsetPoints, start: Array, found: Reaches, away_mm: Array) -> Reaches:
    """The same heights (m,), lost where the ball stands on another sheet of the extended patch than its border point.

    Where the parameters lead elsewhere than the ball's way (x, y) as the patch goes on at `start`, their middle tells.
    A ball of the part's own sheet cuts into no border point: such jobs are refused before.
    """
    step = found.on_pass - start
    way = np.stack([found.x - under.centre[0], away_mm])
    off = np.abs(under.centre_u[:2] * step[0] + under.centre_v[:2] * step[1] - way).max(axis=0)
    far_mm = np.abs(way).max(axis=0) + ROUNDING_MM
    is_found = found.is_found & (found.height_mm > -DEEPEST * surface.radius_mm)
    doubt = np.flatnonzero(is_found & ~(off <= far_mm))
    if not len(doubt):
        return replace(found, is_found=is_found)
    middle = surface.evaluate(*(start + step / 2)[:, doubt]).centre[:2]
    astray = np.hypot(*(middle - under.centre[:2, doubt] - way[:, doubt] / 2))
    is_found[doubt] = astray <= ASTRAY * far_mm[doubt]
    return replace(found, is_found=is_found)


def _across(found: OffsetPoints) -> Array:
    """The parameter step (2, m) that moves the ball's centre by 1 mm in y and not in x."""
    determinant = found.centre_u[0] * found.centre_v[1] - found.centre_u[1] * found.centre_v[0]
    return np.asarray(np.stack([-found.centre_v[0], found.centre_u[0]]) / determinant)


def _scatter(values: Any, chosen: Indices, count: int) -> Any:
    spread = np.zeros((*values.shape[:-1], count), dtype=values.dtype)
    spread[..., chosen] = values
    return spread


def _middle_guess(
    surface: OffsetSurface, seeds: Seeds, planes: tuple[Array, Array], x: Array, height_mm: Array | float
) -> CuspGuess:
    """Starts from the ball centre half-way between the passes and the slopes of the surface there."""
    middle = np.stack([x, (planes[0] + planes[1]) / 2])
    foot, found, _ = locate(surface, middle, seeds.near(middle), residual_mm=1e-3, steps=20)
    across = _across(found)
    half = (planes[1] - planes[0]) / 2
    return CuspGuess(foot, np.broadcast_to(height_mm, x.shape).copy(), foot - half * across, foot + half * across)
