"""What is told of gaps between fixed passes is what the passes as traced leave, their ends included."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from planner.path.strategy.parallel import Layout, Wishes, lay_parallel
from tests.planner.path.test_runs import horns
from tests.planner.surfaces import random_patch


def left_over_mm(layout: Layout, count: int = 240) -> tuple[np.ndarray, np.ndarray]:
    """Heights over an even raster of the patch, found by climbing along the normals, and how many planes lie before."""
    surface = layout.ground.surface
    sides = (np.linspace(low, high, count) for low, high in surface.patch.domain)
    u, v = (part.ravel() for part in np.meshgrid(*sides, indexing="ij"))
    under = surface.evaluate(u, v)
    balls = []
    for curve in layout.curves:
        points = curve.refine(np.linspace(0, curve.length_mm, int(curve.length_mm / 0.05) + 2)).points
        balls.append(np.insert(points, 1, curve.plane.offset_mm, axis=1))
    tree = cKDTree(np.concatenate(balls))
    height_mm = np.zeros(len(u))
    for _ in range(30):
        distance_mm, _ = tree.query((under.contact + height_mm * under.normal).T)
        height_mm += np.maximum(distance_mm - surface.radius_mm, 0.0)
    return height_mm, np.searchsorted(layout.planes_mm, under.centre[1])


@pytest.mark.parametrize("seed", [27, 45])
def test_beside_a_fold_the_balls_at_the_ends_of_passes_count(seed: int) -> None:
    """(4.1) What one pass alone leaves on the border was told: 2.0 mm where 0.80 stood."""
    patch, wishes = random_patch(seed)
    layout = lay_parallel(patch, wishes, accuracy_mm=1e-7)
    told_mm = max(layout.peaks.height_mm.max(), layout.peaks.first_mm, layout.peaks.last_mm)
    stands_mm = left_over_mm(layout)[0].max()
    assert stands_mm < told_mm < 1.1 * stands_mm  # a raster misses a little of a summit


def test_beside_a_slot_no_cusp_is_overseen() -> None:
    """(4.1) Stations of a cusp line stood on the other leg carried on over the slot: 78 um were told where 87 stood."""
    wishes = Wishes(1.5, np.radians(243.45), None, 0.95)
    layout = lay_parallel(horns(1.0, 4.0), wishes, accuracy_mm=1e-7)
    height_mm, before = left_over_mm(layout)
    stands_mm = np.zeros(len(layout.planes_mm) + 1)
    np.maximum.at(stands_mm, before, height_mm)
    assert (stands_mm[1:-1] < layout.peaks.height_mm + 3e-4).all()
