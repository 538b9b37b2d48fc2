"""Pick feeds over random smooth patches: searched to the end, and nothing at the border forgotten."""

from __future__ import annotations

import numpy as np
import pytest

from planner.path.coverage import border_heights
from planner.path.pick_feed import ChainEnd, solve_pick_feeds
from planner.path.strategy.parallel import prepare
from tests.planner.path.test_folds import random_patch


@pytest.mark.parametrize("seed", [104, 119])
def test_a_maximum_that_the_planes_have_left_behind_ends_no_search(seed: int) -> None:
    """(4.7) The cusps of the first guess, solved anew where planes had moved by millimetres, were lost and ended it."""
    patch, wishes = random_patch(seed)
    assert wishes.scallop_mm is not None
    feeds = solve_pick_feeds(prepare(patch, wishes), wishes.scallop_mm, accuracy_mm=1e-7)
    assert feeds.end is ChainEnd.SETTLED
    heights_mm = feeds.peaks.height_mm
    assert heights_mm.max() < wishes.scallop_mm + 2e-7
    assert np.median(heights_mm) > wishes.scallop_mm - 2e-7


def test_a_corner_that_stands_out_into_a_gap_keeps_the_scallop() -> None:
    """(4.1) Nearer to one pass all around it had no cusp line's end, and the part held 5.6 um where 5 were asked."""
    patch, wishes = random_patch(9)
    scallop_mm = 0.005 - 0.004 / 3.995
    ground = prepare(patch, wishes)
    feeds = solve_pick_feeds(ground, scallop_mm, accuracy_mm=1e-7)
    assert feeds.end is ChainEnd.SETTLED
    heights = border_heights(ground.surface, ground.border, feeds.planes_mm)
    is_inner = (heights.gap > 0) & (heights.gap < len(feeds.planes_mm))
    assert np.minimum(heights.below, heights.above)[is_inner].max() < scallop_mm + 2e-7
