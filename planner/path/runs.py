"""Where passes run: pieces that are needed, put together where the extended patch lies between them.

Beyond its border a patch is carried on; but from one of its parts to another beside it a pass must not go on: nobody
knows what stands in the slot between. Frame: passes run along +x in planes y = const.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.path.coverage import BorderHeights, GapCusps
from planner.path.folds import walk
from planner.path.offset import OffsetSurface
from planner.surface.curvature import span_places

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

SEAM_MM = 1e-3  # nearer than this two ends of a patch meet
ROUNDING_MM = 1e-6  # of places at which balls were found to stand: pieces nearer than that meet
NEAR_MIDDLE = 0.02  # of a blank: no further from its middle the middle of the parameters at its ends must lie
STEPS = 64  # over a blank: where the patch nearly folds in it, few lead over the place
SAME_PLACE = 1e-3  # of the domain: parameters no further apart are those of one place


@dataclass(frozen=True, slots=True)
class Pieces:
    """Pieces of passes: `owner` (k,) the pass, `x` (k, 2) from and to, `parameters` (2, k, 2) of the balls there."""

    owner: Indices
    x: Array
    parameters: Array

    def take(self, chosen: Indices) -> Pieces:
        """The chosen pieces only."""
        return Pieces(self.owner[chosen], self.x[chosen], self.parameters[:, chosen])

    def over(self, first: Indices, last: Indices) -> Pieces:
        """From the begins of the pieces `first` (m,) to the ends of those `last`, in the same passes."""
        ends = np.stack([self.parameters[:, first, 0], self.parameters[:, last, 1]], axis=2)
        return Pieces(self.owner[first], np.stack([self.x[first, 0], self.x[last, 1]], axis=1), ends)

    def between(self, before: Indices, after: Indices) -> Pieces:
        """The blanks from the ends of the pieces `before` (m,) to the begins of those `after`, in the same passes."""
        ends = np.stack([self.parameters[:, before, 1], self.parameters[:, after, 0]], axis=2)
        return Pieces(self.owner[before], np.stack([self.x[before, 1], self.x[after, 0]], axis=1), ends)


def pass_runs(
    surface: OffsetSurface,
    planes_mm: Array,
    heights: BorderHeights,
    ends: GapCusps,
    crossed: tuple[Indices, Array, Array],
    *,
    join_mm: float,
) -> Pieces:
    """Where passes must run to leave nothing on the patch, sorted.

    A pass is needed where its contact point is on the patch (`crossed`: pass, x and parameters of its crossings of the
    border), and as far beyond as it is the one that cuts a border point or a cusp's end lowest. Pieces nearer than
    `join_mm` become one, but for the two sides of a slot.
    """
    cut, found = np.flatnonzero(heights.best >= 0), ends.cusps.is_found
    is_lower = heights.best[cut] < heights.gap[cut]
    owner = np.concatenate([heights.best[cut], ends.gap[found], ends.gap[found] + 1])
    place = np.concatenate([heights.x[cut], ends.cusps.x_a[found], ends.cusps.x_b[found]])
    on_pass = np.where(is_lower, heights.lower.on_pass[:, cut], heights.upper.on_pass[:, cut])
    on_pass = np.concatenate([on_pass, ends.cusps.on_a[:, found], ends.cusps.on_b[:, found]], axis=1)
    inside = runs_inside(*crossed)
    pieces = Pieces(
        np.append(owner, inside.owner),
        np.concatenate([np.stack([place, place], axis=1), inside.x]),
        np.concatenate([np.stack([on_pass, on_pass], axis=2), inside.parameters], axis=1),
    )
    return joined_runs(surface, planes_mm, pieces, join_mm=join_mm)


def runs_inside(passes: Indices, x: Array, parameters: Array) -> Pieces:
    """Where passes run inside a ring, from their crossings of it in any order: passes, x and parameters (2, m)."""
    order = np.lexsort((x, passes))
    passes, x, parameters = passes[order], x[order], parameters[:, order]
    rank = np.arange(len(passes)) - np.searchsorted(passes, passes)
    start = np.flatnonzero((rank % 2 == 0)[:-1] & (passes[1:] == passes[:-1]))
    ends = np.stack([start, start + 1], axis=1)
    return Pieces(passes[start], x[ends], parameters[:, ends])


def joined_runs(surface: OffsetSurface, planes_mm: Array, pieces: Pieces, *, join_mm: float) -> Pieces:
    """Pieces sorted, those of a pass no further than `join_mm` apart as one.

    Two between which the extended patch does not go on stay two. Beside a narrow slot what is needed of one side may
    stand between pieces of the other: each is put to its own side then, and the runs overlap.
    """
    pieces = pieces.take(np.lexsort((pieces.x[:, 0], pieces.owner)))
    owner, (low, high) = pieces.owner, pieces.x.T
    furthest = _furthest(owner, high)
    gap_mm = low[1:] - high[furthest[:-1]]
    is_open = np.append(np.ones(min(len(owner), 1), dtype=bool), (owner[1:] != owner[:-1]) | (gap_mm > join_mm))
    asked = np.flatnonzero(~is_open[1:] & (gap_mm > ROUNDING_MM)) + 1
    is_open[asked] = ~_goes_on(surface, planes_mm, pieces.between(furthest[asked - 1], asked))
    starts = np.flatnonzero(is_open)
    lasts = furthest[np.append(starts[1:], len(owner)) - 1]
    is_near = (owner[starts[2:]] == owner[starts[:-2]]) & (low[starts[2:]] - high[lasts[:-2]] <= join_mm)
    over = np.flatnonzero(is_near)
    side = np.arange(len(starts))
    for one in over[_goes_on(surface, planes_mm, pieces.between(lasts[over], starts[over + 2]))].tolist():
        side[one + 2] = side[one]
    kept, at = np.unique(side, return_inverse=True)
    order = np.lexsort((high[lasts], at))
    last = lasts[order[np.append(np.flatnonzero(np.diff(at[order])), len(order) - 1)]] if len(order) else lasts
    return pieces.over(starts[kept], last)


def _furthest(owner: Indices, high: Array) -> Indices:
    """Up to each piece (k,), sorted by pass: which one of its pass so far reaches furthest."""
    by_reach = np.argsort(high, kind="stable")
    rank = np.empty(len(owner), dtype=np.intp)
    rank[by_reach] = np.arange(len(owner))
    base = owner * len(owner)
    return np.asarray(by_reach[np.maximum.accumulate(base + rank) - base], dtype=np.intp)


def _goes_on(surface: OffsetSurface, planes_mm: Array, gaps: Pieces) -> Flags:
    """Whether the extended patch goes on from one end of each gap (k,) to the other, so that no slot lies between.

    Then the middle of the parameters lies near the middle of the gap, or short steps from one end lead to the other.
    """
    y, wide_mm, (here, there) = planes_mm[gaps.owner], np.ptp(gaps.x, axis=1), np.moveaxis(gaps.parameters, 2, 0)
    middle = surface.evaluate(*((here + there) / 2)).centre[:2]
    off_mm = np.abs(middle - [gaps.x.mean(axis=1), y]).max(axis=0)
    goes_on = np.asarray(off_mm <= NEAR_MIDDLE * wide_mm + ROUNDING_MM)
    doubt = np.flatnonzero(~goes_on)
    if len(doubt):
        start, stop = gaps.x[doubt].T
        found, is_reached = walk(surface, y[doubt], start, here[:, doubt], stop, STEPS)
        away = np.abs(found.parameters.T - there[:, doubt]) / np.ptp(surface.patch.domain, axis=1)[:, None]
        is_closed = np.array(closes(surface))[:, None]
        away = np.where(is_closed, np.abs(away - np.round(away)), away)
        goes_on[doubt] = is_reached & (away.max(axis=0) <= SAME_PLACE)
    return goes_on


def closes(surface: OffsetSurface) -> tuple[bool, bool]:
    """Whether the patch closes upon itself in u, and in v."""
    patch = surface.patch
    u, v = (span_places(basis, 6) for basis in (patch.basis_u, patch.basis_v))
    over_u = [patch.evaluate(np.full(len(v), end), v).point for end in patch.domain[0]]
    over_v = [patch.evaluate(u, np.full(len(u), end)).point for end in patch.domain[1]]
    in_u, in_v = (bool(np.abs(last - first).max() <= SEAM_MM) for first, last in (over_u, over_v))
    return in_u, in_v
