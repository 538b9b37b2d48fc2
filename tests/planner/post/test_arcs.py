"""Arcs in few digits: every CIP block names a circle and goes round it the short way."""

from __future__ import annotations

import re

import numpy as np
import pytest

from planner.path.model import ArcChain, DrivingPlane
from planner.post.arcs import _as_lines, _Chain
from planner.post.base import write_program
from planner.post.written import ControlLimits
from tests.planner.post.paths import arcs, distance_mm, job, tool_path

DROP_MM = 4.0  # from the ball's centre to the tip


def exact_points(shape: ArcChain) -> np.ndarray:
    """Points (m, 2) along the chain."""
    parts = []
    for start, end, centre, turn in zip(shape.points[:-1], shape.points[1:], shape.centres, shape.turns, strict=True):
        share = np.linspace(0, 1, 101)[:, None]
        chord = start + share * (end - start)
        arm = chord - centre
        radius = np.hypot(*(start - centre))
        parts.append(chord if turn == 0 else centre + arm * radius / np.hypot(*arm.T)[:, None])
    return np.concatenate(parts)


def links(program: str) -> list[tuple[np.ndarray, np.ndarray | None, np.ndarray]]:
    """Start, point between (None for a line) and end, (2,) of X and Z, of every cutting block."""
    found, at, code, is_cutting = [], np.zeros(2), "G0", False
    for line in program.splitlines():
        if match := re.match(r"(?:N\d+ ?)?(G0(?!\d)|G1(?!\d)|CIP)", line):
            code = match[1]
        words = {name: float(value) for name, value in re.findall(r"(X|Z|I1=|K1=)(-?[\d.]+)", line)}
        end = np.array([words.get("X", at[0]), words.get("Z", at[1])])
        if is_cutting and code != "G0":
            between = np.array([words["I1="], words["K1="]]) if code == "CIP" else None
            found.append((at, between, end))
        is_cutting = code != "G0"
        at = end
    return found


@pytest.mark.parametrize("length_mm", [0.6, 1.0, 3.0, 12.0])
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("decimals", [1, 2])
def test_the_point_between_lies_between_and_aside(length_mm: float, seed: int, decimals: int) -> None:
    """(4.3, 4.4) It lay in line with the ends, on one of them, or beyond, which is an alarm or the long way round."""
    shape = arcs(seed, 6, length_mm)
    path = tool_path([shape], deviation_mm=0.0)
    made = job(blocks="arcs", numbers="none")
    written = write_program(made, made.operation[0], path, ControlLimits(decimals=decimals))
    points = []
    for start, between, end in links(written.data.decode()):
        chord = end - start
        points += [start, end]
        if between is not None:
            share = (between - start) @ chord / (chord @ chord)
            arm = between - start
            aside = (chord[0] * arm[1] - chord[1] * arm[0]) / np.hypot(*chord)
            assert 0 < share < 1
            assert abs(aside) > 1e-9
        else:
            assert np.hypot(*chord) > 0
            points += list(start + np.linspace(0, 1, 21)[:, None] * chord)
    near = np.array(points) + np.array([0.0, DROP_MM])
    assert distance_mm(near, exact_points(shape)) <= written.rounding_mm + 1e-6


@pytest.mark.parametrize("angle_rad", [0.0, 0.7])
@pytest.mark.parametrize("decimals", [1, 2, 3])
def test_no_arc_has_more_decimals_than_the_control_reads(angle_rad: float, decimals: int) -> None:
    """(4.4) Not in the points between either, nor in the X and Y of an oblique plane, which would like one more."""
    path = tool_path([arcs(seed, 6) for seed in range(4)], angle_rad=angle_rad, deviation_mm=0.0)
    made = job(blocks="arcs", numbers="none")
    text = write_program(made, made.operation[0], path, ControlLimits(decimals=decimals)).data.decode()
    cutting = [line for line in text.splitlines() if "I1=" in line]
    assert len(cutting) > 8
    assert max(map(len, re.findall(r"\.(\d+)", "\n".join(cutting)))) == decimals


@pytest.mark.parametrize(
    ("between", "is_line"),
    [
        ((5.0, 0.0, 1.0), False),
        ((0.1, 0.0, 0.1), False),
        ((5.0, 0.0, 0.0), True),
        ((0.0, 0.0, 0.0), True),
        ((10.0, 0.0, 0.0), True),
        ((-0.1, 0.0, 0.5), True),
        ((10.1, 0.0, 0.5), True),
    ],
)
def test_a_point_between_in_line_at_an_end_or_beyond_makes_a_line(
    between: tuple[float, float, float], is_line: bool
) -> None:
    """(4.4) Rounded so far, a control would alarm at it or go the other way round."""
    shape = ArcChain(np.array([[0.0, 0.0], [10.0, 0.0]]), np.array([[5.0, -12.0]]), np.array([-1]))
    ends, middle = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]]), np.array([between])
    chain = _Chain(DrivingPlane(0.0, 0.0), shape, ends, middle, 0.0)
    assert _as_lines(chain, ends, middle).tolist() == [is_line]
