"""Which pieces of a pass are joined: over the extended patch they are, over a slot between two of its parts never."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from planner.errors import InputRejected
from planner.path.model import DrivingPlane
from planner.path.strategy.parallel import Wishes, lay_parallel, prepare
from planner.path.trace import TracedCurve, trace
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import clamped

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


def crosses_slot(curve: TracedCurve) -> bool:
    """Whether a pass runs from one leg of the horns to the other past the end of the slot."""
    return curve.plane.offset_mm > 0 and curve.points[0, 0] < 0 < curve.points[-1, 0]


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
    if angle_deg == 0.0:
        assert not any(crosses_slot(curve) for curve in curves)


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
