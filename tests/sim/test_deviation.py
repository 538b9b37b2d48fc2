import math
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import NdBSpline

from sim.deviation import judge
from sim.interpreter.canon import Arc, Line, Motion, Rapid
from sim.nominal import CutterData, Nominal, load_nominal
from sim.nominal_patch import NominalPatch
from sim.tool import BallTool

R = 4.0


def plane(*, size: float = 20.0, slope_x: float = 0.0, slope_y: float = 0.0) -> Nominal:
    """A bilinear square patch from the origin, z = slope_x x + slope_y y."""
    knots = np.array([0.0, 0.0, 1.0, 1.0])
    net = np.array([[[x, y, slope_x * x + slope_y * y] for y in (0.0, size)] for x in (0.0, size)])
    patch = NominalPatch(NdBSpline((knots, knots), net, (1, 1)), False, 1.0, 0.0)
    return Nominal((patch,), CutterData("ball", R, R), "centre", None)


def straight_passes(pick_mm: float, *, slope_x: float = 0.0, slope_y: float = 0.0, size: float = 20.0) -> list[Motion]:
    """Centre passes along x on the offset of the plane, from outside to outside, one line each."""
    normal = np.array([-slope_x, -slope_y, 1.0]) / math.hypot(slope_x, slope_y, 1.0)
    passes: list[Motion] = []
    for k in range(-2, round(size / pick_mm) + 3):
        ends = [np.array([x, k * pick_mm, slope_x * x + slope_y * k * pick_mm]) + R * normal for x in (-5, size + 5)]
        passes.append(Line(k + 3, None, tuple(ends[0]), tuple(ends[1]), 250.0))
    return passes


@pytest.mark.parametrize("pick_mm", [0.4, 1.0, 1.6])
def test_plane_leaves_the_closed_form(pick_mm: float) -> None:
    """(3.2) R - sqrt(R^2 - p^2/4) on a plane."""
    verdict = judge(plane(), BallTool(R), straight_passes(pick_mm), reference="centre", probe_pitch_mm=0.1)
    assert verdict.scallop_mm == pytest.approx(R - math.sqrt(R * R - pick_mm**2 / 4), abs=1e-8)
    assert verdict.gouge_mm == pytest.approx(0.0, abs=1e-8)
    assert verdict.coverage == 1.0


def test_a_tip_is_one_radius_below_the_centre() -> None:
    """(1.5) The same program read as tip cuts the same when it is one radius lower."""
    lowered = [
        Line(each.line, None, (*each.start[:2], each.start[2] - R), (*each.end[:2], each.end[2] - R), 250.0)
        for each in straight_passes(1.0)
    ]
    centre = judge(plane(), BallTool(R), straight_passes(1.0), reference="centre", probe_pitch_mm=0.5)
    tip = judge(plane(), BallTool(R), lowered, reference="tip", probe_pitch_mm=0.5)
    np.testing.assert_allclose(tip.maps[0].height_mm, centre.maps[0].height_mm, atol=1e-12)


def test_a_rapid_through_the_part_gouges() -> None:
    """(1.5) G0 cuts as G1 does: 2 mm below the surface is a gouge of 2 mm, named by its line."""
    motions = [*straight_passes(1.0), Rapid(99, 700, (-5.0, 10.0, R - 2.0), (25.0, 10.0, R - 2.0))]
    verdict = judge(plane(), BallTool(R), motions, reference="centre", probe_pitch_mm=0.25)
    assert verdict.gouge_mm == pytest.approx(2.0, abs=1e-8)
    assert (verdict.gouges[0].line, verdict.gouges[0].block) == (99, 700)
    assert verdict.gouges[0].position_mm[1] == pytest.approx(10.0)


def test_an_arc_cuts_as_deep_as_it_reaches() -> None:
    """(3.2) A vertical half circle whose lowest centre stands 0.5 mm too low."""
    arc = Arc(
        7, None, (5.0, 10.0, R + 2.5), (15.0, 10.0, R + 2.5), (10.0, 10.0, R + 2.5), (0.0, -1.0, 0.0), math.pi, 1.0
    )
    down = judge(plane(), BallTool(R), [arc], reference="centre", probe_pitch_mm=0.25)
    assert down.gouge_mm == pytest.approx(2.5, abs=1e-7)


def test_thesis_job_is_read_by_the_verdict_itself() -> None:
    """(1.5) Corners of the surface stand where the file's corner control points are."""
    nominal = load_nominal(Path(__file__).parents[2] / "configs/jobs/thesis.toml")
    corners = nominal.patches[0].frames(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])).points
    np.testing.assert_allclose(corners, [[1, 1, 2], [1, 50, 2], [50, 1, 3], [50, 50, 2]])
    assert nominal.cutter.radius_mm == 4.0
