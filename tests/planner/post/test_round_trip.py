"""What the interpreter makes of a program lies on the passes: post and interpreter share syntax, never meaning."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from planner.path.model import ArcChain, Pass, PlaneSpline, ToolPath
from planner.plan import plan_job
from planner.post.base import write_program
from planner.post.written import ControlLimits, Written
from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import KnotRule, Settings
from tests.planner.post.paths import THESIS, arcs, distance_mm, job, polyline, spline, tool_path

LIMITS = ControlLimits(retract_z_mm=400.0)
DENSE = 16_001


def write(path: ToolPath, limits: ControlLimits = LIMITS, **post: str) -> Written:
    made = job(**post)
    return write_program(made, made.operation[0], path, limits)


def cut_curves(data: bytes, settings_: Settings | None = None) -> list[list[canon.Motion]]:
    """The cutting motions pass by pass, plunges left out."""
    passes: list[list[canon.Motion]] = []
    for command in interpret(data, settings_ or Settings()):
        assert not isinstance(command, canon.Alarm), command
        if isinstance(command, canon.Rapid):
            passes.append([])
        elif isinstance(command, (canon.Line, canon.Polynomial, canon.Arc)):
            passes[-1].append(command)
    return [one[1:] for one in passes if one]


def points_of(motion: canon.Motion, count: int) -> np.ndarray:
    share = np.linspace(0.0, 1.0, count)[:, None]
    start, end = np.array(motion.start), np.array(motion.end)
    if isinstance(motion, canon.Polynomial):
        p = share * motion.length
        return sum(np.array(vector) * p**power for power, vector in enumerate(motion.coefficients))
    if isinstance(motion, canon.Arc):
        centre, axis = np.array(motion.centre), np.array(motion.axis)
        arm = start - centre
        angle = share * motion.sweep_rad
        return centre + arm * np.cos(angle) + np.cross(axis, arm) * np.sin(angle)
    return start + share * (end - start)


def _arc_points(shape: ArcChain, number: int) -> np.ndarray:
    start, end, centre = shape.points[number], shape.points[number + 1], shape.centres[number]
    share = np.linspace(0.0, 1.0, 2001)[:, None]
    if shape.turns[number] == 0:
        return start + share * (end - start)
    first, last = (math.atan2(*(point - centre)[::-1]) for point in (start, end))
    sweep = (shape.turns[number] * (last - first)) % (2 * math.pi) * shape.turns[number]
    radius = np.linalg.norm(start - centre)
    angle = first + share * sweep
    return centre + radius * np.concatenate([np.cos(angle), np.sin(angle)], axis=1)


def exact_points(one: Pass, radius_mm: float) -> np.ndarray:
    shape = one.shape
    if isinstance(shape, PlaneSpline):
        t = np.linspace(shape.knots[0], shape.knots[-1], DENSE)
        plane = BSpline(shape.knots, shape.control_points, shape.degree)(t)
    elif isinstance(shape, ArcChain):
        plane = np.concatenate([_arc_points(shape, number) for number in range(len(shape.turns))])
    else:
        legs = np.linspace(0.0, 1.0, 201)[:, None]
        plane = np.concatenate([a + legs * (b - a) for a, b in zip(shape.points, shape.points[1:], strict=False)])
    return one.plane.to_work(plane) - [0.0, 0.0, radius_mm]


def check_round_trip(path: ToolPath, written: Written, settings_: Settings | None = None) -> None:
    curves = cut_curves(written.data, settings_)
    assert len(curves) == len(path.passes)
    for one, motions in zip(path.passes, curves, strict=True):
        read = np.concatenate([points_of(motion, DENSE // len(motions)) for motion in motions])
        exact = exact_points(one, path.radius_mm)
        assert distance_mm(read, exact) <= written.rounding_mm + 4e-6
        assert distance_mm(exact, read) <= written.rounding_mm + 4e-6
        assert written.rounding_mm + one.deviation_mm <= 0.001 + 1e-12


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 10**6),
    st.integers(0, 5),
    st.sampled_from(["poly", "bspline"]),
    st.sampled_from([0.0, math.pi / 2, math.pi, 0.3, 2.1, -1.2]),
)
def test_splines_come_back(seed: int, inner: int, blocks: str, angle_rad: float) -> None:
    """POLY and BSPLINE as the interpreter reads them, in any vertical plane (6.9, 2.3)."""
    path = tool_path([spline(seed, inner=inner), spline(seed + 1, inner=inner)], angle_rad=angle_rad)
    check_round_trip(path, write(path, blocks=blocks))


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.0, math.pi / 2, 0.7]))
def test_lines_come_back(seed: int, angle_rad: float) -> None:
    """(6.9)"""
    path = tool_path([polyline(seed), polyline(seed + 1)], angle_rad=angle_rad)
    check_round_trip(path, write(path, blocks="linear"))


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 9), st.sampled_from([0.0, math.pi / 2, math.pi, 0.7, -2.0]))
def test_arcs_come_back(seed: int, count: int, angle_rad: float) -> None:
    """Arcs in any vertical plane, the plane of the tool length untouched (6.9, 4.4)."""
    path = tool_path([arcs(seed, count), arcs(seed + 1, count)], angle_rad=angle_rad)
    written = write(path, blocks="arcs")
    assert b"G18" not in written.data
    assert b"G19" not in written.data
    check_round_trip(path, written)


@pytest.mark.parametrize("blocks", ["poly", "bspline", "linear", "arcs"])
def test_inch_programs_come_back_in_mm(blocks: str) -> None:
    """An inch machine reads the same path, feeds and heights (6.8)."""
    shapes = {"linear": [polyline(1), polyline(2)], "arcs": [arcs(1), arcs(2)]}
    path = tool_path(shapes.get(blocks, [spline(1), spline(2)]))
    inch = ControlLimits(retract_z_mm=400.0, is_inch=True)
    written = write(path, inch, blocks=blocks)
    check_round_trip(path, written)
    commands = list(interpret(written.data))
    feeds = {round(one.feed_mm_min, 1) for one in commands if isinstance(one, (canon.Line, canon.Polynomial))}
    assert feeds == {100.0, 250.0} or blocks == "arcs"
    heights = {round(one.end[2], 1) for one in commands if isinstance(one, canon.Rapid)}
    assert heights == {400.0, 50.0, 10.0}
    first = written.sidecar["restart_points"][0]["position_mm"]
    assert first == pytest.approx(exact_points(path.passes[0], 4.0)[0], abs=1e-4)


def test_the_other_knot_rule_comes_back_at_a_control_of_that_rule() -> None:
    """(2.3)"""
    path = tool_path([spline(1, inner=3)])
    written = write(path, ControlLimits(knot_rule="genua"), blocks="bspline")
    check_round_trip(path, written, Settings(knot_rule=KnotRule.GENUA))
    with pytest.raises(AssertionError):
        check_round_trip(path, written, Settings(knot_rule=KnotRule.NX))


def test_bspline_and_poly_trace_the_same_points() -> None:
    """Within 1e-6 mm before rounding: at many digits both are the same curve (2.3)."""
    path = tool_path([spline(8, inner=4)], deviation_mm=0.0)
    made = job()
    operation = made.operation[0].__class__(**{**_fields(made.operation[0]), "path_mm": 1e-7})
    read = []
    for blocks in ("poly", "bspline"):
        written = write_program(job(blocks=blocks), operation, path, LIMITS)
        (motions,) = cut_curves(written.data)
        assert len(motions) == 5
        read.append(np.concatenate([points_of(motion, 50) for motion in motions]))
    assert np.abs(read[0] - read[1]).max() < 1e-6


def _fields(value: object) -> dict[str, object]:
    return {name: getattr(value, name) for name in value.__struct_fields__}  # type: ignore[attr-defined]


def test_a_block_lowered_by_two_microns_is_seen() -> None:
    """The comparison can fail (6.9)."""
    path = tool_path([spline(3)])
    written = write(path, blocks="poly")
    text = written.data.decode()
    place = text.index("PO[Z]=(") + len("PO[Z]=(")
    stop = text.index(",", place)
    lowered = f"{float(text[place:stop]) - 0.002:.4f}"
    spoiled = Written((text[:place] + lowered + text[stop:]).encode(), 0, 0, 0, written.rounding_mm, written.sidecar)
    with pytest.raises(AssertionError):
        check_round_trip(path, spoiled)


def test_lifted_program_runs_above() -> None:
    """(6.8)"""
    path = tool_path([spline(3)])
    made = job(blocks="poly")
    low = write_program(made, made.operation[0], path, LIMITS)
    high = write_program(made, made.operation[0], path, LIMITS, lift_mm=20.0)
    for a, b in zip(cut_curves(low.data)[0], cut_curves(high.data)[0], strict=True):
        assert b.end == pytest.approx((a.end[0], a.end[1], a.end[2] + 20.0))


def test_the_three_programs_of_the_thesis_job_trace_the_same_curves() -> None:
    """POLY, BSPLINE and G1 of one job, each within 1 um of the exact path, so within 2 um of each other (2.3)."""
    read = []
    for blocks in ("poly", "bspline", "linear"):
        planned = plan_job(THESIS, LIMITS, post={"blocks": blocks})
        read.append(
            [np.concatenate([points_of(motion, 401) for motion in motions]) for motions in cut_curves(planned.program)]
        )
    poly, bspline, linear = read
    assert len(poly) == len(bspline) == len(linear) == 32
    for one, two, three in zip(poly, bspline, linear, strict=True):
        assert distance_mm(one, two) <= 0.002
        assert distance_mm(one, three) <= 0.002
        assert distance_mm(three, one) <= 0.002


@pytest.mark.parametrize("blocks", ["poly", "bspline"])
def test_every_pass_ends_in_an_exact_stop(blocks: str) -> None:
    """The last curve before the retract is the one that G9 stops, so that its corner is not rounded (4.1, 6.8)."""
    path = tool_path([spline(1, inner=4), spline(2, inner=4)])
    commands = list(interpret(write(path, blocks=blocks).data, Settings()))
    retracts = [
        number
        for number, (before, now) in enumerate(itertools.pairwise(commands), 1)
        if isinstance(now, canon.Rapid) and isinstance(before, canon.Polynomial)
    ]
    assert len(retracts) == 2
    assert all(isinstance(commands[number - 2], canon.ExactStopOnce) for number in retracts)
