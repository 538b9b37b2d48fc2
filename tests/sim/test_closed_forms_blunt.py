"""(3.2) What the verdict finds of bull-nose and flat cutters where the answer is known in closed form."""

import math

import numpy as np
import pytest

from sim.deviation import judge
from sim.interpreter.canon import Line, Motion
from sim.tool import BluntTool
from tests.sim.passes import plunged
from tests.sim.surfaces import nominal_of, plane


def touching(tool: BluntTool, pick_mm: float, slope: float) -> list[Motion]:
    """Passes along x whose rounded edge touches the plane z = slope y every `pick_mm` in plan."""
    normal = np.array([0.0, -slope, 1.0]) / math.hypot(slope, 1.0)
    aside = np.array([0.0, -tool.flat_mm if slope > 0 else 0.0, 0.0])
    made: list[Motion] = []
    for k in range(-9, round(10 / pick_mm) + 10):
        at = np.array([0.0, k * pick_mm, slope * k * pick_mm]) + tool.corner_mm * normal + aside
        made.append(Line(k + 10, None, (-9.0, at[1], at[2]), (19.0, at[1], at[2]), 250.0))
    return made


@pytest.mark.parametrize("pitch_mm", [0.1, 0.2])
@pytest.mark.parametrize("slope", [0.3, 1.0])
def test_bull_on_an_inclined_plane(slope: float, pitch_mm: float) -> None:
    """(3.1, 3.2) Across the slope a bull-nose cutter leaves the cusp of its corner: r - sqrt(r^2 - g^2/4)."""
    tool, pick = BluntTool(1.5, 2.5), 0.4
    surface = nominal_of(plane(size=5.0, slope_y=slope))
    verdict = judge(surface, tool, touching(tool, pick, slope), reference="centre", probe_pitch_mm=pitch_mm)
    gap = pick * math.hypot(1.0, slope)
    assert verdict.scallop_mm == pytest.approx(1.5 - math.sqrt(1.5**2 - gap**2 / 4), abs=1e-7)
    assert verdict.gouge_mm == pytest.approx(0.0, abs=1e-8)
    assert verdict.coverage == 1.0


def test_flat_on_an_inclined_plane() -> None:
    """(3.1, 3.2) Across the slope a sharp edge leaves steps, p sin(angle) high, square to the plane."""
    tool, pick, slope = BluntTool(0.0, 4.0), 0.5, 0.5
    surface = nominal_of(plane(size=5.0, slope_y=slope))
    verdict = judge(surface, tool, touching(tool, pick, slope), reference="centre", probe_pitch_mm=0.1)
    assert verdict.scallop_mm == pytest.approx(pick * math.sin(math.atan(slope)), abs=1e-5)
    assert verdict.gouge_mm == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("pitch_mm", [0.07, 0.1, 0.2])
@pytest.mark.parametrize("slope", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("tool", [BluntTool(1.5, 2.5), BluntTool(0.0, 4.0)], ids=["bull", "flat"])
def test_a_low_pass_and_a_plunge_of_a_flat_end_are_found_on_a_slope(
    tool: BluntTool, slope: float, pitch_mm: float
) -> None:
    """(3.1, 3.2) A sharp edge 1 um too low makes a groove 2 um wide, between all probes."""
    surface, good = nominal_of(plane(size=5.0, slope_y=slope)), touching(tool, 0.5, slope)
    down = 0.001 * np.array([0.0, -slope, 1.0]) / math.hypot(slope, 1.0)
    low: list[Motion] = [
        Line(900, 9, tuple(each.start - down), tuple(each.end - down), 250.0) if k == 14 else each
        for k, each in enumerate(good)
    ]
    at = np.array([1.13, *good[14].start[1:]]) - down + 0.23 * np.array([0.0, 1.0, slope])
    for motions in (low, plunged(good, tuple(at))):
        verdict = judge(surface, tool, motions, reference="centre", probe_pitch_mm=pitch_mm)
        assert verdict.gouge_mm == pytest.approx(0.001, abs=1e-8)
        assert verdict.gouges[0].line == 900


@pytest.mark.parametrize("tool", [BluntTool(1.5, 2.5), BluntTool(0.0, 4.0)], ids=["bull", "flat"])
def test_a_flat_end_leaves_level_ground_level(tool: BluntTool) -> None:
    """(3.1, 3.2) No cusp from passes nearer than the flat end is wide; one pass 1 um too low is found."""
    motions = touching(tool, 2.0, 0.0)
    level = judge(nominal_of(plane(size=5.0)), tool, motions, reference="centre", probe_pitch_mm=0.2)
    assert (level.scallop_mm, level.gouge_mm) == pytest.approx((0.0, 0.0), abs=1e-11)
    assert level.inaccessible == 0.0
    height = tool.corner_mm - 0.001
    low = [*motions, Line(900, 9, (2.0, 2.0, height), (3.0, 2.0, height), 250.0)]
    verdict = judge(nominal_of(plane(size=5.0)), tool, low, reference="centre", probe_pitch_mm=0.2)
    assert verdict.gouge_mm == pytest.approx(0.001, abs=1e-10)
    assert verdict.gouges[0].line == 900


def test_a_bull_plunges_its_own_profile() -> None:
    """(3.2) A vertical move: flat to the corner, then r - sqrt(r^2 - (x - f)^2) above the floor."""
    tool = BluntTool(1.5, 2.5)
    motions: list[Motion] = [Line(1, None, (5.0, 5.0, 30.0), (5.0, 5.0, 0.5), 100.0)]
    mapped = judge(nominal_of(plane(size=10.0)), tool, motions, reference="centre", probe_pitch_mm=0.5).maps[0]
    away = np.hypot(mapped.net.points[..., 0] - 5.0, mapped.net.points[..., 1] - 5.0)
    edge = np.maximum(away - 2.5, 0.0)
    floor = -1.0 + 1.5 - np.sqrt(np.maximum(1.5**2 - edge**2, 0.0))
    np.testing.assert_allclose(mapped.height_mm[away < 3.7], floor[away < 3.7], atol=1e-11)
