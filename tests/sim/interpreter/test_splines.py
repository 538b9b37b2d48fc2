"""Splines in the interpreter: BSPLINE against POLY and scipy, ASPLINE and CSPLINE against scipy (6.3, 2.3)."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import Akima1DInterpolator, BSpline, CubicSpline

from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import KnotRule, Settings
from sim.interpreter.tangents import curve_derivative, end_tangent, start_tangent

ORIGIN = (0.0, 0.0, 0.0)


def spans_of(text: str, settings: Settings | None = None) -> list[canon.Polynomial]:
    found = list(interpret(text.encode(), settings or Settings(start_mm=ORIGIN)))
    assert not any(isinstance(command, canon.Alarm) for command in found), found[-1]
    return [command for command in found if isinstance(command, canon.Polynomial)]


def alarm_of(text: str, settings: Settings | None = None) -> str:
    found = list(interpret(text.encode(), settings or Settings(start_mm=ORIGIN)))[-1]
    assert isinstance(found, canon.Alarm)
    return found.text


def at(span: canon.Polynomial, p: float) -> np.ndarray:
    weight = sum(d * p**k for k, d in enumerate(span.denominator))
    return np.array([sum(c[axis] * p**k for k, c in enumerate(span.coefficients)) for axis in range(3)]) / weight


def worst(spans: list[canon.Polynomial], curve, start: float = 0.0) -> float:
    """Largest distance from a curve of the same parameter."""
    far, knot = 0.0, start
    for span in spans:
        for share in np.linspace(0, 1, 9):
            far = max(far, float(np.abs(at(span, share * span.length) - curve(knot + share * span.length)).max()))
        knot += span.length
    return far


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


def run_all(text: str) -> list[canon.Command]:
    return list(interpret(text.encode(), Settings(start_mm=(0.0, 0.0, 0.0))))


def test_the_degree_may_be_said_again_but_not_changed() -> None:
    """(6.3) SD in a block of its own, before the points or between them."""
    points = "X10 Y5\nX20\nX30 Y0\nX40 Y5\n"
    once = run_all(f"G1 X0 F100\nBSPLINE SD=2\n{points}G1 X50")
    again = run_all(f"G1 X0 F100\nBSPLINE\nSD=2\n{points}BSPLINE SD=2\nG1 X50")
    assert [one.end for one in once] == [one.end for one in again]
    changed = run_all(f"G1 X0 F100\nBSPLINE SD=2\n{points}SD=3\nX60")
    assert isinstance(changed[-1], canon.Alarm)
    assert "SD changes inside" in changed[-1].text


@pytest.mark.parametrize("code", ["ASPLINE", "CSPLINE"])
def test_the_end_condition_is_that_of_the_last_point(code: str) -> None:
    """(6.3) It may come with any block of the spline."""
    first = run_all(f"G1 X0 F100\n{code} ENAT X10 Y5\nX20\nX30 Y9\nG1 X30 Y20")
    last = run_all(f"G1 X0 F100\n{code} X10 Y5\nX20\nENAT X30 Y9\nG1 X30 Y20")
    tangent = run_all(f"G1 X0 F100\n{code} X10 Y5\nX20\nX30 Y9\nG1 X30 Y20")
    assert first == last != tangent


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


def test_a_frame_between_two_points_ends_the_spline() -> None:
    """(6.3) What is programmed in another frame is another curve."""
    head = "F100 G1 X-1\nX0\nBNAT ENAT CSPLINE X1 Y1\nX2 Y0\n"
    first = spans_of(head)
    assert spans_of(f"{head}TRANS\nX3 Y1\nX4 Y0\n")[: len(first)] == first
    assert spans_of(f"{head}X3 Y1\nX4 Y0\n")[: len(first)] != first
