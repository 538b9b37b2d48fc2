import dataclasses
import math

import numpy as np
import pytest

from sim.interpreter.canon import Arc, Line, Motion, Polynomial, Rapid
from sim.probe import probes_of
from sim.sweep import sweep_of
from sim.tool import BallTool, BluntTool, Tool
from tests.sim import reference

R = 4.0


def random_motions(rng: np.random.Generator, count: int) -> list[Motion]:
    """Motions of all kinds about the square (-4, -4) to (4, 4), centres about one radius above z = 0."""
    made: list[Motion] = []
    for line in range(1, count + 1):
        a, b = (tuple(rng.uniform((-4, -4, R - 0.6), (4, 4, R + 1.5))) for _ in range(2))
        kind = rng.integers(4)
        if kind == 0:
            made.append(Line(line, None, a, b, 100.0))
        elif kind == 1:
            made.append(Rapid(line, None, a, (a[0], a[1], b[2]) if rng.random() < 0.5 else (b[0], b[1], a[2])))
        elif kind == 2:
            coefficients = (a, *(tuple(rng.normal(0, s, 3)) for s in (2.0, 0.5, 0.2)))
            denominator = (1.0, 0.3, 0.1) if rng.random() < 0.5 else (1.0,)
            top = np.array(coefficients).sum(axis=0) / sum(denominator)
            made.append(Polynomial(line, None, a, tuple(top), coefficients, denominator, 1.0, 100.0))
        else:
            made.append(arc(line, a, rng))
    return made


def arc(line: int, start: tuple[float, ...], rng: np.random.Generator) -> Arc:
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    centre = np.array(start) + rng.uniform(-2, 2, 3)
    centre = centre - np.dot(centre - start, axis) * axis
    sweep, rise = rng.uniform(0.3, 5.0), rng.uniform(-0.5, 0.5)
    spoke = np.array(start) - centre
    end = centre + math.cos(sweep) * spoke + math.sin(sweep) * np.cross(axis, spoke) + rise * axis
    return Arc(line, None, start, tuple(end), tuple(centre), tuple(axis), sweep, 100.0)


def rays(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    points = np.column_stack([rng.uniform(-4, 4, (count, 2)), rng.uniform(-0.1, 0.1, count)])
    normals = np.column_stack([rng.normal(0, 0.4, (count, 2)), np.ones(count)])
    return points, normals / np.linalg.norm(normals, axis=1)[:, None]


BLUNT = [BluntTool(1.5, 2.5), BluntTool(0.0, R)]
TOOLS = [(BallTool(R), 50), *((each, 50) for each in BLUNT), (BluntTool(0.1, 3.9), 15), (BluntTool(3.9, 0.1), 15)]


@pytest.mark.parametrize(("tool", "programs"), TOOLS, ids=str)
def test_brute_force_agrees(tool: Tool, programs: int) -> None:
    """(3.1, 3.2) A slow solver of another kind finds the same ends of the material on small random programs."""
    apart = []
    for seed in range(programs):
        rng = np.random.default_rng(seed)
        motions = random_motions(rng, 4)
        lift_mm = tool.corner_mm - R
        sweep = sweep_of(motions, lift_mm, sag_mm=0.005, length_mm=1.3, fit_mm=1e-7)
        points, normals = rays(rng, 3)
        found = probes_of(sweep, tool, reach_mm=1.0).measure(points, normals).height_mm
        true = [reference.height(*ray, motions, tool, lift_mm) for ray in zip(points, normals, strict=True)]
        reached = np.array(true) < 1.0
        np.testing.assert_array_equal(np.isfinite(found), reached)
        apart += np.abs(found[reached] - np.array(true)[reached]).tolist()
    assert max(apart) < 1e-6
    assert len(apart) > 1.8 * programs


@pytest.mark.parametrize("tool", BLUNT, ids=["bull", "flat"])
def test_uncompiled_gives_the_compiled_figures(tool: Tool) -> None:
    """(3.4) Without numba the same heights under a flat end."""
    pytest.importorskip("numba")
    rng = np.random.default_rng(7)
    sweep = sweep_of(random_motions(rng, 12), tool.corner_mm - R, sag_mm=0.005, length_mm=1.3, fit_mm=1e-7)
    fast = probes_of(sweep, tool, reach_mm=1.0)
    points, normals = rays(rng, 40)
    one, two = (
        each.measure(points, normals).height_mm for each in (fast, dataclasses.replace(fast, is_compiled=False))
    )
    np.testing.assert_allclose(one, two, atol=1e-9)
    assert np.isfinite(one).any()


@pytest.mark.parametrize("seed", range(12))
def test_numpy_gives_the_compiled_figures(seed: int) -> None:
    """(3.4) Without numba the same heights, the same pieces."""
    pytest.importorskip("numba")
    rng = np.random.default_rng(100 + seed)
    motions = random_motions(rng, 12)
    fast = probes_of(sweep_of(motions, 0.0, sag_mm=0.005, length_mm=1.3, fit_mm=1e-7), BallTool(R), reach_mm=1.0)
    pure = dataclasses.replace(fast, is_compiled=False)
    points, normals = rays(rng, 700)
    one, two = fast.measure(points, normals), pure.measure(points, normals)
    np.testing.assert_array_equal(np.isfinite(one.height_mm), np.isfinite(two.height_mm))
    reached = np.isfinite(one.height_mm)
    np.testing.assert_allclose(one.height_mm[reached], two.height_mm[reached], atol=1e-10)
    assert (one.height_mm[reached] < 0).any()
    assert (one.height_mm[reached] > 0).any()


def test_a_long_straight_move_is_exact_far_from_its_ends() -> None:
    """(3.1) Splitting a line changes nothing: the depth below a slope of 45 degrees is that of a cylinder."""
    motions = [Line(1, None, (-60.0, 0.0, R - 60.0), (60.0, 0.0, R + 60.0), 1.0)]
    probes = probes_of(sweep_of(motions, 0.0, sag_mm=0.005, length_mm=1.3, fit_mm=1e-7), BallTool(R), reach_mm=1.0)
    normal = np.array([-1.0, 0.0, 1.0]) / math.sqrt(2.0)
    centre = np.array([3.3, 0.0, R + 3.3])
    point = centre - (R - 0.25) * normal
    found = probes.measure(point[None], normal[None])
    assert found.height_mm[0] == pytest.approx(-0.25, abs=1e-12)


def test_no_motions_reach_nothing() -> None:
    """(3.1) An empty program leaves everything."""
    probes = probes_of(sweep_of([], 0.0, sag_mm=0.005, length_mm=1.3, fit_mm=1e-7), BallTool(R), reach_mm=1.0)
    found = probes.measure(np.zeros((3, 3)), np.tile([0.0, 0.0, 1.0], (3, 1)))
    assert np.isinf(found.height_mm).all()


@pytest.mark.parametrize("is_compiled", [True, False])
def test_a_ball_that_goes_over_a_hump_cuts_lowest_at_its_feet(is_compiled: bool) -> None:
    """(3.1) On a bend sharper than the ball the middle is the highest place: the ends cut, R - sqrt(R^2 - x^2)."""
    hump = ((-0.15, 0.0, R), (0.3, 0.0, 0.016), (0.0, 0.0, -0.016))
    motion = Polynomial(1, None, hump[0], (0.15, 0.0, R), hump, (1.0,), 1.0, 1.0)
    probes = probes_of(sweep_of([motion], 0.0, sag_mm=0.005, length_mm=1.3, fit_mm=1e-7), BallTool(R), reach_mm=1.0)
    probes = dataclasses.replace(probes, is_compiled=is_compiled)
    x = np.linspace(-0.1, 0.1, 9)
    points = np.column_stack([x, np.zeros((9, 2))])
    found = probes.measure(points, np.tile([0.0, 0.0, 1.0], (9, 1))).height_mm
    np.testing.assert_allclose(found, R - np.sqrt(R * R - (0.15 - np.abs(x)) ** 2), atol=1e-12)


@pytest.mark.parametrize("is_compiled", [True, False])
def test_a_shank_cuts_before_its_own_ball(is_compiled: bool) -> None:
    """(3.1) A slanting ray meets one shank, then, lower, another, whose ball it would enter above both."""
    motions: list[Motion] = [
        Line(1, None, (2.011, -1.0, 0.0), (2.011, 1.0, 0.0), 1.0),
        Line(2, None, (2.0, -1.0, 0.8), (2.0, 1.0, 0.8), 1.0),
    ]
    probes = probes_of(sweep_of(motions, 0.0, sag_mm=0.001, length_mm=9.0, fit_mm=1e-7), BallTool(1.0), reach_mm=2.0)
    probes = dataclasses.replace(probes, is_compiled=is_compiled)
    found = probes.measure(np.zeros((1, 3)), np.array([[1.0, 0.0, 1.0]]) / math.sqrt(2.0))
    assert found.height_mm[0] == pytest.approx(math.sqrt(2.0), abs=1e-12)
    assert probes.sweep.motion[found.piece[0]] == 1
