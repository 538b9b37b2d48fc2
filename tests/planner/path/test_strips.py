"""The greatest height that the first pass leaves on a border of many summits, none of which stands on a sample."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from planner.path.coverage import border_heights
from planner.path.peaks import survey
from planner.path.scallop import solve_reaches
from planner.path.strategy.parallel import Wishes, prepare
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import clamped


def scalloped(seed: int) -> NurbsPatch:
    """A level plate whose first side bulges out six times, as far as 0.27 mm to 0.1 um, each in a shape of its own."""
    rng = np.random.default_rng(seed)
    knots, bulge = clamped(31), np.zeros(31)
    u = np.linspace(0.0, 1.0, 20001)
    for middle in range(4, 28, 4):
        bulge[middle : middle + 2] = 0.4, rng.uniform(0.2, 0.38)
        near = (u > (middle - 3) / 28 - 0.02) & (u < middle / 28 + 0.02)
        top = BSpline(knots, bulge, 3)(u[near]).max()
        bulge[middle : middle + 2] *= (0.27 + 1e-4 * rng.standard_normal()) / top
    x, y = np.meshgrid(np.linspace(0, 60, 31), np.linspace(0, 20, 4), indexing="ij")
    y = y - bulge[:, None] * (1 - y / 20)
    return NurbsPatch(3, 3, knots, clamped(4), np.stack([x, y, 0 * x], axis=2))


@pytest.mark.parametrize("seed", range(6))
def test_the_first_strip_is_as_high_as_its_highest_summit(seed: int) -> None:
    """(4.1) To 0.1 nm of 40,000 samples, though the highest sample is often another summit's."""
    ground = prepare(scalloped(seed), Wishes(3.0, 0.0, 0.03, None))
    planes_mm = np.array([0.35, 0.8])
    u = np.linspace(0.0, 1.0, 40001)
    side = np.stack([u, 0 * u])
    dense = solve_reaches(ground.surface, ground.surface.evaluate(*side), np.full(len(u), planes_mm[0]), side)
    highest_mm = dense.height_mm[dense.is_found].max()
    samples = border_heights(ground.surface, ground.border, planes_mm)
    assert samples.above[samples.gap == 0].max() < highest_mm
    assert survey(ground, planes_mm, 0.03)[0].first_mm == pytest.approx(highest_mm, abs=1e-7)
