"""Creases of a patch: where they are, the normals on both sides, and how far a pass turns there (4.3, 4.7)."""

from __future__ import annotations

import numpy as np
import pytest

from planner.surface.creases import largest_turn_rad, normals_across
from planner.surface.patch import NurbsPatch

ENDS = [0.0, 0.0, 1.0, 1.0]
RIDGED = [0.0, 0.0, 0.25, 1.0, 1.0]


def roof(fall: float, climb: float, *, along_v: bool = False) -> NurbsPatch:
    """Two planes that meet in a ridge at x = 10 mm: z = climb y - fall |x - 10|, or x and y swapped."""
    across, along = np.meshgrid([0.0, 10.0, 50.0], [0.0, 30.0], indexing="ij")
    height = climb * along - fall * np.abs(across - 10.0)
    if along_v:
        return NurbsPatch(1, 1, np.array(ENDS), np.array(RIDGED), np.stack([along.T, across.T, height.T], axis=2))
    return NurbsPatch(1, 1, np.array(RIDGED), np.array(ENDS), np.stack([across, along, height], axis=2))


@pytest.mark.parametrize("along_v", [False, True])
def test_the_normals_on_both_sides_of_a_ridge(along_v: bool) -> None:
    """(4.7) Before it the ground climbs, behind it it falls; the border is no crease."""
    ((axis, knot, before, after),) = normals_across(roof(0.3, 0.5, along_v=along_v))
    assert (axis, knot) == (int(along_v), 0.25)
    for normals, slope in ((before, 0.3), (after, -0.3)):
        wanted = np.array([-0.5, -slope, 1.0] if along_v else [-slope, -0.5, 1.0])
        wanted /= np.linalg.norm(wanted)
        assert normals.shape[1] >= 4
        assert np.abs(np.abs(normals) - np.abs(wanted)[:, None]).max() < 1e-12
        assert np.abs((normals * wanted[:, None]).sum(axis=0)).min() > 1 - 1e-12


@pytest.mark.parametrize("climb", [0.0, 0.5, 2.0])
def test_a_pass_turns_more_than_the_normal_on_ground_that_climbs(climb: float) -> None:
    """(4.3) In its own plane it turns as if the ground did not climb: by 2 fall / sqrt(1 + fall^2), and no less."""
    assert largest_turn_rad(roof(0.3, climb)) == pytest.approx(0.6 / np.hypot(1.0, 0.3), rel=1e-12)


def test_a_knot_that_is_repeated_less_often_than_the_degree_is_no_crease() -> None:
    """(4.7) Of degree 2 a single knot leaves the tangent no freedom, a double one does."""
    points = np.stack([*np.meshgrid(np.arange(5.0), np.arange(2.0), indexing="ij"), np.zeros((5, 2))], axis=2)
    points[2, :, 2] = 1.0
    single = NurbsPatch(2, 1, np.array([0.0, 0, 0, 0.3, 0.6, 1, 1, 1]), np.array(ENDS), points)
    double = NurbsPatch(2, 1, np.array([0.0, 0, 0, 0.4, 0.4, 1, 1, 1]), np.array(ENDS), points)
    assert list(normals_across(single)) == []
    assert largest_turn_rad(single) == 0.0
    assert [knot for _, knot, _, _ in normals_across(double)] == [0.4]
    assert largest_turn_rad(double) > 0.5
