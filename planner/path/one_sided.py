"""Places of the border that one of the two passes beside them cannot reach: the other alone decides their height.

A patch carried on beyond its border may fold, and the pass that would come from there ends. Cusp lines end at points
that both passes leave equally high, and there are none at such places: their scallop must be seen in another way.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planner.path.border import Border
from planner.path.coverage import BorderHeights, best_of_each, border_heights
from planner.path.peaks import Ground, Peaks

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]


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
    best = best_of_each(alone.gap, alone.height_mm)
    had_mm = peaks.height_mm[alone.gap[best]]
    best = best[alone.height_mm[best] > np.where(had_mm > 0, had_mm, scallop_mm)]
    if not len(best) and not alone.bare:
        return peaks
    raised = {}
    for name in ("height_mm", "by_a", "by_b", "x", "foot"):
        raised[name] = getattr(peaks, name).copy()
        raised[name][..., alone.gap[best]] = getattr(alone, name)[..., best]
    return replace(peaks, **raised, missed=peaks.missed + alone.bare)


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
    at, zero = np.concatenate([by_b, by_a]), np.zeros(len(by_b) + len(by_a))
    is_b = np.arange(len(at)) < len(by_b)
    return OneSided(
        gap=np.asarray(heights.gap[at] - 1, dtype=np.intp),
        height_mm=np.where(is_b, heights.above[at], heights.below[at]),
        by_a=np.where(is_b, zero, heights.lower.by_plane[at]),
        by_b=np.where(is_b, heights.upper.by_plane[at], zero),
        x=np.where(is_b, heights.upper.x[at], heights.lower.x[at]),
        foot=border.parameters[:, at],
        bare=int((is_inner & np.isinf(heights.below) & np.isinf(heights.above)).sum()),
    )


def _held_beside(border: Border, gap: Indices, lost: Flags, other: Array) -> Indices:
    """Samples (k,) that have the other height, in the same gap as a lost one that they are or stand next to."""
    at = np.flatnonzero(lost)
    ring = len(gap)
    near = np.concatenate([at, border.after(at), (at - 1) % ring])
    same = np.tile(gap[at], 3) == gap[near]
    return np.unique(near[same & np.isfinite(other[near])])
