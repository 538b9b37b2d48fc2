"""The air program that tells the knot rules apart."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from planner.post.knot_test import joints, knot_test_program, probe_curve
from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import KnotRule, Settings

PROGRAM = knot_test_program(50.0)


def part(name: str) -> bytes:
    """The head and one of the two parts."""
    head, nx, genua = re.split(r'MSG\("RULE [A-Z]+"\)\n', PROGRAM.decode())
    body = {"nx": nx, "genua": genua}[name]
    return (head + body.replace("M30\n", "") + "M30\n").encode()


def stops(name: str, rule: KnotRule) -> list[canon.Vector] | None:
    """Ends of the spline spans as a control of this rule runs the part, None where it raises an alarm."""
    commands = list(interpret(part(name), Settings(knot_rule=rule)))
    if any(isinstance(one, canon.Alarm) for one in commands):
        return None
    return [one.end for one in commands if isinstance(one, canon.Polynomial)]


@pytest.mark.parametrize("rule", [KnotRule.NX, KnotRule.GENUA])
def test_the_right_part_stops_where_the_table_says(rule: KnotRule) -> None:
    """(2.3)"""
    table = [(float(x), float(y)) for x, y in re.findall(r"; X(-?[0-9.]+) Y(-?[0-9.]+)", PROGRAM.decode())]
    found = stops(rule.value, rule)
    assert found is not None
    assert np.allclose([end[:2] for end in found], table, atol=1e-4)
    assert np.allclose(table, joints(probe_curve()), atol=1e-4)


@pytest.mark.parametrize(("name", "rule"), [("nx", KnotRule.GENUA), ("genua", KnotRule.NX)])
def test_the_wrong_part_stops_millimetres_elsewhere(name: str, rule: KnotRule) -> None:
    """A wrong rule cannot be taken for the right one (2.3)."""
    found = stops(name, rule)
    right = [tuple(point) for point in joints(probe_curve()).tolist()]
    if found is not None:
        inner = [end[:2] for end in found if math.dist(end[:2], right[-1]) > 1e-6]
        assert max(min(math.dist(end, point) for end in inner) for point in right[:-1]) > 1.0


def test_nothing_moves_below_the_safe_height_and_nothing_turns() -> None:
    """(2.3)"""
    for command in interpret(part("nx"), Settings()):
        assert not isinstance(command, canon.ChangeTool)
        if isinstance(command, canon.Rapid | canon.Line | canon.Polynomial):
            assert command.end[2] == 50.0
        if isinstance(command, canon.Spindle):
            assert command.speed_rpm == 0.0
