"""(3.2) What the verdict finds where the answer is known in closed form; all to 1e-5 mm or better."""

import itertools
import math

import numpy as np
import pytest

from sim.deviation import Verdict, judge
from sim.interpreter.canon import Arc, Line, Motion, Polynomial
from sim.nominal import Nominal
from sim.tool import BallTool, BluntTool, Tool
from tests.sim.passes import plunged
from tests.sim.surfaces import cylinder, nominal_of, plane, sphere_cap

R = 4.0


def judged(nominal: Nominal, motions: list[Motion], pitch_mm: float = 0.2, **options: float) -> Verdict:
    return judge(nominal, BallTool(R), motions, reference="centre", probe_pitch_mm=pitch_mm, **options)


def passes(pick_mm: float, slope_x: float = 0.0, slope_y: float = 0.0) -> list[Motion]:
    """Along x over the 20 mm square and beyond; `pick_mm` in plan; centres one radius off the inclined plane."""
    normal = np.array([-slope_x, -slope_y, 1.0]) / math.hypot(slope_x, slope_y, 1.0)
    made: list[Motion] = []
    for k in range(-4, round(20 / pick_mm) + 5):
        ends = [np.array([x, k * pick_mm, slope_x * x + slope_y * k * pick_mm]) + R * normal for x in (-6.0, 26.0)]
        made.append(Line(k + 5, None, tuple(ends[0]), tuple(ends[1]), 250.0))
    return made


@pytest.mark.parametrize(
    ("slope_x", "slope_y", "pitch_mm"),
    [(0.0, 0.0, 0.2), (0.6, 0.0, 0.2), (0.0, 0.6, 0.2), (-0.5, 1.0, 0.07), (-0.5, 1.0, 0.1), (-0.5, 1.0, 0.2)],
)
def test_plane(slope_x: float, slope_y: float, pitch_mm: float) -> None:
    """R - sqrt(R^2 - g^2/4), g the distance of neighbouring passes in the plane; the same from every probe grid."""
    surface = nominal_of(plane(size=5.0, slope_x=slope_x, slope_y=slope_y))
    verdict = judged(surface, passes(1.0, slope_x, slope_y), pitch_mm)
    along = np.array([1.0, 0.0, slope_x]) / math.hypot(1.0, slope_x)
    gap = np.linalg.norm(np.cross(along, [0.0, 1.0, slope_y]))
    assert verdict.scallop_mm == pytest.approx(R - math.sqrt(R * R - gap**2 / 4), abs=1e-8)
    assert verdict.gouge_mm == pytest.approx(0.0, abs=1e-9)
    assert verdict.coverage == 1.0


def test_cylinder_along() -> None:
    """Passes along a convex cylinder of radius r: centres on radius r + R, cusp height from the triangle."""
    r, step = 30.0, 0.04
    angles = np.arange(-15, 16) * step
    motions = [
        Line(k + 1, None, *((x, (r + R) * math.sin(a), (r + R) * math.cos(a)) for x in (-6.0, 14.0)), 250.0)
        for k, a in enumerate(angles)
    ]
    verdict = judged(nominal_of(cylinder(r, half_angle_rad=0.4, length_mm=8.0)), motions)
    cusp = (r + R) * math.cos(step / 2) - math.sqrt(R**2 - ((r + R) * math.sin(step / 2)) ** 2)
    assert verdict.scallop_mm == pytest.approx(cusp - r, abs=1e-8)
    assert verdict.gouge_mm < 1e-8


@pytest.mark.parametrize("is_concave", [False, True])
def test_cylinder_across(is_concave: bool) -> None:
    """Arcs across a cylinder, planes a pick feed apart: the cusp is that of a plane, whatever the cylinder's radius."""
    r, pick = 30.0, 1.2
    side, centre_radius = (-1.0, r - R) if is_concave else (1.0, r + R)
    motions: list[Motion] = []
    for k in range(-3, 12):
        low, high = (
            (k * pick, s * centre_radius * math.sin(0.5), side * centre_radius * math.cos(0.5)) for s in (-1, 1)
        )
        motions.append(Arc(k + 4, None, low, high, (k * pick, 0.0, 0.0), (-side, 0.0, 0.0), 1.0, 250.0))
    surface = nominal_of(cylinder(r, half_angle_rad=0.4, length_mm=8.0, is_concave=is_concave))
    verdict = judged(surface, motions)
    assert verdict.scallop_mm == pytest.approx(R - math.sqrt(R * R - pick**2 / 4), abs=1e-7)
    assert verdict.gouge_mm < 1e-7
    assert verdict.coverage == 1.0


def test_sphere_under_arcs() -> None:
    """A rational sphere under arcs of constant y: the highest point is a cusp, or the border between two passes."""
    r, pick = 30.0, 1.0
    motions, heights = [], np.arange(-9, 10) * pick
    for k, y in enumerate(heights):
        ring = math.sqrt((r + R) ** 2 - y * y)
        low, high = ((s * ring * math.sin(0.5), float(y), ring * math.cos(0.5)) for s in (-1, 1))
        motions.append(Arc(k + 1, None, low, high, (0.0, float(y), 0.0), (0.0, 1.0, 0.0), 1.0, 250.0))
    verdict = judged(nominal_of(sphere_cap(r, half_angle_rad=0.25)), motions)
    gaps = [(a, b) for a, b in itertools.pairwise(heights) if max(abs(a), abs(b)) < (r + R) * math.sin(0.25)]
    expected = max(*(sphere_cusp(r, a, b) for a, b in gaps), ring_height(r, 0.25, 8.0))
    assert verdict.scallop_mm == pytest.approx(expected, abs=1e-7)
    assert verdict.gouge_mm < 1e-7


def ring_height(r: float, latitude: float, y: float) -> float:
    """Height over a sphere of radius r at this latitude of the cut of a ball whose ring of centres has this y."""
    toward = y * math.sin(latitude) + math.sqrt((r + R) ** 2 - y * y) * math.cos(latitude)
    return toward - math.sqrt(R * R - (r + R) ** 2 + toward * toward) - r


def sphere_cusp(r: float, a: float, b: float) -> float:
    """Height over the sphere where the cuts of rings at y = a and b meet, by bisection on the latitude."""
    low, high = (math.asin(y / (r + R)) for y in (a, b))
    for _ in range(80):
        middle = (low + high) / 2
        if ring_height(r, middle, a) < ring_height(r, middle, b):
            low = middle
        else:
            high = middle
    return ring_height(r, low, a)


def test_sphere_touched_by_one_arc() -> None:
    """One pass over the crown touches the sphere all along: no gouge, no cusp, a strip of known width."""
    r = 30.0
    ring = r + R
    low, high = ((s * ring * math.sin(0.5), 0.0, ring * math.cos(0.5)) for s in (-1, 1))
    arc = Arc(1, None, low, high, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 1.0, 250.0)
    verdict = judged(nominal_of(sphere_cap(r, half_angle_rad=0.25)), [arc], 0.1, reach_mm=0.02)
    mapped = verdict.maps[0]
    edge = mapped.net.points[..., 1][mapped.is_covered].max()
    lat = math.acos(((r + 0.02) ** 2 + ring**2 - R**2) / (2 * ring * (r + 0.02)))
    assert edge == pytest.approx(r * math.sin(lat), abs=0.11)
    assert verdict.gouge_mm < 1e-7


def test_one_micrometre_of_gouge_is_found_and_located() -> None:
    """One move of 1 mm, 1 um too low, among 20 passes: depth, line and place, whatever the probe grid."""
    motions = passes(1.0)
    motions.append(Line(900, 77, (6.2, 7.0, R - 0.001), (7.2, 7.0, R - 0.001), 250.0))
    for pitch_mm in (0.1, 0.2, 0.5):
        verdict = judged(nominal_of(plane(size=10.0)), motions, pitch_mm)
        worst = verdict.gouges[0]
        assert verdict.gouge_mm == pytest.approx(0.001, abs=1e-8)
        assert (worst.line, worst.block) == (900, 77)
        assert 6.0 < worst.position_mm[0] < 7.4
        assert worst.position_mm[1] == pytest.approx(7.0, abs=0.1)


def test_a_missing_pass_is_found_and_located() -> None:
    """The cusp of a doubled pick feed, half way between the neighbours of the pass that is not there."""
    motions = [each for each in passes(1.0) if each.start[1] != 5.0]
    verdict = judged(nominal_of(plane(size=10.0)), motions)
    assert verdict.scallop_mm == pytest.approx(R - math.sqrt(R * R - 1.0), abs=1e-8)
    assert verdict.scallops[0].position_mm[1] == pytest.approx(5.0, abs=1e-4)


@pytest.mark.parametrize("pitch_mm", [0.07, 0.1, 0.2, 0.4])
def test_the_widest_of_uneven_gaps_is_found(pitch_mm: float) -> None:
    """(3.1, 3.2) Lines not quite parallel, 0.41 to 0.49 mm apart; a cusp of two gaps between two probes is none."""
    shifts = np.random.default_rng(3).uniform(-0.02, 0.02, (60, 2))
    y = np.arange(60)[:, None] * 0.45 - 3.0 + shifts
    motions: list[Motion] = [Line(k + 1, None, (0.0, a, R), (20.0, b, R), 250.0) for k, (a, b) in enumerate(y.tolist())]
    verdict = judged(nominal_of(plane(size=20.0)), motions, pitch_mm)
    lean = np.cos(np.arctan(np.diff(y, axis=1)[:, 0] / 20.0))[:, None]
    half = np.diff(y, axis=0) * lean[1:] * lean[:-1] / (lean[1:] + lean[:-1])
    widest = half[((y[:-1] > 0.0) & (y[1:] < 20.0)).all(axis=1)].max()
    assert verdict.scallop_mm == pytest.approx(R - math.sqrt(R * R - widest**2), abs=1e-8)


@pytest.mark.parametrize("pitch_mm", [0.07, 0.1, 0.2])
def test_a_plunge_smaller_than_the_probe_grid_is_found(pitch_mm: float) -> None:
    """(3.1, 3.2) 1 um deep, 0.05 mm wide, far from the pass before it, and the last move of the program."""
    ball, pick = BallTool(0.3), 0.1
    motions: list[Motion] = [
        Line(k + 5, None, (-6.0, k * pick, 0.3), (11.0, k * pick, 0.3), 250.0) for k in range(-9, 60)
    ]
    motions = plunged(motions, (2.13, 3.05, 0.299))
    verdict = judge(nominal_of(plane(size=5.0)), ball, motions, reference="centre", probe_pitch_mm=pitch_mm)
    assert verdict.gouge_mm == pytest.approx(0.001, abs=1e-8)
    assert verdict.gouges[0].line == 900
    assert verdict.gouges[0].position_mm == pytest.approx((2.13, 3.05, 0.0), abs=1e-3)


def test_a_plunge_leaves_the_ball() -> None:
    """A single vertical move: at distance x from its axis the hole's floor is R - sqrt(R^2 - x^2) above the deepest."""
    motions: list[Motion] = [Line(1, None, (5.0, 5.0, 30.0), (5.0, 5.0, R - 1.0), 100.0)]
    verdict = judged(nominal_of(plane(size=10.0)), motions, 0.5)
    assert verdict.gouge_mm == pytest.approx(1.0, abs=1e-9)
    mapped = verdict.maps[0]
    away = np.hypot(mapped.net.points[..., 0] - 5.0, mapped.net.points[..., 1] - 5.0)
    floor = -1.0 + R - np.sqrt(np.maximum(R * R - away**2, 0.0))
    np.testing.assert_allclose(mapped.height_mm[away < 3.0], floor[away < 3.0], atol=1e-12)


def test_the_shank_cuts_what_the_ball_does_not() -> None:
    """A move 2.5 mm deep beside a slope of 60 degrees: above the ball's equator the shank's side decides."""
    slope = math.tan(math.radians(60.0))
    surface = nominal_of(plane(size=12.0, slope_x=slope))
    motions: list[Motion] = [Line(1, None, (2.0, -6.0, 1.0), (2.0, 18.0, 1.0), 100.0)]
    verdict = judged(surface, motions, 0.1)
    normal = np.array([-slope, 0.0, 1.0]) / math.hypot(slope, 1.0)
    x = 5.5
    height = (2.0 + R - x) / normal[0]
    found = verdict.maps[0]
    at = np.abs(found.net.points[..., 0] - x).argmin(axis=0)[60]
    exact = (2.0 + R - found.net.points[at, 60, 0]) / normal[0]
    assert height < -0.4
    assert found.height_mm[at, 60] == pytest.approx(exact, abs=1e-9)


CUTTERS = [BallTool(4.0), BluntTool(1.5, 2.5), BluntTool(0.0, 4.0)]


@pytest.mark.parametrize("tool", CUTTERS, ids=["ball", "bull", "flat"])
def test_a_ring_has_the_profile_of_the_cutter(tool: Tool) -> None:
    """(3.1, 3.2) Along a circle, x beside it: flat under the end, r - sqrt(r^2 - (x - f)^2) under the edge."""
    depth, ring = 0.2, 6.0
    z = tool.corner_mm - depth
    circle: list[Motion] = [
        Arc(1, 1, (11.0, 5.0, z), (11.0, 5.0, z), (5.0, 5.0, z), (0.0, 0.0, 1.0), 2 * math.pi, 250.0)
    ]
    mapped = judge(nominal_of(plane(size=10.0)), tool, circle, reference="centre", probe_pitch_mm=0.25).maps[0]
    beside = np.abs(np.hypot(mapped.net.points[..., 0] - 5.0, mapped.net.points[..., 1] - 5.0) - ring)
    edge = np.maximum(beside - tool.flat_mm, 0.0)
    floor = tool.corner_mm - np.sqrt(np.maximum(tool.corner_mm**2 - edge**2, 0.0)) - depth
    near = (beside < 3.95) & (floor < 0.9)
    np.testing.assert_allclose(mapped.height_mm[near], floor[near], atol=5e-7)
    assert near.mean() > 0.6


@pytest.mark.parametrize("tool", CUTTERS, ids=["ball", "bull", "flat"])
def test_the_same_way_written_otherwise(tool: Tool) -> None:
    """(3.1) A line as a cubic of uneven speed, a quarter circle as a rational curve: the same heights."""
    a, b = np.array([-5.0, 1.0, 1.7]), np.array([9.0, 6.1, 0.4])
    uneven = tuple(map(tuple, (a, 0.5 * (b - a), 1.5 * (b - a), -1.0 * (b - a))))
    # (2 + 6 cos, 1 + 6 sin, 1) with t = tan of half the angle, times 1 + t^2
    quarter = ((8.0, 1.0, 1.0), (0.0, 12.0, 0.0), (-4.0, 1.0, 1.0))
    pairs: list[tuple[Motion, Motion, float]] = [
        (Line(1, 1, tuple(a), tuple(b), 1.0), Polynomial(1, 1, tuple(a), tuple(b), uneven, (1.0,), 1.0, 1.0), 1e-11),
        (
            Arc(1, 1, (8.0, 1.0, 1.0), (2.0, 7.0, 1.0), (2.0, 1.0, 1.0), (0.0, 0.0, 1.0), math.pi / 2, 1.0),
            Polynomial(1, 1, (8.0, 1.0, 1.0), (2.0, 7.0, 1.0), quarter, (1.0, 0.0, 1.0), 1.0, 1.0),
            1e-6,
        ),
    ]
    for one, two, slack_mm in pairs:
        heights = [
            judge(nominal_of(plane(size=10.0, slope_x=0.2)), tool, [way], reference="centre", probe_pitch_mm=0.5).maps[
                0
            ]
            for way in (one, two)
        ]
        np.testing.assert_allclose(heights[0].height_mm, heights[1].height_mm, rtol=0.0, atol=slack_mm)
        assert heights[0].is_covered.mean() > 0.1
