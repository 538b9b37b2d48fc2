"""BSPLINE blocks: knot rule, least number of blocks, inserted knots."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from planner.path.model import PlaneSpline
from planner.post.base import write_program
from planner.post.bspline import with_blocks
from planner.post.written import ControlLimits
from tests.planner.post.paths import job, spline, tool_path

TEST_CURVE = PlaneSpline(
    3,
    np.array([0, 0, 0, 0, 20, 35, 60, 60, 60, 60], dtype=float),
    np.array([[0, 0], [10, 2], [20, -4], [32, -6], [45, 1], [60, 0]], dtype=float),
)


def cutting_lines(shape: PlaneSpline, limits: ControlLimits, blocks: str = "bspline") -> list[str]:
    made = job(blocks=blocks, reference="centre")
    text = write_program(made, made.operation[0], tool_path([shape]), limits).data.decode()
    return [line for line in text.splitlines() if "PL=" in line or "PO[" in line]


def test_knot_rule_nx_on_the_worked_example() -> None:
    """PL in every block, first and last 0, only ratios kept (2.3)."""
    lines = cutting_lines(TEST_CURVE, ControlLimits(min_spline_blocks=0))
    points = [re.sub("PL=.*", "", line) for line in lines]
    assert points == ["BSPLINE X10Z2", "X20Z-4", "X32Z-6", "X45Z1", "X60Z0"]
    intervals = [float(re.search(r"PL=([0-9.]+)", line)[1]) for line in lines]
    assert intervals[0] == intervals[-1] == 0
    assert np.allclose(np.array(intervals[1:-1]) / intervals[1], [1, 0.75, 1.25], rtol=1e-3)


def test_knot_rule_genua_writes_the_first_point_too() -> None:
    lines = cutting_lines(TEST_CURVE, ControlLimits(min_spline_blocks=0, knot_rule="genua"))
    assert lines[0].removesuffix("F250") == "BSPLINE X0Z0PL=0"
    intervals = [float(re.search(r"PL=([0-9.]+)", line)[1]) for line in lines]
    assert len(lines) == 6
    assert intervals[-2:] == [0, 0]


def test_too_few_blocks_are_filled_by_inserted_knots() -> None:
    """min_spline_blocks kept (6.8)."""
    assert len(cutting_lines(spline(1), ControlLimits(min_spline_blocks=0))) == 4
    assert len(cutting_lines(spline(1), ControlLimits(min_spline_blocks=6))) == 6


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 4), st.integers(4, 20))
def test_insertion_keeps_the_curve(seed: int, inner: int, least: int) -> None:
    """(6.8)"""
    before = spline(seed, inner=inner)
    after = with_blocks(before, least)
    t = np.linspace(0.0, before.knots[-1], 201)
    assert len(after.control_points) >= least
    assert np.allclose(
        BSpline(after.knots, after.control_points, 3)(t), BSpline(before.knots, before.control_points, 3)(t), atol=1e-12
    )


def test_auto_writes_bspline_only_at_a_control_that_was_seen_to_read_it() -> None:
    """(4.4, 6.8): POLY is documented, the knot rule has to be verified first; then the smaller one wins."""
    long = spline(4, inner=12, length_mm=200.0)
    unknown = cutting_lines(long, ControlLimits(), "auto")
    known = cutting_lines(long, ControlLimits(knot_rule_verified=True), "auto")
    assert unknown[0].startswith("POLY")
    assert known[0].startswith("BSPLINE")
    assert len("".join(known)) < len("".join(unknown))
    short = cutting_lines(spline(4, inner=0), ControlLimits(knot_rule_verified=True), "auto")
    assert short[0].startswith("POLY")


def test_other_degrees_are_a_fault_of_the_caller() -> None:
    quadratic = PlaneSpline(2, np.array([0, 0, 0, 1, 1, 1.0]), np.array([[0, 0], [5, 1], [10, 0.0]]))
    with pytest.raises(ValueError, match="cubics"):
        cutting_lines(quadratic, ControlLimits())
