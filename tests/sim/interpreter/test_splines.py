"""Splines through points in the interpreter: ASPLINE and CSPLINE against scipy (6.3)."""

from __future__ import annotations

import random
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import Akima1DInterpolator, CubicSpline

from sim.interpreter.tangents import end_tangent, start_tangent
from tests.sim.interpreter.curves import run_all, spans_of, worst


def zigzag(count: int, seed: int) -> np.ndarray:
    rng = random.Random(seed)
    return np.array([[i * 2.0 + rng.random(), rng.uniform(-3, 3), rng.uniform(-2, 2)] for i in range(count)])


def through(points: np.ndarray, head: str, tail: str = "G0 X500") -> str:
    x, y, z = points[0]
    lines = [f"G1 X{x - 3:.17g} Y{y - 4:.17g} Z{z:.17g} F100", f"G1 X{x:.17g} Y{y:.17g} Z{z:.17g}", head]
    lines += [f"X{a:.17g} Y{b:.17g} Z{c:.17g}" for a, b, c in points[1:]]
    return "\n".join([*lines, tail])


def chord_parameters(points: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


INTO, OUT = np.array([0.6, 0.8, 0.0]), np.array([0.0, 0.6, -0.8])


@pytest.mark.parametrize("start", ["BNAT", "BTAN", "BAUTO"])
@pytest.mark.parametrize("end", ["ENAT", "ETAN", "EAUTO"])
@pytest.mark.parametrize("count", [3, 4, 20])
def test_cspline_with_every_pair_of_end_conditions(start: str, end: str, count: int) -> None:
    """(6.3)"""
    points = zigzag(count, count)
    last = points[-1] + 5 * OUT
    tail = f"G1 X{last[0]:.17g} Y{last[1]:.17g} Z{last[2]:.17g}"
    spans = spans_of(through(points, f"CSPLINE {start} {end}", tail))
    ends = {"NAT": (2, np.zeros(3)), "AUTO": "not-a-knot"}
    conditions = (ends.get(start[1:], (1, INTO)), ends.get(end[1:], (1, OUT)))
    if "not-a-knot" in conditions and conditions != ("not-a-knot", "not-a-knot") and count == 3:
        # scipy has no reference for one such end of two spans: the third derivative must be continuous
        assert spans[0].coefficients[3] == pytest.approx(spans[1].coefficients[3], abs=1e-10)
        return
    knots = chord_parameters(points)
    reference = (
        CubicSpline(knots, points, bc_type="not-a-knot")
        if conditions == ("not-a-knot", "not-a-knot")
        else CubicSpline(knots, points, bc_type=conditions)
    )
    assert worst(spans, reference) < 1e-10


def test_long_cspline_is_solved_in_windows_without_a_trace() -> None:
    """(6.3)"""
    points = zigzag(1000, 5)
    spans = spans_of(through(points, "CSPLINE BNAT ENAT"))
    assert worst(spans, CubicSpline(chord_parameters(points), points, bc_type="natural")) < 1e-9


def test_aspline_with_free_ends_is_akimas_in_the_plane() -> None:
    """(6.3) Along a straight axis with unit steps, norms of slopes are Akima's absolute values."""
    rng = np.random.default_rng(1)
    y = rng.uniform(-3, 3, 12)
    points = np.column_stack([np.arange(12.0), y, np.zeros(12)])
    spans = spans_of(through(points, "ASPLINE BAUTO EAUTO"))
    knots = chord_parameters(points)
    assert [span.end[1] for span in spans] == pytest.approx(y[1:])
    assert len(spans) == 11
    for before, after in pairwise(spans):
        assert end_tangent(before) == pytest.approx(start_tangent(after), abs=1e-9)
    straight = np.column_stack([np.arange(9.0) ** 2 / 3, np.zeros(9), np.zeros(9)])
    spans = spans_of(through(straight, "ASPLINE BAUTO EAUTO"))
    assert worst(spans, lambda t: np.array([t, 0.0, 0.0])) < 1e-12
    assert knots.shape == (12,)


def test_akima_weights_agree_with_scipy_where_the_chord_is_the_axis() -> None:
    """(6.3)"""
    from sim.interpreter.splines import akima_tangent

    rng = np.random.default_rng(2)
    x, y = np.cumsum(rng.uniform(0.5, 2, 10)), rng.uniform(-3, 3, 10)
    reference = Akima1DInterpolator(x, y)
    slopes = np.diff(y) / np.diff(x)
    for k in range(2, 8):
        four = [(0.0, float(slope), 0.0) for slope in slopes[k - 2 : k + 2]]
        assert akima_tangent(*four)[1] == pytest.approx(float(reference(x[k], 1)), abs=1e-12)


@pytest.mark.parametrize(("head", "is_tangent"), [("ASPLINE BTAN ETAN", True), ("ASPLINE BNAT ENAT", False)])
@pytest.mark.parametrize("count", [2, 3, 4, 9])
def test_aspline_end_conditions(head: str, is_tangent: bool, count: int) -> None:
    """(6.3)"""
    points = zigzag(count, 7)
    last = points[-1] + 5 * OUT
    spans = spans_of(through(points, head, f"G1 X{last[0]:.17g} Y{last[1]:.17g} Z{last[2]:.17g}"))
    assert len(spans) == count - 1
    if is_tangent:
        assert start_tangent(spans[0]) == pytest.approx(tuple(INTO), abs=1e-9)
        assert end_tangent(spans[-1]) == pytest.approx(tuple(OUT), abs=1e-9)
    else:
        assert spans[0].coefficients[2] == pytest.approx((0, 0, 0), abs=1e-9)
        second = [
            2 * spans[-1].coefficients[2][a] + 6 * spans[-1].coefficients[3][a] * spans[-1].length for a in (0, 1, 2)
        ]
        if count > 2:
            assert second == pytest.approx([0, 0, 0], abs=1e-9)


@pytest.mark.parametrize("code", ["ASPLINE", "CSPLINE"])
def test_the_end_condition_is_that_of_the_last_point(code: str) -> None:
    """(6.3) It may come with any block of the spline."""
    first = run_all(f"G1 X0 F100\n{code} ENAT X10 Y5\nX20\nX30 Y9\nG1 X30 Y20")
    last = run_all(f"G1 X0 F100\n{code} X10 Y5\nX20\nENAT X30 Y9\nG1 X30 Y20")
    tangent = run_all(f"G1 X0 F100\n{code} X10 Y5\nX20\nX30 Y9\nG1 X30 Y20")
    assert first == last != tangent


def test_a_frame_between_two_points_ends_the_spline() -> None:
    """(6.3) What is programmed in another frame is another curve."""
    head = "F100 G1 X-1\nX0\nBNAT ENAT CSPLINE X1 Y1\nX2 Y0\n"
    first = spans_of(head)
    assert spans_of(f"{head}TRANS\nX3 Y1\nX4 Y0\n")[: len(first)] == first
    assert spans_of(f"{head}X3 Y1\nX4 Y0\n")[: len(first)] != first
