"""BSPLINE in the interpreter: against POLY and scipy, words it does not take, rational spans (6.3, 2.3)."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import BSpline

from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import KnotRule, Settings
from sim.interpreter.tangents import curve_derivative, start_tangent
from tests.sim.interpreter.curves import ORIGIN, alarm_of, at, run_all, spans_of, worst

WORKED = """N100 G1 X0 Y12.5 Z0 F250
N110 BSPLINE SD=3 X10 Z2 PL=0
N120 X20 Z-4 PL=20
N130 X32 Z-6 PL=15
N140 X45 Z1 PL=25
N150 X60 Z0 PL=0
N160 G1 X60 Z10
"""
POLY = """N100 G1 X0 Y12.5 Z0 F250
N110 POLY PO[X]=(20.4489795918,-.032142857143,.00041326530612) PO[Z]=(-3.2789115646,-.040714285714,.00087585034)PL=20
N120 PO[X]=(30.703125,-0.007346938776,0.00037159863946) PO[Z]=(-4.494791666667,0.011836734694,0.00008418367347) PL=15
N130 PO[X]=(60,0.009375,0.000315) PO[Z]=(0,0.015625,-0.00055233333333) PL=25
"""


def test_bspline_is_the_curve_that_poly_writes_out() -> None:
    """(2.3, 6.3)"""
    spline, poly = spans_of(WORKED), spans_of(POLY)
    assert [span.length for span in spline] == [20.0, 15.0, 25.0]
    assert [span.block for span in spline] == [130, 140, 150]
    for a, b in zip(spline, poly, strict=True):
        for share in np.linspace(0, 1, 11):
            assert at(a, share * a.length) == pytest.approx(at(b, share * b.length), abs=1e-9)


def test_genua_rule_writes_the_intervals_one_block_earlier() -> None:
    """(2.3)"""
    text = """G1 X0 Y12.5 Z0 F250
    BSPLINE SD=3
    X0 Y12.5 Z0 PL=0
    X10 Y12.5 Z2 PL=20
    X20 Z-4 PL=15
    X32 Z-6 PL=25
    X45 Z1 PL=0
    X60 Z0 PL=0"""
    genua = spans_of(text, Settings(start_mm=ORIGIN, knot_rule=KnotRule.GENUA))
    assert [span.coefficients for span in genua] == [span.coefficients for span in spans_of(WORKED)]


def program(points: np.ndarray, knots: np.ndarray, degree: int, weights: np.ndarray | None = None) -> str:
    lines = [f"G1 X{points[0][0]:.17g} Y{points[0][1]:.17g} Z{points[0][2]:.17g} F100", f"BSPLINE SD={degree}"]
    for i in range(1, len(points)):
        x, y, z = points[i]
        weight = "" if weights is None else f" PW={weights[i]:.17g}"
        lines.append(f"X{x:.17g} Y{y:.17g} Z{z:.17g} PL={knots[i + 2] - knots[i + 1]:.17g}{weight}")
    return "\n".join(lines) + "\nG0 Z100"


@pytest.mark.parametrize("degree", [2, 3])
@pytest.mark.parametrize("count", [4, 5, 9, 40, 700])
def test_random_bsplines_agree_with_scipy(degree: int, count: int) -> None:
    """(6.3)"""
    rng = np.random.default_rng(degree * 1000 + count)
    points = np.round(rng.uniform(-50, 50, (count, 3)), 4)
    inner = np.cumsum(np.round(rng.uniform(0.5, 4, count - degree), 4))
    knots = np.concatenate([[0.0] * (degree + 1), inner, [inner[-1]] * degree])
    spans = spans_of(program(points, knots, degree))
    assert len(spans) == count - degree
    assert worst(spans, BSpline(knots, points, degree)) < 1e-9
    for before, after in pairwise(spans):
        assert before.end == after.start == after.coefficients[0]


def test_weights_make_the_curve_rational() -> None:
    """(6.3)"""
    rng = np.random.default_rng(3)
    points = np.round(rng.uniform(-50, 50, (8, 3)), 4)
    weights = np.round(rng.uniform(0.3, 3, 8), 4)
    weights[0] = 1.0
    knots = np.array([0.0] * 4 + [1, 2.5, 3, 7] + [9.0] * 4)
    homogeneous = BSpline(knots, np.column_stack([points * weights[:, None], weights]), 3)
    spans = spans_of(program(points, knots, 3, weights))
    assert all(span.denominator[0] == 1.0 and len(span.denominator) == 4 for span in spans)
    assert worst(spans, lambda t: homogeneous(t)[:3] / homogeneous(t)[3]) < 1e-10


def test_two_curves_in_one_pass_exactly_through_the_joint() -> None:
    """(6.3)"""
    text = WORKED.replace("N160 G1 X60 Z10\n", "X70 Z5 PL=0\nX80 Z0 PL=18\nX90 Z4 PL=12\nX95 Z0 PL=0\n")
    spans = spans_of(text)
    assert spans[2].end == (60.0, 12.5, 0.0)
    assert [span.length for span in spans] == [20.0, 15.0, 25.0, 18.0, 12.0]
    assert spans[-1].end == (95.0, 12.5, 0.0)


def test_without_pl_the_knots_are_uniform_and_clamped() -> None:
    """(6.3) The manual's sample: the curve starts and ends along its polygon."""
    text = "G1 X0 Y0 F300\nBSPLINE\nX10 Y20\nX20 Y40\nX30 Y30\nX40 Y45\nX50 Y0\nG0 Z9"
    points = np.array([[0, 0, 0], [10, 20, 0], [20, 40, 0], [30, 30, 0], [40, 45, 0], [50, 0, 0]], dtype=float)
    spans = spans_of(text)
    assert worst(spans, BSpline(np.array([0.0] * 4 + [1, 2] + [3.0] * 4), points, 3)) < 1e-12
    assert start_tangent(spans[0]) == pytest.approx((1 / math.sqrt(5), 2 / math.sqrt(5), 0))


@pytest.mark.parametrize(
    ("blocks", "words"),
    [
        ("BSPLINE X1 PL=5\nX2 PL=1\nX3 PL=1\nX4 PL=0", "PL=0 is expected in its first block"),
        ("BSPLINE X1 PL=0\nX2 PL=1\nX3 PL=1\nX4 PL=2\nG0 Z1", "PL=0 is expected in its last block"),
        ("BSPLINE X1 PL=0\nX2 PL=1\nX3", "in all or none"),
        ("BSPLINE X1\nX2\nG0 Z1", "at least 4"),
        ("BSPLINE X1 PW=4", "up to 3"),
        ("BSPLINE X1 PL=-1", "0 or more"),
        ("BSPLINE SD=4 X1", "2 or 3"),
        ("BSPLINE SD=4", "2 or 3"),
        ("BSPLINE X1 PL=0\nX2 PL=1\nX3 PL=0\nX4 PL=0\nX5 PL=0", "too often"),
        ("BSPLINE X1 PL=0\nX2 PL=29\nX3 PL=0\nX4 PL=0\nG1 Z1", "too often at the end"),
        ("ASPLINE X1 PL=1", "neither PL nor PW"),
        ("BSPLINE X1\nX2 SD=2", "inside a BSPLINE"),
    ],
)
def test_what_a_spline_does_not_take(blocks: str, words: str) -> None:
    """(6.3)"""
    assert words in alarm_of("G1 X0 F100\n" + blocks)


def test_spans_go_out_as_soon_as_they_are_decided() -> None:
    """(6.3) A drip-fed curve must not wait for its end."""
    from sim.interpreter.run import Interpreter

    interpreter = Interpreter(Settings(start_mm=ORIGIN))
    given = [len(interpreter.block(line.encode(), k + 1)) for k, line in enumerate(WORKED.splitlines())]
    assert given == [1, 0, 0, 0, 1, 1, 2]


def test_the_degree_may_be_said_again_but_not_changed() -> None:
    """(6.3) SD in a block of its own, before the points or between them."""
    points = "X10 Y5\nX20\nX30 Y0\nX40 Y5\n"
    once = run_all(f"G1 X0 F100\nBSPLINE SD=2\n{points}G1 X50")
    again = run_all(f"G1 X0 F100\nBSPLINE\nSD=2\n{points}BSPLINE SD=2\nG1 X50")
    assert [one.end for one in once] == [one.end for one in again]
    changed = run_all(f"G1 X0 F100\nBSPLINE SD=2\n{points}SD=3\nX60")
    assert isinstance(changed[-1], canon.Alarm)
    assert "SD changes inside" in changed[-1].text


def test_words_between_spline_blocks_keep_their_place() -> None:
    """(6.3)"""
    text = WORKED.replace("N130", "N125 M8\nN130")
    found = [type(command).__name__ for command in interpret(text.encode(), Settings(start_mm=ORIGIN))]
    assert found == ["Line", "Coolant", "Polynomial", "Polynomial", "Polynomial", "Line"]


def test_derivative_of_a_rational_span() -> None:
    """(6.3)"""
    arc = spans_of("G1 X10 F100\nPOLY PO[X]=(0,-10) PO[Y]=(10) PO[]=(2,1)")[0]
    step = 1e-6
    for p in (0.2, 0.7):
        slope = (at(arc, p + step) - at(arc, p - step)) / (2 * step)
        assert curve_derivative(arc, p) == pytest.approx(slope, abs=1e-6)
