"""What traced passes leave standing where their ends count: the balls there reach further than their curves do.

Behind a fold of the patch as it would go on a pass ends, and beside it the border alone tells too much.
Frame: passes run along +x in planes y = const.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planner.path.coverage import border_heights
from planner.path.newton import locate
from planner.path.offset import OffsetPoints, OffsetSurface, dot
from planner.path.one_sided import CLEARLY, one_sided, tips
from planner.path.peaks import Ground, Peaks
from planner.path.trace import TracedCurve

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SHARES = 24  # places from the border to the pass that reaches it
ROUNDS = 8  # of ever closer looks at the highest place
A_RADIUS = 40  # balls: on a radius of way


@dataclass(frozen=True, slots=True)
class _Balls:
    """Centres (3, n) of the balls of traced curves, near to each other, with their curves' ends."""

    centres: Array
    reach_mm: float

    def left_over(self, under: OffsetPoints, most: int = 2_000_000) -> Array:
        """How high (m,) the part stands over these places along their normals; infinite where no ball comes."""
        height_mm = np.full(under.contact.shape[1], np.inf)
        step = max(most // max(self.centres.shape[1], 1), 1)
        for at in range(0, len(height_mm), step):
            part = under.take(slice(at, at + step))
            away = self.centres[:, None, :] - part.contact[:, :, None]
            up = np.einsum("imn,im->mn", away, part.normal)
            square = self.reach_mm**2 + up**2 - dot(away, away)
            left = np.where(square >= 0, up - np.sqrt(np.maximum(square, 0.0)), np.inf)
            height_mm[at : at + step] = left.min(axis=1, initial=np.inf)
        return height_mm


def with_traced(ground: Ground, planes_mm: Array, within: Peaks, peaks: Peaks, curves: Sequence[TracedCurve]) -> Peaks:
    """The `peaks` that the border has raised above those `within` it, lowered to what the traced passes leave there."""
    raised = np.flatnonzero(peaks.height_mm > (1 + CLEARLY) * within.height_mm)
    if not len(raised):
        return peaks
    heights = border_heights(ground.surface, ground.border, planes_mm)
    radius_mm = ground.surface.radius_mm
    both = one_sided(ground.border, heights, planes_mm, radius_mm), tips(ground.border, heights, planes_mm)
    owner, told = (np.concatenate([getattr(one, name) for one in both]) for name in ("gap", "height_mm"))
    is_a = np.concatenate([one.by_a for one in both]) != 0
    feet = np.concatenate([one.foot for one in both], axis=1)
    columns = {name: getattr(peaks, name).copy() for name in ("height_mm", "x", "foot")}
    for gap in raised.tolist():
        at = np.flatnonzero((owner == gap) & (told > within.height_mm[gap]))
        toward = np.where(is_a[at], planes_mm[gap], planes_mm[gap + 1])
        top_mm, foot = _highest(ground.surface, feet[:, at], toward, curves, planes_mm[[gap, gap + 1]])
        if within.height_mm[gap] < top_mm < peaks.height_mm[gap]:
            found = ground.surface.evaluate(*foot[:, None])
            columns["height_mm"][gap], columns["x"][gap], columns["foot"][:, gap] = top_mm, found.centre[0, 0], foot
        elif top_mm <= within.height_mm[gap]:
            for name, values in columns.items():
                values[..., gap] = getattr(within, name)[..., gap]
    return replace(peaks, **columns)


def _highest(
    surface: OffsetSurface, feet: Array, toward_mm: Array, curves: Sequence[TracedCurve], planes_mm: Array
) -> tuple[float, Array]:
    """The greatest height between border places `feet` (2, k) and the passes at `toward_mm` (k,), and its foot (2,)."""
    centre = surface.evaluate(*feet).centre
    balls = _balls_near(surface, curves, centre, planes_mm)
    shares = np.arange(SHARES) / SHARES
    x = np.repeat(centre[0], SHARES)
    y = (centre[1, :, None] + shares * (toward_mm - centre[1])[:, None]).ravel()
    steps = np.array([float(np.ptp(planes_mm)) / 4, float(np.ptp(planes_mm)) / SHARES])
    target, guess = np.stack([x, y]), np.repeat(feet, SHARES, axis=1)
    best, foot = -np.inf, feet[:, 0]
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 5)] * 2, indexing="ij")).reshape(2, -1)
    for _ in range(ROUNDS):
        height_mm, parameters = _heights_at(surface, balls, target, guess)
        top = int(np.argmax(height_mm))
        if height_mm[top] > best:
            best, foot = float(height_mm[top]), parameters[:, top]
        here = surface.evaluate(*foot[:, None]).centre[:2]
        target, guess = here + grid * steps[:, None], np.repeat(foot[:, None], grid.shape[1], axis=1)
        steps = steps / 2
    return best, foot


def _heights_at(surface: OffsetSurface, balls: _Balls, target: Array, guess: Array) -> tuple[Array, Array]:
    """Heights (m,) over the places of the patch under ball centres at XY `target` (2, m), and their parameters."""
    parameters, under, is_found = locate(surface, target, guess, residual_mm=1e-6, steps=20)
    low, high = np.array(surface.patch.domain).T[:, :, None]
    room = 1e-9 * (high - low)
    is_inside = is_found & ((parameters >= low - room) & (parameters <= high + room)).all(axis=0)
    return np.where(is_inside, balls.left_over(under), -np.inf), parameters


def _balls_near(surface: OffsetSurface, curves: Sequence[TracedCurve], centre: Array, planes_mm: Array) -> _Balls:
    """The balls of all curves that may come near these places (3, k) between two planes."""
    radius_mm = surface.radius_mm
    (low, high), (x_low, x_high) = planes_mm, (centre[0].min(), centre[0].max())
    found = []
    for curve in curves:
        w_mm, y_mm = curve.points[:, 0], curve.plane.offset_mm
        is_near = w_mm[0] < x_high + 2 * radius_mm and w_mm[-1] > x_low - 2 * radius_mm
        if is_near and low - radius_mm < y_mm < high + radius_mm:
            count = int(np.ceil(curve.length_mm * A_RADIUS / radius_mm)) + 2
            points = curve.refine(np.linspace(0.0, curve.length_mm, count)).points
            points = points[(points[:, 0] > x_low - 2 * radius_mm) & (points[:, 0] < x_high + 2 * radius_mm)]
            found.append(np.stack([points[:, 0], np.full(len(points), y_mm), points[:, 1]]))
    return _Balls(np.concatenate(found, axis=1) if found else np.zeros((3, 0)), surface.reach_mm)
