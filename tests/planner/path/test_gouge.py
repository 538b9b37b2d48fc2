"""(2.7) Where a ball cannot go: found, located, and told in one sentence."""

from __future__ import annotations

import numpy as np
import pytest

from planner.errors import InputRejected
from planner.path.gouge import check_radius, check_reach, tool_side
from planner.path.offset import OffsetSurface
from planner.path.strategy.parallel import Wishes, lay_parallel
from planner.surface.curvature import survey
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import cylinder_patch, plane_patch, sphere_patch, thesis_patch


def bowl(radius_mm: float) -> NurbsPatch:
    """A hollow cylinder: the convex one upside down."""
    patch = cylinder_patch(radius_mm)
    points = patch.control_points * np.array([1.0, 1.0, -1.0])
    return NurbsPatch(2, 1, patch.knots_u, patch.knots_v, points, patch.weights)


def test_the_side_of_the_tool_is_up_whichever_way_the_patch_runs() -> None:
    assert tool_side(survey(thesis_patch())) == -1
    assert tool_side(survey(thesis_patch().turned(np.pi / 3))) == -1
    patch = plane_patch()
    flipped = NurbsPatch(1, 1, patch.knots_u, patch.knots_v, patch.control_points.transpose(1, 0, 2))
    assert tool_side(survey(patch)) == -tool_side(survey(flipped))


@pytest.mark.parametrize(("ball_mm", "is_refused"), [(5.999, False), (6.001, True)])
def test_a_hollow_tighter_than_the_ball_is_refused(ball_mm: float, is_refused: bool) -> None:
    seen = survey(bowl(6.0))
    side = tool_side(seen)
    if not is_refused:
        check_radius(seen, side, ball_mm)
        return
    with pytest.raises(InputRejected, match=r"patch 1 has a concave radius of 6\.000 mm at \(u, v\) = "):
        check_radius(seen, side, ball_mm)


def test_convex_patches_take_any_ball() -> None:
    for patch in (sphere_patch(), cylinder_patch()):
        seen = survey(patch)
        check_radius(seen, tool_side(seen), 500.0)


def test_a_wall_is_refused_with_its_angle() -> None:
    with pytest.raises(InputRejected, match=r"patch 1 is 88\.0 degrees steep at \(u, v\)"):
        tool_side(survey(plane_patch(10.0, float(np.tan(np.radians(88.0))))))


def test_a_ball_that_hits_another_part_of_the_patch_is_refused() -> None:
    """Two level legs of one bent band, 3 mm apart in XY and 2 mm in height: curvature alone allows a 4 mm ball."""
    band = legs(gap_mm=3.0, rise_mm=2.0)
    surface = OffsetSurface(band, 4.0, tool_side(survey(band)))
    u, v = (part.ravel() for part in np.meshgrid(np.linspace(0, 1, 40), np.linspace(0, 1, 120), indexing="ij"))
    with pytest.raises(InputRejected, match=r"the ball that touches .* cuts \d\.\d+ mm into"):
        check_reach(surface, np.stack([u, v]), 1e-7)
    assert check_reach(OffsetSurface(thesis_patch(), 4.0, -1), np.stack([u, v]), 1e-7) == pytest.approx(0, abs=1e-9)


def legs(gap_mm: float, rise_mm: float) -> NurbsPatch:
    """A flat band bent into a U in XY, rising gently from one leg's end to the other's."""
    wide = 8.0
    inner, outer = gap_mm / 2, gap_mm / 2 + wide
    rows = []
    for x in (inner, outer):
        reach = 60.0 if x == inner else 70.0
        line = [(x, 0.0, 0.0), (x, 40.0, 0.0), (x, reach, rise_mm / 2), (-x, reach, rise_mm / 2), (-x, 40.0, rise_mm)]
        rows.append([*line, (-x, 0.0, rise_mm)])
    knots = np.array([0, 0, 0, 0, 0.33, 0.66, 1, 1, 1, 1], dtype=float)
    return NurbsPatch(1, 3, np.array([0.0, 0, 1, 1]), knots, np.array(rows))


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("height_mm", [3.0, -3.0, 0.01])
def test_a_crease_is_refused_with_its_knot_and_angle(axis: int, height_mm: float) -> None:
    """(4.7) A ridge or a valley at a knot of full multiplicity is named, not met as a failure of some Newton step."""
    knots = np.array([0.0, 0, 1, 2, 2])
    x, y = np.meshgrid([0.0, 20, 40], [0.0, 20, 40], indexing="ij")
    z = np.zeros((3, 3))
    z[(1, slice(None)) if axis == 0 else (slice(None), 1)] = height_mm
    patch = NurbsPatch(1, 1, knots, knots, np.stack([x, y, z], axis=2))
    with pytest.raises(InputRejected, match=f"patch 1 has a crease along {'uv'[axis]} = 1"):
        lay_parallel(patch, Wishes(4.0, 0.0, 0.05, None), accuracy_mm=1e-7)


def test_a_shank_that_hits_a_higher_part_of_the_patch_is_refused() -> None:
    """Legs 3 mm apart in XY, 12 mm in height: the lower leg's ball stays clear of the upper, its shank does not."""
    band = legs(gap_mm=3.0, rise_mm=12.0)
    surface = OffsetSurface(band, 4.0, tool_side(survey(band)))
    u, v = (part.ravel() for part in np.meshgrid(np.linspace(0, 1, 40), np.linspace(0, 1, 120), indexing="ij"))
    with pytest.raises(InputRejected, match=r"the shank above the ball that touches .* cuts 1\.000 mm into"):
        check_reach(surface, np.stack([u, v]), 1e-7)


def test_passes_that_run_past_the_border_into_another_part_are_refused() -> None:
    """Legs 5 mm apart and 10 mm in height leave room for balls on the patch, not for those a little past its edge."""
    band = legs(gap_mm=5.0, rise_mm=10.0)
    wishes = Wishes(4.0, float(np.radians(70.0)), None, 2.0)
    with pytest.raises(InputRejected, match=r"the shank above .* = \(-0\.\d+, .* cuts 0\.\d+ mm into"):
        lay_parallel(band, wishes, accuracy_mm=1e-7)
