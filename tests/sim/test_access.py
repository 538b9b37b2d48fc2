import math

import numpy as np
import pytest

from planner.errors import InputRejected
from sim.access import accessible
from sim.grid import net_of
from sim.tool import BallTool, BluntTool, Tool
from tests.sim.surfaces import bilinear, cylinder, plane


def share(patches, radius_mm=4.0, pitch_mm=0.25):
    nets = [net_of(patch, pitch_mm) for patch in patches]
    return [flags.mean() for flags in accessible(nets, BallTool(radius_mm), 1e-6)]


def test_a_plane_is_open_everywhere() -> None:
    """(3.3)"""
    assert share([plane()]) == [1.0]


def test_more_probes_than_fit_into_memory_are_refused() -> None:
    """(3.3) At a pitch of 2 um a part of 50 mm grew until the process was killed."""
    with pytest.raises(InputRejected, match=r"a probe pitch of 0.0001 mm takes .* probes, .*; give a larger pitch"):
        net_of(plane(), 1e-4)


@pytest.mark.parametrize(("groove_mm", "expected"), [(4.1, 1.0), (3.9, 0.0)])
def test_a_groove_takes_a_ball_smaller_than_itself(groove_mm: float, expected: float) -> None:
    """(3.3) A ball of radius 4 finishes a groove of radius 4.1 everywhere and one of 3.9 nowhere."""
    assert share([cylinder(groove_mm, half_angle_rad=1.0, length_mm=6.0, is_concave=True)]) == [expected]


def test_in_a_crease_the_ball_stays_out_of_the_corner() -> None:
    """(3.3) A V of two planes at 45 degrees: a ball of radius R touches them no nearer than R to the crease."""
    left = bilinear(np.array([[[-12.0, y, 12.0], [0.0, y, 0.0]] for y in (0.0, 8.0)]))
    right = bilinear(np.array([[[0.0, y, 0.0], [12.0, y, 12.0]] for y in (0.0, 8.0)]))
    nets = [net_of(patch, 0.1) for patch in (left, right)]
    for net, is_free in zip(nets, accessible(nets, BallTool(4.0), 1e-6), strict=True):
        away = np.hypot(net.points[..., 0], net.points[..., 2])
        limit = 4.0 * math.tan(math.pi / 4)
        assert is_free[away > limit + 0.1].all()
        assert not is_free[away < limit - 0.1].any()


def test_beside_a_wall_the_shank_stays_clear() -> None:
    """(3.3) Ground beside a wall of 80 degrees, higher than the ball: the shank decides how near the ball may stand."""
    slope = math.tan(math.radians(80.0))
    ground = bilinear(np.array([[[x, y, 0.0] for y in (0.0, 8.0)] for x in (-15.0, 0.0)]))
    wall = bilinear(np.array([[[x, y, slope * x] for y in (0.0, 8.0)] for x in (0.0, 3.0)]))
    nets = [net_of(patch, 0.1) for patch in (ground, wall)]
    floor, _ = accessible(nets, BallTool(4.0), 1e-6)
    nearest = -nets[0].points[..., 0][floor].max()
    assert nearest == pytest.approx(4.0 * math.tan(math.radians(40.0)), abs=0.11)


@pytest.mark.parametrize("tool", [BluntTool(1.0, 3.0), BluntTool(0.0, 4.0)])
def test_a_flat_end_stays_a_corner_away_from_a_wall(tool: Tool) -> None:
    """(3.3) Level ground beside a wall of 45 degrees: the corner's radius decides how near a flat end cuts."""
    ground = bilinear(np.array([[[x, y, 0.0] for y in (0.0, 20.0)] for x in (-15.0, 0.0)]))
    wall = bilinear(np.array([[[x, y, x] for y in (0.0, 20.0)] for x in (0.0, 6.0)]))
    nets = [net_of(patch, 0.1) for patch in (ground, wall)]
    floor, slope = accessible(nets, tool, 1e-6)
    assert -nets[0].points[..., 0][floor].max() == pytest.approx(tool.corner_mm * math.tan(math.pi / 8), abs=0.11)
    lowest = nets[1].points[..., 0][slope].min()
    assert lowest == pytest.approx(tool.corner_mm * (1 - math.cos(math.pi / 4)), abs=0.11)


def test_a_flat_end_cannot_finish_a_bowl() -> None:
    """(3.3) In a groove that a ball finishes everywhere a flat end touches the lips alone."""
    nets = [net_of(cylinder(4.1, half_angle_rad=1.0, length_mm=20.0, is_concave=True), 0.5)]
    assert not accessible(nets, BluntTool(0.0, 4.0), 1e-6)[0][:, 1:-1].any()
    assert accessible(nets, BallTool(4.0), 1e-6)[0].mean() == 1.0
