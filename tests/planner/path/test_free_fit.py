"""The inside of the fit: its equations solved as a band, its derivatives, its reading of the exact curves."""

from __future__ import annotations

import numpy as np
import pytest

from planner.path.curve import CurveTable
from planner.path.free_fit import Fit, linearise, measure, places_in, start_fit
from planner.path.span_batch import SpanIndex, solve_spans
from tests.planner.path.curves import random_graph, wave_pass


@pytest.fixture(scope="module")
def table() -> CurveTable:
    return CurveTable([random_graph(1), wave_pass(), random_graph(2)])


def start(table: CurveTable, spans: list[int]) -> Fit:
    """A fit with evenly spread knots, the arc length as parameter."""
    knots = []
    for length_mm, count in zip(table.lengths_mm, spans, strict=True):
        inner = np.linspace(0.0, length_mm, count + 1)
        knots.append(np.concatenate([np.zeros(3), inner, np.full(3, length_mm)]))
    windows = [np.lib.stride_tricks.sliding_window_view(one[1:-1], 6).T for one in knots]
    arcs = np.concatenate([places_in(window) for window in windows], axis=1)
    return start_fit(table, np.arange(len(spans)), knots, arcs)


@pytest.mark.parametrize("counts", [[1], [3, 40, 7], [2, 2, 90]])
def test_the_band_is_solved_like_the_full_matrix(counts: list[int]) -> None:
    """(4.6) Splines of any size in one batch: each gets what the dense solution of its own equations gives."""
    rng = np.random.default_rng(5)
    index = SpanIndex.of(np.array(counts))
    root = rng.normal(size=(18, 20, index.counts.sum()))
    blocks = np.einsum("iks,jks->ijs", root, root)
    right = rng.normal(size=(18, index.counts.sum()))
    shape = (6, 3, 6, 3, -1)
    found = solve_spans(blocks.reshape(shape), right.reshape(6, 3, 1, -1), index, np.full(len(counts), 0.01))
    for first, count in zip(index.firsts, counts, strict=True):
        matrix, load = np.zeros((3 * (count + 5), 3 * (count + 5))), np.zeros(3 * (count + 5))
        for span in range(count):
            window = slice(3 * span, 3 * span + 18)
            matrix[window, window] += blocks[:, :, first + span]
            load[window] += right[:, first + span]
        diagonal = np.diag(matrix)
        wanted = np.linalg.solve(matrix + np.diag(0.01 * diagonal + 1e-9 * diagonal.max()), load)
        for span in range(count):
            seen = found[:, :, 0, first + span].ravel()
            np.testing.assert_allclose(seen, wanted[3 * span : 3 * span + 18], rtol=1e-9, atol=1e-12)


def test_derivatives_are_those_of_the_distance(table: CurveTable) -> None:
    """(4.4) A control point or a knot moved a little changes the distances as the derivatives say, (F6) and (F7)."""
    fit = start(table, [9, 60, 9])
    slopes = linearise(fit)
    span, step = int(fit.index.firsts[1]) + 4, 1e-5
    for number in range(14):
        sides = []
        for sign in (1.0, -1.0):
            knots, points = fit.knots.copy(), fit.points.copy()
            # The same number lives in the windows of the spans around it.
            for other in range(-5, 6):
                at = span + other
                if number < 8 and 0 <= number % 4 - other < 4:
                    points[number // 4, number % 4 - other, at] += sign * step
                elif number >= 8 and 0 <= number - 8 - other < 6:
                    knots[number - 8 - other, at] += sign * step
            sides.append(measure(table, np.arange(3), fit.index, knots, points, fit.arcs, steps=3).distance[:, span])
        # A place moves along with its knots; near the curve that is no distance.
        np.testing.assert_allclose(slopes[number, :, span], (sides[0] - sides[1]) / (2 * step), atol=1e-4)


def test_held_ends_have_no_derivative_and_lie_on_the_curve(table: CurveTable) -> None:
    """(4.3) The first and the last control point stay on the ends of the curve."""
    fit = start(table, [4, 9, 5])
    slopes = linearise(fit)
    assert not slopes[[0, 4]][:, :, fit.index.firsts].any()
    assert not slopes[[3, 7]][:, :, fit.index.lasts].any()
    for row in range(3):
        control_points = fit.spline(row)[1]
        np.testing.assert_allclose(control_points[[0, -1]], table.ends[:, :, row], atol=1e-12)


def test_the_table_reads_its_curves_as_they_are() -> None:
    """(4.3) Between samples 0.5 mm apart the reading is within a nanometre of the curve."""
    curve = wave_pass()
    arcs = np.linspace(0.0, curve.arc_mm[-1], 400).reshape(4, 100)
    points, tangents = CurveTable([random_graph(1), curve]).read(np.full(100, 1), arcs)
    exact = curve.refine(arcs.ravel())
    np.testing.assert_allclose(points.reshape(2, -1).T, exact.points, atol=1e-6)
    np.testing.assert_allclose(tangents.reshape(2, -1).T, exact.tangents, atol=1e-6)
