"""Passes as heights of degree 5: few spans, smooth joints, derivatives and starts of their fit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from planner.path.height_fit import (
    SHARES,
    HeightFit,
    _linearise,
    _move,
    _third_derivatives,
    measure,
    start_heights,
    step,
)
from planner.path.height_fitter import HeightFitter
from planner.path.height_table import HeightTable
from planner.path.spans import joints_of
from planner.path.spline import fit_heights, fit_leanest, fit_passes
from planner.path.strategy.parallel import Wishes, lay_parallel
from tests.planner.path.curves import arc, offset_graph, random_graph, sine, wave_pass
from tests.planner.surfaces import thesis_patch


@pytest.fixture(scope="module")
def table() -> HeightTable:
    return HeightTable([random_graph(1), wave_pass(), random_graph(2)])


def start(table: HeightTable, spans: list[int]) -> HeightFit:
    ends = zip(table.begins, table.ends, spans, strict=True)
    return start_heights(table, np.arange(3), [np.linspace(begin, end, count + 1) for begin, end, count in ends])


def test_the_wave_needs_few_blocks_at_any_tolerance() -> None:
    """(4.4, 4.5) Spans of a 300 mm pass over the wave grow more slowly than the fourth root of 1 / tolerance."""
    tolerances = 10.0 ** -np.arange(2.0, 4.1, 0.5)
    spans = [fitted.spans for tol in tolerances for fitted in fit_heights([wave_pass()], tol) if fitted is not None]
    assert len(spans) == 5
    assert spans[2] <= 10
    assert -np.polyfit(np.log(tolerances), np.log(spans), 1)[0] <= 0.25


def test_joints_are_smooth_and_w_runs_evenly(table: HeightTable) -> None:
    """(4.4) Height, slope and second derivative do not jump; the parameter is w; the ends are the curve's."""
    curve = random_graph(2)
    (fitted,) = fit_heights([curve], 0.001)
    assert fitted is not None
    spline = fitted.spline
    at = BSpline(spline.knots, spline.control_points, 5)
    places = np.linspace(spline.knots[0], spline.knots[-1], 101)
    np.testing.assert_allclose(at(places)[:, 0], places, atol=1e-12)
    np.testing.assert_allclose(at(places[[0, -1]]), curve.points[[0, -1]], atol=1e-12)
    for joint in joints_of(spline)[1:-1]:
        for order in range(3):
            before, after = (at.derivative(order)(joint + side) for side in (-1e-9, 1e-9))
            np.testing.assert_allclose(before, after, atol=1e-8)


def test_a_pass_takes_the_cubic_where_that_has_fewer_spans() -> None:
    """(4.4) Neither kind is always the leaner one; a pass too steep for heights is a cubic."""
    curves = lay_parallel(thesis_patch(), Wishes(4.0, 0.0, None, 2.5), accuracy_mm=1e-7).curves
    chosen = fit_leanest(curves, 0.001)
    for height, cubic, one in zip(fit_heights(curves, 0.001), fit_passes(curves, 0.001), chosen, strict=True):
        assert height is not None
        assert one.spans == min(height.spans, cubic.spans)
        assert one.spline.degree == (3 if cubic.spans < height.spans else 5)
    assert {one.spline.degree for one in chosen} == {3, 5}
    steep = offset_graph(sine(25.0, 12.0), 4.0, 0.0, 60.0)
    assert fit_heights([steep], 0.001) == [None]
    assert fit_leanest([steep, wave_pass()], 0.001)[0].spline.degree == 3


def test_derivatives_are_those_of_the_distance(table: HeightTable) -> None:
    """(4.4) What a joint says, changed a little, changes the distances as the derivatives say, (F19)."""
    fit = start(table, [3, 9, 4])
    damping = np.full(3, 1e-4)
    for _ in range(12):
        fit, damping = step(table, np.arange(3), fit, 2, damping)
    thirds = _third_derivatives(fit)
    slopes, scale = _linearise(fit, thirds)
    span = int(fit.index.firsts[1]) + 4
    pair = slice(span, span + 2)
    places = fit.joints[0, pair] + SHARES * (fit.joints[1, pair] - fit.joints[0, pair])
    for number in range(4):
        sides = []
        for sign in (1e-5, -1e-5):
            change = np.zeros((2, 4, slopes.shape[3]))
            change[1, number, span] = change[0, number, span + 1] = sign * scale[number, span]
            spline = measure(table, np.arange(3), fit.index, *_move(fit, thirds.mean(axis=0), change)).spline(1)
            sides.append(BSpline(spline.knots, spline.control_points, 5)(places)[..., 1] * fit.lean[:, pair])
        expected = np.stack([slopes[1, number, :, span], slopes[0, number, :, span + 1]], axis=1)
        np.testing.assert_allclose(expected, (sides[0] - sides[1]) / 2e-5, atol=1e-6)


def test_held_ends_have_no_derivative(table: HeightTable) -> None:
    """(4.3) Both ends stay where the curve ends."""
    fit = start(table, [3, 9, 4])
    slopes, _ = _linearise(fit, _third_derivatives(fit))
    assert not slopes[0][[0, 3]][:, :, fit.index.firsts].any()
    assert not slopes[1][[0, 3]][:, :, fit.index.lasts].any()


def test_fresh_joints_stand_closer_where_it_is_harder() -> None:
    """(4.4) Along a curve that bends sharply in one half only, most joints stand there, (F21)."""
    curve = offset_graph(_half_wave, 4.0, 0.0, 200.0)
    joints = HeightFitter([curve]).fresh({0: 10})[0].joints
    assert joints[0] == 0.0
    assert joints[-1] == 1.0
    assert np.count_nonzero(joints > 0.5) >= 6


def _half_wave(w: np.ndarray, k: int) -> np.ndarray:
    """4 sin(w / 12) switched on smoothly about w = 100, with derivatives by small differences of its closed form."""
    step_mm = 1e-2

    def value(at: np.ndarray) -> np.ndarray:
        return 4 * np.sin(at / 12) / (1 + np.exp(-(at - 100) / 8))

    shifts = {0: [(0, 1.0)], 1: [(1, 0.5), (-1, -0.5)], 2: [(1, 1.0), (0, -2.0), (-1, 1.0)]}
    shifts[3] = [(2, 0.5), (1, -1.0), (-1, 1.0), (-2, -0.5)]
    return np.asarray(sum(weight * value(w + n * step_mm) for n, weight in shifts[k]) / step_mm**k)


def test_the_table_reads_its_curves_as_they_are() -> None:
    """(4.3) Between samples 0.5 mm apart the height is within a nanometre of the curve."""
    curve = wave_pass()
    exact = curve.refine(np.linspace(0.0, curve.arc_mm[-1], 400))
    rows = np.full(100, 1)
    height, slope, bend = HeightTable([arc(30.0, 2.0, 1.2), curve]).read(rows, exact.points[:, 0].reshape(4, 100))
    np.testing.assert_allclose(height.ravel(), exact.points[:, 1], atol=1e-6)
    np.testing.assert_allclose(slope.ravel(), exact.tangents[:, 1] / exact.tangents[:, 0], atol=1e-5)
    np.testing.assert_allclose(bend.ravel(), exact.curvatures / exact.tangents[:, 0] ** 3, atol=1e-4)
