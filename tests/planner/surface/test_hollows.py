"""The lowest place of a patch is found whichever of several nearly equal ones stands between samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planner.surface.curvature import lowest, survey
from planner.surface.patch import NurbsPatch

Array = NDArray[np.float64]


def strip(rises: dict[int, float]) -> NurbsPatch:
    """A cubic strip of 30 spans, 300 x 10 mm, flat but for these heights of control points, mm."""
    knots = np.r_[[0.0] * 3, np.arange(31.0), [30.0] * 3]
    points = np.zeros((33, 2, 3))
    points[:, :, 0] = 10 * np.array([knots[i + 1 : i + 4].mean() for i in range(33)])[:, None]
    points[:, 1, 1] = 10
    for row, rise_mm in rises.items():
        points[row, :, 2] = rise_mm
    return NurbsPatch(3, 1, knots, np.array([0.0, 0, 1, 1]), points)


def heights(patch: NurbsPatch, u: Array) -> Array:
    return np.asarray(patch.evaluate(u, np.zeros_like(u)).point[2])


def test_the_higher_of_two_summits_is_found_between_samples() -> None:
    """A summit whose samples were lower than another, 4 um less high, was missed: so was the clearance."""
    asymmetric = strip({20: 3.0, 21: 1.0})
    u = np.linspace(0, 30, 300_001)
    top_mm = heights(asymmetric, u).max()
    sampled_mm = heights(asymmetric, survey(asymmetric).u).max()
    assert top_mm > sampled_mm + 1e-3
    both = strip({8: 1.5 * (top_mm + sampled_mm) / 2, 20: 3.0, 21: 1.0})
    found = lowest(survey(both), lambda at: -at.point[2], rounds=6)
    assert -found.value > top_mm - 1e-6
    assert abs(found.u - u[np.argmax(heights(asymmetric, u))]) < 1e-3
