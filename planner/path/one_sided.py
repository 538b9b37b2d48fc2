"""Places of the border where one of the two passes beside them alone decides the height.

A patch carried on beyond its border may fold, and the pass that would come from there ends; or a corner stands out into
a gap, nearer to one pass all around. Cusp lines end at points that both passes leave equally high, and there are none
at such places: their scallop must be seen in another way.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planner.path.border import Border
from planner.path.border_tops import tops_between
from planner.path.coverage import BorderHeights, best_of_each, border_heights
from planner.path.peaks import Ground, Peaks

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

CLEARLY = 1e-5  # higher than a gap's own peak, as a share of it


@dataclass(frozen=True, slots=True)
class OneSided:
    """Heights (k,) of gaps (k,) at border points, their change by either plane, their place; `bare` reached by none."""

    gap: Indices
    height_mm: Array
    by_a: Array
    by_b: Array
    x: Array
    foot: Array
    bare: int


def with_one_sided(ground: Ground, planes_mm: Array, peaks: Peaks, scallop_mm: float = 0.0) -> Peaks:
    """The peaks, raised to what the border holds where one pass alone reaches it; missed where none does.

    A gap without a cusp of its own is left so where the border does not hold more than `scallop_mm`.
    """
    heights = border_heights(ground.surface, ground.border, planes_mm)
    alone = one_sided(ground.border, heights, planes_mm, ground.surface.radius_mm)
    peaks = _raised(peaks, alone, np.where(peaks.height_mm > 0, peaks.height_mm, scallop_mm))
    tops = _tops(ground, heights, planes_mm, 0.9 * np.maximum(peaks.height_mm, scallop_mm))
    for border, known in ((ground.border, heights), (tops, border_heights(ground.surface, tops, planes_mm))):
        least_mm = np.maximum((1 + CLEARLY) * peaks.height_mm, (1 - CLEARLY) * scallop_mm)
        peaks = _raised(peaks, tips(border, known, planes_mm, scallop_mm), least_mm)
    return peaks


def _raised(peaks: Peaks, held: OneSided, least_mm: Array) -> Peaks:
    """The peaks, raised to the highest that is held in each gap where that is above `least_mm` (passes - 1,)."""
    best = best_of_each(held.gap, held.height_mm)
    best = best[held.height_mm[best] > least_mm[held.gap[best]]]
    if not len(best) and not held.bare:
        return peaks
    raised = {}
    for name in ("height_mm", "by_a", "by_b", "x", "foot"):
        raised[name] = getattr(peaks, name).copy()
        raised[name][..., held.gap[best]] = getattr(held, name)[..., best]
    return replace(peaks, **raised, missed=peaks.missed + held.bare)


def one_sided(border: Border, heights: BorderHeights, planes_mm: Array, radius_mm: float) -> OneSided:
    """What the border holds between planes where only one of both passes reaches it, and next to such places."""
    count = len(planes_mm)
    is_inner = (heights.gap >= 1) & (heights.gap < count)
    y = border.points.centre[1]
    to_a = y - planes_mm[np.clip(heights.gap - 1, 0, count - 1)]
    to_b = planes_mm[np.clip(heights.gap, 0, count - 1)] - y
    lost_a = is_inner & np.isinf(heights.below) & (to_a < radius_mm)
    lost_b = is_inner & np.isinf(heights.above) & (to_b < radius_mm)
    by_b = _held_beside(border, heights.gap, lost_a, heights.above)
    by_a = _held_beside(border, heights.gap, lost_b, heights.below)
    bare = int((is_inner & np.isinf(heights.below) & np.isinf(heights.above)).sum())
    return _held_by(border, heights, by_a, by_b, bare)


def _tops(ground: Ground, heights: BorderHeights, planes_mm: Array, least_mm: Array) -> Border:
    """Places between samples where the height that the nearer pass leaves is greatest: bulges into a gap.

    Those are sought that promise `least_mm` (passes - 1,) or more; they are no ring.
    """
    ring, border = np.arange(len(heights.gap)), ground.border
    onward = border.after(ring)
    is_both = np.isfinite(heights.below) & np.isfinite(heights.above)
    is_inner = (heights.gap >= 1) & (heights.gap < len(planes_mm)) & (heights.gap == heights.gap[onward])
    is_inner &= is_both & is_both[onward]
    is_a = heights.below <= heights.above
    found = []
    for is_lower, level, reaches, back in (
        (is_a, heights.below, heights.lower, 1),
        (~is_a, heights.above, heights.upper, 0),
    ):
        stretch = np.flatnonzero(is_inner & (is_lower | is_lower[onward]))
        gap = heights.gap[stretch]
        planes, least = planes_mm[gap - back], least_mm[gap - 1]
        found.append(tops_between(ground.surface, border, stretch, planes, (level, reaches), least)[0])
    parameters = np.concatenate([one.parameters for one in found], axis=1)
    held, value = (np.concatenate([getattr(one, name) for one in found]) for name in ("held", "value"))
    return Border(parameters, held, value, ground.surface.evaluate(parameters[0], parameters[1]))


def tips(border: Border, heights: BorderHeights, planes_mm: Array, scallop_mm: float = 0.0) -> OneSided:
    """What the border holds between planes where both passes reach it: the lower of their heights at every place.

    Where the lower pass leaves more than an asked `scallop_mm` it is the upper one that can still come nearer: its own
    height is told then.
    """
    is_both = (heights.gap >= 1) & (heights.gap < len(planes_mm))
    is_both &= np.isfinite(heights.below) & np.isfinite(heights.above)
    is_b_lower = heights.above < heights.below
    is_b = is_b_lower | ((heights.below > scallop_mm) if scallop_mm else is_b_lower)
    return _held_by(border, heights, np.flatnonzero(is_both & ~is_b), np.flatnonzero(is_both & is_b), 0)


def _held_by(border: Border, heights: BorderHeights, by_a: Indices, by_b: Indices, bare: int) -> OneSided:
    """The heights that the lower pass leaves at samples `by_a`, and the upper one at samples `by_b`."""
    at, zero = np.concatenate([by_b, by_a]), np.zeros(len(by_b) + len(by_a))
    is_b = np.arange(len(at)) < len(by_b)
    return OneSided(
        gap=np.asarray(heights.gap[at] - 1, dtype=np.intp),
        height_mm=np.where(is_b, heights.above[at], heights.below[at]),
        by_a=np.where(is_b, zero, heights.lower.by_plane[at]),
        by_b=np.where(is_b, heights.upper.by_plane[at], zero),
        x=np.where(is_b, heights.upper.x[at], heights.lower.x[at]),
        foot=border.parameters[:, at],
        bare=bare,
    )


def _held_beside(border: Border, gap: Indices, lost: Flags, other: Array) -> Indices:
    """Samples (k,) that have the other height, in the same gap as a lost one that they are or stand next to."""
    at = np.flatnonzero(lost)
    ring = len(gap)
    near = np.concatenate([at, border.after(at), (at - 1) % ring])
    same = np.tile(gap[at], 3) == gap[near]
    return np.unique(near[same & np.isfinite(other[near])])
