"""Bounds over creases too small to be refused: the pass turns there at once."""

from __future__ import annotations

import numpy as np
import pytest

from planner.path.model import Method
from planner.path.strategy.parallel import Wishes, lay_parallel
from planner.surface.patch import NurbsPatch
from tests.planner.path.test_bound import dense_distance_mm, fit_passes


def creased_patch(turn_rad: float) -> NurbsPatch:
    """Two planes, 25 mm long together, that meet at this angle where a pass along x crosses from one to the other."""
    knot = 0.55
    knots = np.array([0, 0, 0, knot, knot, 1, 1, 1])
    x = 25 * np.array([0, knot / 2, knot, (1 + knot) / 2, 1])
    points = np.zeros((5, 2, 3))
    points[:, :, 0], points[:, 1, 1] = x[:, None], 8.0
    points[:, :, 2] = -turn_rad * np.maximum(x - 25 * knot, 0.0)[:, None]
    return NurbsPatch(2, 1, knots, np.array([0.0, 0, 1, 1]), points)


@pytest.mark.parametrize("turn_rad", [9.5e-5, -9.5e-5])
@pytest.mark.parametrize("radius_mm", [2.0, 10.0])
def test_a_crease_between_two_nodes_is_bounded(radius_mm: float, turn_rad: float) -> None:
    """(4.3) The bound stood up to 28 % below the distance, called proved, because no curvature shows a crease."""
    wishes = Wishes(radius_mm, 0.0, None, 7.0)
    curves = lay_parallel(creased_patch(turn_rad), wishes, accuracy_mm=1e-7, reading_mm=1e-5).curves[:1]
    (fitted,) = fit_passes(curves, 0.0009)
    assert fitted.method is Method.PROVED
    assert dense_distance_mm(curves[0], fitted.spline, 12001) <= fitted.deviation_mm + 2e-9
