"""Smooth patches whose carried-on surface folds near the border are planned, on the part's own fold."""

from __future__ import annotations

import numpy as np
import pytest

from planner.errors import InputRejected
from planner.path.strategy.parallel import Layout, Wishes, lay_parallel
from planner.surface.patch import NurbsPatch


def random_patch(seed: int) -> tuple[NurbsPatch, Wishes]:
    """A smooth bicubic patch of 20 to 60 mm with random heights that a ball can follow, and what to cut it with."""
    rng = np.random.default_rng(seed)
    rows, columns = (int(rng.integers(5, 11)) for _ in range(2))
    knots = [np.r_[[0.0] * 4, np.linspace(0, 1, count - 2)[1:-1], [1.0] * 4] for count in (rows, columns)]
    places = [np.array([k[i + 1 : i + 4].mean() for i in range(len(k) - 4)]) for k in knots]
    size = rng.uniform(20, 60, 2)
    x, y = np.meshgrid(places[0] * size[0], places[1] * size[1], indexing="ij")
    cell_mm = min(size[0] / (rows - 3), size[1] / (columns - 3))
    radius_mm = float(rng.choice([2, 3, 4]))
    z = rng.normal(size=x.shape) * rng.choice([0.3, 0.6, 1.0]) * cell_mm**2 / radius_mm / 16
    weights = np.exp(rng.normal(size=x.shape) * 0.2) if rng.random() < 0.3 else None
    scallop_mm: float | None = float(rng.choice([0.08, 0.02, 0.005]))
    angle_deg = float(rng.uniform(0, 180)) if rng.random() < 0.6 else float(rng.choice([0, 45, 90]))
    feed_mm = None
    if rng.random() < 0.25:
        scallop_mm, feed_mm = None, float(radius_mm * rng.choice([0.25, 0.5, 1]))
    patch = NurbsPatch(3, 3, knots[0], knots[1], np.stack([x, y, z], axis=2), weights)
    return patch, Wishes(radius_mm, float(np.radians(angle_deg)), scallop_mm, feed_mm, 0.0, bool(rng.random() < 0.25))


def folds_passed(layout: Layout) -> int:
    """How many neighbouring nodes of passes stand on different folds, or on one that faces down."""
    surface = layout.ground.surface
    count = 0
    for curve in layout.curves:
        at = curve.surface.evaluate(*curve.parameters.T)
        turn = at.centre_u[0] * at.centre_v[1] - at.centre_u[1] * at.centre_v[0]
        count += int((surface.side * turn <= 0).sum())
        steps = np.abs(np.diff(curve.parameters, axis=0)) / np.ptp(surface.patch.domain, axis=1)
        count += int((steps.max(axis=1) > 0.25).sum())
    return count


@pytest.mark.parametrize("seed", [33, 36])
def test_nodes_that_newton_loses_beyond_the_border_are_found_from_the_part(seed: int) -> None:
    """(4.7) Guesses from the raster led to another fold or nowhere, and the whole job was refused."""
    patch, wishes = random_patch(seed)
    layout = lay_parallel(patch, wishes, accuracy_mm=1e-7)
    assert len(layout.planes_mm) > 20
    assert folds_passed(layout) == 0


def test_a_fold_that_a_pass_would_have_to_cross_is_refused_with_what_to_do() -> None:
    patch, wishes = random_patch(45)
    with pytest.raises(InputRejected, match=r"folds too near its border .* carry the surface on past that border"):
        lay_parallel(patch, wishes, accuracy_mm=1e-7)
