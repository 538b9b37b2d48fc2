"""Pick feeds over random smooth patches: searched to the end, and nothing at the border forgotten."""

from __future__ import annotations

import numpy as np
import pytest

from planner.path.coverage import border_heights, inner_cusps
from planner.path.one_sided import with_one_sided
from planner.path.peaks import survey
from planner.path.pick_feed import ChainEnd, even_planes, solve_pick_feeds
from planner.path.strategy.parallel import Wishes, prepare
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import clamped, random_patch


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


@pytest.mark.parametrize(("seed", "waves"), [(1, 1.4), (2, 1.0)])
def test_a_gap_whose_height_jumps_is_closed_in_on(seed: int, waves: float) -> None:
    """(4.1, 4.7) A lobe of the outline brings a summit into the gap: Newton's steps went over it and back for ever."""
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 7), np.linspace(0.0, 1.0, 8), indexing="ij")
    across = 30 * y * (1 + 0.2 * np.sin(2 * np.pi * waves * x)) + 2 * np.cos(3 * np.pi * x)
    heights = 0.3 * np.random.default_rng(seed).standard_normal(x.shape)
    points = np.stack([21.5 * x * (1 + 0.6 * y * (1 - y)), across, heights], axis=2)
    patch = NurbsPatch(3, 2, clamped(7), clamped(8, 2), points)
    ground = prepare(patch, Wishes(3.0, np.radians(-45), 0.08, None))
    feeds = solve_pick_feeds(ground, 0.08, accuracy_mm=1e-7)
    assert feeds.end is ChainEnd.SETTLED
    heights_mm = feeds.peaks.height_mm
    assert heights_mm.max() < 0.08 + 2e-7
    assert np.sort(heights_mm)[2] > 0.08 - 2e-7


@pytest.mark.parametrize("angle_deg", [0.0, 180.0])
def test_a_round_bulge_into_a_gap_is_as_high_as_its_summit(angle_deg: float) -> None:
    """(4.1) A level part ends in the parabola y = 2 - 8 t + 9 t^2; the sample beside its summit at t = 4/9 was told."""
    sides = np.array([[2.0, -2.0, 3.0], [20.0, 20.0, 20.0]]).T
    points = np.stack([np.stack([[0.0, 10.0, 20.0]] * 2, axis=1), sides, np.zeros((3, 2))], axis=2)
    patch = NurbsPatch(2, 1, np.array([0.0, 0, 0, 1, 1, 1]), np.array([0.0, 0, 1, 1]), points)
    turned = np.radians(angle_deg)
    ground = prepare(patch, Wishes(4.0, turned, None, 1.9))
    planes_mm = np.sort(np.cos(turned) * np.append([-1.0, 0.9], np.arange(2.8, 21.0, 1.9)))
    peaks = with_one_sided(ground, planes_mm, survey(ground, planes_mm, 0.05)[0])
    nearest_mm = 0.9 - 2 / 9
    at = 0 if angle_deg == 0.0 else len(planes_mm) - 2
    assert peaks.height_mm[at] == pytest.approx(4.0 - np.sqrt(16.0 - nearest_mm**2), abs=1e-9)
    assert np.abs(peaks.foot[:, at] - [4 / 9, 0.0]).max() < 1e-4
    assert (
        abs((peaks.by_b if angle_deg == 0.0 else -peaks.by_a)[at] - nearest_mm / np.sqrt(16.0 - nearest_mm**2)) < 1e-6
    )


@pytest.mark.parametrize("seed", [10, 97, 152])
def test_a_ball_on_another_sheet_of_the_carried_on_patch_reaches_no_border_point(seed: int) -> None:
    """(4.7) Newton went a whole patch away, "a scallop between two passes could not be measured" ended the search."""
    patch, wishes = random_patch(seed)
    assert wishes.scallop_mm is not None
    feeds = solve_pick_feeds(prepare(patch, wishes), wishes.scallop_mm, accuracy_mm=1e-7)
    assert feeds.end is ChainEnd.SETTLED
    assert feeds.peaks.height_mm.max() < wishes.scallop_mm + 2e-7


def test_balls_that_reach_a_border_point_stand_near_it() -> None:
    """(4.1) Beside a fold one was found at u = -0.78, and 1.8 mm were told for a gap that holds 0.8 mm there."""
    patch, wishes = random_patch(45)
    ground = prepare(patch, wishes)
    assert wishes.pick_feed_mm is not None
    heights = border_heights(ground.surface, ground.border, even_planes(ground, wishes.pick_feed_mm))
    for level, reaches in ((heights.below, heights.lower), (heights.above, heights.upper)):
        away = np.abs(reaches.on_pass - ground.border.parameters)[:, np.isfinite(level)]
        assert away.max() < 0.2


def test_a_cusp_line_that_ends_where_a_pass_does_is_surveyed() -> None:
    """(4.1) Behind a fold it has no end of equal heights; the other end stayed alone and nothing between was seen."""
    patch, wishes = random_patch(45)
    ground = prepare(patch, wishes)
    assert wishes.pick_feed_mm is not None
    planes_mm = even_planes(ground, wishes.pick_feed_mm)
    heights_mm = survey(ground, planes_mm, 0.5)[0].height_mm
    x = np.linspace(-36.0, -3.0, 34)
    cusps = inner_cusps(ground.surface, ground.seeds, planes_mm, np.full(len(x), 7), x, 0.5).cusps
    assert cusps.is_found.all()
    assert heights_mm[7] >= cusps.height_mm.max()
