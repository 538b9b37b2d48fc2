"""Which pieces of a pass are joined: over the extended patch they are, over a slot between two of its parts never."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from scipy.spatial import cKDTree

from planner.errors import InputRejected
from planner.path.coverage import border_heights
from planner.path.model import DrivingPlane
from planner.path.runs import Pieces, joined_runs, runs_inside
from planner.path.strategy.parallel import Wishes, lay_parallel, prepare
from planner.path.trace import TracedCurve, trace
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import clamped, plane_patch

CORNER_Y = 30.0


def horns(rise_mm: float, slot_mm: float = 6.0) -> NurbsPatch:
    """A U with legs along y beside a round-ended slot, its right leg risen.

    Either leg ends in a corner beside the slot, a dip, and a horn 10 mm longer than the corner.
    """
    share = np.linspace(0, 1, 8)
    tips = np.interp(share, [0, 0.12, 0.4, 1], [CORNER_Y, CORNER_Y, 27.0, 40.0])
    bend = np.linspace(-np.pi, 0, 9)[1:-1]
    rows = []
    for out, tip in zip(slot_mm / 2 + 17 * share, tips, strict=True):
        leg = np.stack([np.full(7, out), np.linspace(0, tip, 7)], axis=1)
        rows.append(np.concatenate([leg[::-1] * [-1, 1], out * np.stack([np.cos(bend), np.sin(bend)], axis=1), leg]))
    climb = rise_mm * np.clip(np.linspace(-1, 2, 21), 0, 1)
    points = np.concatenate([np.array(rows), np.broadcast_to(climb, (8, 21))[..., None]], axis=2)
    return NurbsPatch(3, 3, clamped(8), clamped(21), points)


def crosses_slot(curve: TracedCurve, slot_mm: float = 6.0) -> bool:
    """Whether a pass runs from one leg of the horns to the other past the round end of the slot, which is at x = 0."""
    (x, y, _), (x_end, y_end, _) = curve.plane.to_work(curve.points[[0, -1]])
    is_across = min(x, x_end) < -slot_mm / 2 and slot_mm / 2 < max(x, x_end)
    return bool(is_across and y - x * (y_end - y) / (x_end - x) > 0)


@pytest.mark.parametrize("rise_mm", [0.0, 3.0])
def test_no_pass_that_meets_two_legs_past_their_ends_only_crosses_the_slot(rise_mm: float) -> None:
    """(4.7) One at y = 31.7 crossed it, for in that plane the blanks beside the horns were wider than the slot.

    Another at y = 0.5 did so near the slot's round end. Where one leg was risen the job was refused.
    """
    curves = lay_parallel(horns(rise_mm), Wishes(2.0, 0.0, None, 3.9), accuracy_mm=1e-7).curves
    past = [curve for curve in curves if CORNER_Y < curve.plane.offset_mm < CORNER_Y + 2]
    assert len(past) == 4
    assert any(0 < curve.plane.offset_mm < 1 for curve in curves)
    assert not any(crosses_slot(curve) for curve in curves)
    for curve in past:
        assert np.ptp(curve.points[:, 1]) < 1e-9
    ends = [np.sort(np.abs(curve.points[[0, -1], 0])) for curve in past[1:3]]
    for inner, outer in ends:  # short pieces are made longer, on both sides
        assert inner < 3.0
        assert outer > 4.1


@pytest.mark.parametrize(("slot_mm", "angle_deg"), [(0.1, 0.0), (0.6, 20.0), (1.6, 70.0)])
def test_passes_beside_a_narrow_slot_are_two_and_no_more(slot_mm: float, angle_deg: float) -> None:
    """Where they cross it slantwise, what is needed of both sides stands in turns: each piece goes to its own side.

    Cut wherever the side changes, a pass came to 22 pieces.
    """
    wishes = Wishes(2.0, np.radians(angle_deg), None, 3.0)
    curves = lay_parallel(horns(0.0, slot_mm), wishes, accuracy_mm=1e-7).curves
    pieces = Counter(curve.plane.offset_mm for curve in curves)
    assert max(pieces.values()) <= 3  # the third is a horn
    assert not any(crosses_slot(curve, slot_mm) for curve in curves)


def test_a_pass_is_not_joined_over_a_fold_in_the_round_end_of_a_slot() -> None:
    """(4.7) Between legs that rise the patch carried on winds like a stair; few steps led over its steep middle."""
    turn = np.linspace(-np.pi, 0, 9)[1:-1]
    rows = []
    for out in (4.0, 14.0):
        left, right = ([[side * out, y] for y in np.linspace(0, end, 7)] for side, end in ((-1, 23), (1, 60)))
        rows.append([*left[::-1], *([out * np.cos(one), out * np.sin(one)] for one in turn), *right])
    climb = np.broadcast_to(np.clip(np.linspace(-1, 2, 21), 0, 1), (2, 21))
    points = np.concatenate([np.array(rows), climb[..., None]], axis=2)
    patch = NurbsPatch(1, 3, np.array([0.0, 0, 1, 1]), clamped(21), points)
    layout = lay_parallel(patch, Wishes(3.0, np.radians(20), None, 4.0), accuracy_mm=1e-7)
    assert layout.gouge_mm < 1e-7


@pytest.mark.parametrize(
    ("rise_mm", "angle_deg", "feed_mm"), [(1.0, 90.2, 1.1), (1.0, 100.0, 2.2), (0.3, 60.0, 3.5), (1.0, 20.0, 3.5)]
)
def test_a_pass_in_a_slot_runs_on_the_sheet_of_the_side_that_needs_it(
    rise_mm: float, angle_deg: float, feed_mm: float
) -> None:
    """(4.1) Between legs of two heights the patch carried on from one lies over the other.

    Traced on the wrong one a pass left 0.20 mm more on a corner than was told. A short one met a fold past its end.
    """
    layout = lay_parallel(horns(rise_mm, 3.0), Wishes(2.0, np.radians(angle_deg), None, feed_mm), accuracy_mm=1e-7)
    surface, border = layout.ground.surface, layout.ground.border
    heights = border_heights(surface, border, layout.planes_mm)
    lowest = np.minimum(heights.below, heights.above)
    balls = []
    for curve in layout.curves:
        points = curve.refine(np.linspace(0, curve.length_mm, int(curve.length_mm / 0.02) + 2)).points
        balls.append(np.insert(points, 1, curve.plane.offset_mm, axis=1))
    tops = (border.points.contact + lowest * border.points.normal)[:, np.isfinite(lowest)]
    assert cKDTree(np.concatenate(balls)).query(tops.T)[0].max() < surface.radius_mm + 1e-4


def test_a_pass_across_two_parts_is_refused_as_such() -> None:
    """(4.7) It was told that the patch bends too sharply: the gap beside the jump was looked at, not the jump."""
    ground = prepare(horns(1.0), Wishes(2.0, 0.0, None, 3.9))
    with pytest.raises(
        InputRejected, match=r"two parts of patch 1 lie too near side by side .* at 10.000 mm\); give a"
    ):
        trace(
            ground.surface,
            ground.seeds,
            [DrivingPlane(0.0, 10.0)],
            np.array([[-20.0, 20.0]]),
            spacing_mm=1.0,
            accuracy_mm=1e-5,
        )


def test_a_crossing_without_its_other_joins_no_two_passes() -> None:
    """Where a pass touches the border there may be an odd number; the last is left, the next pass begins anew."""
    passes, x = np.array([1, 0, 0, 0, 1]), np.array([9.0, 3.0, 1.0, 7.0, 5.0])
    inside = runs_inside(passes, x, np.stack([x, -x]))
    assert inside.owner.tolist() == [0, 1]
    assert inside.x.tolist() == [[1.0, 3.0], [5.0, 9.0]]
    assert inside.parameters.tolist() == [[[1.0, 3.0], [5.0, 9.0]], [[-1.0, -3.0], [-5.0, -9.0]]]


@pytest.mark.parametrize(("u", "v", "count"), [(0.5, 0.6, 1), (0.5, 0.65, 2), (0.55, 0.6, 2)])
def test_pieces_are_joined_only_where_the_patch_leads_to_the_ball_that_stands_there(
    u: float, v: float, count: int
) -> None:
    """(4.7) A pass at y = 10 over a level square goes on from x = 8 to 12, to the ball at its middle alone."""
    ground = prepare(plane_patch(), Wishes(2.0, 0.0, None, 1.0))
    ends = np.array([[[0.5, 0.5], [u, u]], [[0.1, 0.4], [v, 0.9]]])
    pieces = Pieces(np.array([0, 0]), np.array([[2.0, 8.0], [12.0, 18.0]]), ends)
    runs = joined_runs(ground.surface, np.array([10.0]), pieces, join_mm=5.0)
    assert len(runs.x) == len(runs.owner) == count
    assert runs.x[[0, -1], [0, 1]].tolist() == [2.0, 18.0]
