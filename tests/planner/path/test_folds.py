"""Smooth patches whose carried-on surface folds near the border are planned, on the part's own fold."""

from __future__ import annotations

import numpy as np
import pytest

from planner.errors import InputRejected
from planner.path.strategy.parallel import Layout, Wishes, lay_parallel
from tests.planner.path.test_runs import horns
from tests.planner.surfaces import random_patch


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
    with pytest.raises(InputRejected, match=r"folds too near its border .* carry the surface on past that border"):
        lay_parallel(horns(1.0, 3.0), Wishes(2.0, np.radians(45.0), None, 2.2), accuracy_mm=1e-7)


def test_no_pass_is_asked_for_beyond_a_fold() -> None:
    """(4.7) A ball past the fold, where the pass would turn back, counted; the run to it was refused for that fold."""
    patch, wishes = random_patch(82)
    assert folds_passed(lay_parallel(patch, wishes, accuracy_mm=1e-7)) == 0


def test_a_pass_is_not_joined_across_a_fold_behind_the_border() -> None:
    """(4.7) Its two pieces past a hollow were joined, the fold between them ended the plan."""
    patch, wishes = random_patch(45)
    layout = lay_parallel(patch, wishes, accuracy_mm=1e-7)
    assert [curve.plane.offset_mm for curve in layout.curves].count(layout.planes_mm[-1]) == 2
    assert folds_passed(layout) == 0
