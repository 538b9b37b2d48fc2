"""Tool radius compensation in the plane (6.2)."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import Settings, Tool

CONTROL = Settings(start_mm=(0.0, 0.0, 0.0), tools={1: Tool(2.0), 2: Tool(0.5)})
HEAD = "T1 M6\nG0 X0 Y-10\n"


def run(text: str) -> list[canon.Command]:
    return list(interpret((HEAD + text).encode(), CONTROL))


def moves(text: str) -> list[canon.Motion]:
    found = run(text)
    assert not any(isinstance(command, canon.Alarm) for command in found), found[-1]
    motions = [command for command in found if isinstance(command, canon.Motion)][1:]
    for before, after in pairwise(motions):
        assert math.dist(before.end, after.start) < 1e-9
    return motions


def alarm(text: str) -> str:
    last = run(text)[-1]
    assert isinstance(last, canon.Alarm)
    return last.text


def ends(text: str) -> list[tuple[float, ...]]:
    return [tuple(round(value, 9) + 0.0 for value in move.end) for move in moves(text)]


SQUARE = "G1 G41 X0 Y0 F100\nY20\nX20\nY0\nX0\nG40 X-10 Y-10"


def test_outside_of_a_square_with_round_corners() -> None:
    """(6.2) Clockwise with the tool on the left is outside: corners by arcs of the tool's radius."""
    found = moves(SQUARE)
    assert ends(SQUARE) == [
        (-2, 0, 0), (-2, 20, 0), (0, 22, 0), (20, 22, 0), (22, 20, 0), (22, 0, 0), (20, -2, 0), (0, -2, 0),
        (-10, -10, 0),
    ]  # fmt: skip
    arcs = [move for move in found if isinstance(move, canon.Arc)]
    assert [arc.centre for arc in arcs] == [(0, 20, 0), (20, 20, 0), (20, 0, 0)]
    assert all(arc.sweep_rad == pytest.approx(math.pi / 2) and arc.axis == (0, 0, -1) for arc in arcs)


def test_outside_of_a_square_with_sharp_corners() -> None:
    """(6.2)"""
    assert ends("G451 " + SQUARE) == [
        (-2, 0, 0), (-2, 22, 0), (22, 22, 0), (22, -2, 0), (0, -2, 0), (-10, -10, 0)
    ]  # fmt: skip


def test_inside_of_a_square() -> None:
    """(6.2)"""
    assert ends(SQUARE.replace("G41", "G42")) == [
        (2, 0, 0), (2, 18, 0), (18, 18, 0), (18, 2, 0), (0, 2, 0), (-10, -10, 0)
    ]  # fmt: skip


def test_mirrored_contour_keeps_the_tool_on_its_side() -> None:
    """(6.2)"""
    found = [command for command in run("MIRROR X0\n" + SQUARE) if isinstance(command, canon.Motion)][1:]
    assert [round(move.end[0], 9) + 0.0 for move in found] == [-x + 0.0 for x, _, _ in ends(SQUARE)]


def test_arcs_change_their_radius_and_feed() -> None:
    """(6.2) Outside of a full circle of radius 10: the centre runs on 12; CFC speeds it up, CFTCP does not."""
    text = "{} G1 G41 X0 Y0 F100\nG2 X0 Y0 I10 J0\nG1 G40 X-10 Y0"
    outer = moves(text.format("CFC"))[1]
    assert isinstance(outer, canon.Arc)
    assert (outer.start, outer.feed_mm_min) == (pytest.approx((-2, 0, 0)), pytest.approx(120))
    assert outer.sweep_rad == pytest.approx(2 * math.pi)
    for code, side, feed in (("CFTCP", "G41", 100), ("CFIN", "G41", 100), ("CFIN", "G42", 80), ("CFC", "G42", 80)):
        arc = moves(text.format(code).replace("G41", side))[1]
        assert isinstance(arc, canon.Arc)
        assert arc.feed_mm_min == pytest.approx(feed)


def test_the_feed_correction_of_the_arc_s_own_block_counts() -> None:
    """(6.2) The arc waits for the block after it; a code there does not reach back."""
    found = moves("G1 G42 X10 Y0 F100 CFC\nX20\nG3 X20 Y20 J10\nCFTCP G1 X0\nG40 X0 Y0")
    assert [round(move.feed_mm_min, 9) for move in found if isinstance(move, canon.Arc)] == [120.0]


def test_inner_corner_between_line_and_arc() -> None:
    """(6.2) The crossing lies 2 mm from both contour elements."""
    found = moves("G1 G42 X0 Y0 F100\nY10\nG2 X10 Y0 I0 J-10\nG1 G40 X20 Y-5")
    crossing = found[1].end
    assert crossing[0] == pytest.approx(2.0)
    assert math.hypot(crossing[0], crossing[1]) == pytest.approx(8.0)


def test_moves_square_to_the_plane_keep_the_place_beside_the_contour() -> None:
    """(6.2)"""
    assert ends("G1 G41 X0 Y0 F100\nZ-5\nY20\nZ5\nX20\nG40 X40 Y40") == [
        (-2, 0, 0), (-2, 0, -5), (-2, 20, -5), (-2, 20, 5), (0, 22, 5), (20, 22, 5), (40, 40, 5)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("G2 G41 X5 Y5 CR=9 F100", "straight move"),
        ("G1 G42 X0 Y0 F100\nG2 X0 Y3 CR=1.5\nX0 Y0 CR=1.5", "radius"),
        ("G1 G42 X0 Y0 F100\nY20\nX1\nY0\nX-20", "too narrow"),
        ("G1 G41 X0 Y0 F100\nPOLY PO[X]=(5,1)", "not compensated"),
        ("G1 G41 X0 Y0 F100\nBSPLINE X5", "not compensated"),
        ("G1 G41 X0 Y0 F100\nY5\nT2 M6\nX20", "G40 before"),
        ("G1 G41 X0 Y0 F100\nY5\nG42 X20", "G40 before"),
        ("G1 G41 X0 Y0 F100\nY5\nG40 G2 X9 CR=9", "G0 or G1"),
        ("T9 M6\nG1 G41 X0 Y0 F100", "T9"),
    ],
)
def test_what_cannot_be_compensated(text: str, words: str) -> None:
    """(6.2)"""
    assert words in alarm(text)


def test_without_g40_the_contour_ends_square() -> None:
    """(6.2)"""
    assert ends("G1 G41 X0 Y0 F100\nY20") == [(-2, 0, 0), (-2, 20, 0)]


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=2, max_size=7), st.sampled_from(["G41", "G42"])
)
def test_the_centre_keeps_its_distance_from_the_contour(points: list[tuple[float, float]], side: str) -> None:
    """(6.2) Either an alarm, or no cut ends further from the contour than the tool's radius."""
    body = "\n".join(f"G1 X{x:.3f} Y{y:.3f}" for x, y in points)
    found = run(f"G1 {side} X0 Y0 F100\n{body}\n")
    if isinstance(found[-1], canon.Alarm):
        return
    contour = [(0.0, 0.0), *[(round(x, 3), round(y, 3)) for x, y in points]]
    cuts = [command for command in found if isinstance(command, canon.Line | canon.Arc)][1:]
    for cut in cuts:
        near = min(_distance(cut.end, a, b) for a, b in pairwise(contour))
        assert near < 2.0 + 1e-6


def _distance(point: tuple[float, ...], a: tuple[float, float], b: tuple[float, float]) -> float:
    length = math.dist(a, b)
    if length < 1e-12:
        return math.dist(point[:2], a)
    share = ((point[0] - a[0]) * (b[0] - a[0]) + (point[1] - a[1]) * (b[1] - a[1])) / length**2
    share = max(0.0, min(1.0, share))
    return math.dist(point[:2], (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))
