"""POLY blocks of degree 5: as the interpreter reads them, short, and only for controls known to read them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.path.curve import ExactCurve
from planner.path.model import DrivingPlane, Method, Pass, PlaneSpline, ToolPath
from planner.path.moves import in_order
from planner.path.spline import FittedSpline, fit_heights, fit_passes
from planner.plan import plan_job
from planner.post.written import ControlLimits
from planner.report import segments
from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import Settings
from tests.planner.path.curves import wave_pass
from tests.planner.post.paths import THESIS, spline
from tests.planner.post.test_round_trip import check_round_trip, write

Fit = Callable[[Sequence[ExactCurve], float], Sequence[FittedSpline | None]]
LIMITS = ControlLimits(poly_degree=5)


def heights(seed: int, spans: int = 4, length_mm: float = 120.0) -> PlaneSpline:
    """A spline of degree 5 with triple knots inside, w its parameter, a few mm high, joints at uneven places."""
    random = np.random.default_rng(seed)
    inner = np.sort(length_mm * (np.arange(1, spans) + random.uniform(-0.2, 0.2, spans - 1)) / spans)
    knots = np.concatenate([np.zeros(6), np.repeat(inner, 3), np.full(6, length_mm)])
    places = np.array([knots[i + 1 : i + 6].mean() for i in range(len(knots) - 6)])
    return PlaneSpline(5, knots, np.stack([places, 8.0 + np.cumsum(random.uniform(-2, 2, len(places)))], axis=1))


def path_of(shapes: list[PlaneSpline], angle_rad: float = 0.0, deviation_mm: float = 0.0009) -> ToolPath:
    passes = [
        Pass(DrivingPlane(angle_rad, 1.7418 + 1.5 * number), shape, deviation_mm, Method.PROVED, np.empty((0, 2)), 50.0)
        for number, shape in enumerate(shapes)
    ]
    return ToolPath(in_order(passes, "zigzag"), 4.0, np.full(len(passes) - 1, 1.5), np.zeros(0), Method.PROVED)


def test_passes_of_both_degrees_are_written_as_poly_where_bsplines_are_known_too() -> None:
    """(4.4) Heights of degree 5 are no control points of a BSPLINE: one such pass and all are POLY."""
    limits = ControlLimits(poly_degree=5, knot_rule_verified=True)
    mixed = path_of([spline(1, length_mm=120.0), heights(2)])
    assert b"BSPLINE" not in write(mixed, limits, blocks="auto").data
    assert write(mixed, limits, blocks="auto").data == write(mixed, limits=limits, blocks="poly").data


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 10**6),
    st.integers(1, 5),
    st.sampled_from([0.0, math.pi / 2, math.pi, 0.3, 2.1, -1.2]),
    st.sampled_from([0.0009, 0.0002]),
)
def test_heights_come_back(seed: int, spans: int, angle_rad: float, deviation_mm: float) -> None:
    """(4.3, 6.9) There and back along any vertical plane, within what rounding is said to add."""
    path = path_of([heights(seed, spans), heights(seed + 1, spans)], angle_rad, deviation_mm)
    check_round_trip(path, write(path, LIMITS, blocks="poly"))


def test_inch_programs_come_back_in_mm() -> None:
    """(6.8)"""
    path = path_of([heights(1), heights(2)])
    check_round_trip(path, write(path, ControlLimits(poly_degree=5, is_inch=True), blocks="poly"))


def test_joints_take_few_digits() -> None:
    """(4.4) A joint slides to a place with few decimals; only the ends of the pass are exact."""
    path = wave_path(fit_heights)
    places = re.findall(r"^(?:POLY )?X([\d.]+)PO", write(path, LIMITS, blocks="poly").data.decode(), re.MULTILINE)
    assert len(places) == segments(path.passes[0].shape) >= 5
    assert all(len(place) <= len("100.1") for place in places[:-1])


def test_a_wave_is_shorter_as_poly_than_as_bspline() -> None:
    """(4.4) On a 300 mm pass over the wave at 1 um POLY is at most 1.6 times BSPLINE; in fact it is the shorter."""
    poly = write(wave_path(fit_heights), LIMITS, blocks="poly").cutting_bytes
    bspline = write(wave_path(fit_passes), LIMITS, blocks="bspline").cutting_bytes
    assert poly < bspline


def wave_path(fit: Fit) -> ToolPath:
    """One pass over the wave, fitted for 1 um as written."""
    (fitted,) = fit([wave_pass()], 0.0009)
    assert fitted is not None
    return path_of([fitted.spline], deviation_mm=fitted.deviation_mm)


def test_only_controls_known_to_read_degree_five_get_it() -> None:
    """(4.4) `blocks = "auto"` takes the smallest that the control is known to read, and BSPLINE gets cubics."""
    old, new, verified = (
        plan_job(THESIS, limits)
        for limits in (ControlLimits(), LIMITS, ControlLimits(poly_degree=5, knot_rule_verified=True))
    )
    assert highest_degree(old.program) == 3
    assert highest_degree(new.program) == 5
    assert len(verified.program) <= len(new.program) < len(old.program)
    assert b"BSPLINE" in plan_job(THESIS, LIMITS, post={"blocks": "bspline"}).program
    with pytest.raises(AssertionError):
        check_round_trip(new.tool_path, write(new.tool_path, LIMITS), Settings(poly_degree=3))


def highest_degree(program: bytes) -> int:
    """Of the polynomials the interpreter reads."""
    commands = interpret(program)
    return max(len(one.coefficients) - 1 for one in commands if isinstance(one, canon.Polynomial))


def test_heights_cannot_be_written_as_bspline() -> None:
    """(4.7) A caller's fault, said as one."""
    with pytest.raises(ValueError, match="cubics"):
        write(path_of([heights(1)]), LIMITS, blocks="bspline")
