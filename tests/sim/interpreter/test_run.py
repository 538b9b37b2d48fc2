"""The interpreter on programs such as ours and the thesis's (2.4, 6.2)."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest

from sim.interpreter import canon
from sim.interpreter.run import Interpreter, interpret
from sim.interpreter.settings import G28, Settings

GOLDEN = Path(__file__).parents[2] / "golden"
AT_ORIGIN = Settings(start_mm=(0.0, 0.0, 0.0))


def commands(text: str, settings: Settings = AT_ORIGIN) -> list[canon.Command]:
    return list(interpret(text.encode("latin-1"), settings))


def moves(text: str, settings: Settings = AT_ORIGIN) -> list[canon.Motion]:
    found = commands(text, settings)
    alarms = [command for command in found if isinstance(command, canon.Alarm)]
    assert not alarms, alarms
    return [command for command in found if isinstance(command, canon.Motion)]


def alarm(text: str, settings: Settings = AT_ORIGIN) -> canon.Alarm:
    found = commands(text, settings)[-1]
    assert isinstance(found, canon.Alarm), found
    return found


def test_thesis_program_is_read_completely() -> None:
    """(2.4)"""
    found = list(interpret((GOLDEN / "thesis-5000.mpf").read_bytes()))
    assert Counter(type(command).__name__ for command in found) == {
        "Line": 367, "Rapid": 4, "SetJerkLimit": 1, "SelectTool": 1, "ChangeTool": 1, "Stop": 1, "Spindle": 1,
        "Message": 1, "Coolant": 1, "SetPathMode": 1, "End": 1,
    }  # fmt: skip
    lines = [command for command in found if isinstance(command, canon.Line)]
    assert {line.feed_mm_min for line in lines} == {250.0}
    length = sum(math.dist(line.start, line.end) for line in lines)
    assert length == pytest.approx(1254 + 433, abs=1.0)
    assert found[-1] == canon.End(397, 397)


def test_g28_is_refused_or_ignored_when_the_settings_say_so() -> None:
    """(2.4)"""
    data = (GOLDEN / "thesis-5000.mpf").read_bytes()
    refused = list(interpret(data, Settings(g28=G28.ALARM)))[-1]
    assert isinstance(refused, canon.Alarm)
    assert (refused.number, refused.line, refused.block) == (12470, 396, 396)
    ignored = list(interpret(data, Settings(g28=G28.IGNORE)))
    assert sum(isinstance(command, canon.Rapid) for command in ignored) == 3


def test_lines_carry_start_end_and_feed() -> None:
    """(6.2)"""
    first, second = moves("N10 G1 X10 F250\nY5 F100")
    assert first == canon.Line(1, 10, (0.0, 0.0, 0.0), (10.0, 0.0, 0.0), 250.0)
    assert second == canon.Line(2, None, (10.0, 0.0, 0.0), (10.0, 5.0, 0.0), 100.0)


def test_a_block_that_moves_nowhere_gives_no_motion() -> None:
    """(6.2)"""
    assert moves("G1 F100\nG1 X0 Y0\nG0 Z0") == []


def test_modes_tool_spindle_coolant_message_and_ends() -> None:
    """(6.2)"""
    text = 'SOFT G642\nT2 D1\nM6\nS1000 M3\nM8\nMSG("rough")\nG4 F1.5\nG9 G1 X1 F50 M5\nM9\nM1\nM0\nM30\nG0 X9'
    found = commands(text)
    assert found == [
        canon.SetJerkLimit(1, None, True),
        canon.SetPathMode(1, None, canon.PathMode.ROUNDING_TOLERANCE, None),
        canon.SelectTool(2, None, 2),
        canon.SelectEdge(2, None, 1),
        canon.ChangeTool(3, None, 2),
        canon.Spindle(4, None, 1000.0),
        canon.Coolant(5, None, True, False),
        canon.Message(6, None, "rough"),
        canon.Dwell(7, None, 1.5),
        canon.ExactStopOnce(8, None),
        canon.Line(8, None, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 50.0),
        canon.Spindle(8, None, 0.0),
        canon.Coolant(9, None, False, False),
        canon.Stop(10, None, True),
        canon.Stop(11, None, False),
        canon.End(12, None),
    ]


def test_suppressed_offsets_give_positions_in_the_same_frame() -> None:
    """(6.2)"""
    settings = Settings(start_mm=(0.0, 0.0, 0.0), work_offsets_mm={"G54": (100.0, 50.0, -200.0)})
    last = moves("G54\nG0 Z10\nG0 SUPA Z0\nG0 X1", settings)
    assert [move.end for move in last] == [(0.0, 0.0, 10.0), (0.0, 0.0, 200.0), (1.0, 0.0, 200.0)]


def test_poly_blocks_pass_through_the_documented_spans() -> None:
    """(6.3) The worked example whose spans are those of a clamped cubic."""
    text = """G1 X0 Y12.5 Z0 F250
    POLY PO[X]=(20.448980,-12.857143,3.306122) PO[Z]=(-3.278912,-16.285714,7.006803)
    PO[X]=(30.703125,-1.653061,1.254145) PO[Z]=(-4.494792,2.663265,0.284120)
    PO[X]=(60,5.859375,4.921875) PO[Z]=(0,9.765625,-8.630208)"""
    spans = [move for move in moves(text) if isinstance(move, canon.Polynomial)]
    assert [span.end[0] for span in spans] == [20.448980, 30.703125, 60.0]
    assert spans[0].coefficients[1] == pytest.approx((30.0, 0.0, 6.0), abs=2e-6)
    for before, after in pairwise(spans):
        slope = [sum(k * c[axis] for k, c in enumerate(before.coefficients)) for axis in range(3)]
        assert after.coefficients[0] == before.end
        # the spans are C1 in their common knot parameter; lengths 20, 15, 25
        assert slope[2] / slope[0] == pytest.approx(after.coefficients[1][2] / after.coefficients[1][0], abs=1e-5)


def test_denominator_gives_the_quarter_circle_of_the_manual() -> None:
    """(6.3)"""
    arc = moves("G1 X10 F100\nPOLY PO[X]=(0,-10) PO[Y]=(10) PO[]=(2,1)")[1]
    assert isinstance(arc, canon.Polynomial)
    assert arc.denominator == (1.0, 0.0, 1.0)
    for p in (0.0, 0.25, 0.5, 1.0):
        weight = sum(d * p**k for k, d in enumerate(arc.denominator))
        x, y = (sum(c[axis] * p**k for k, c in enumerate(arc.coefficients)) / weight for axis in (0, 1))
        assert math.hypot(x, y) == pytest.approx(10.0, abs=1e-12)


def test_nothing_follows_an_alarm() -> None:
    """(6.5)"""
    interpreter = Interpreter(AT_ORIGIN)
    assert interpreter.block(b"G1 X1", 1)[-1] == canon.Alarm(
        1, None, 10860, "a feed move without feed; F is expected in this block or before", 1
    )
    assert interpreter.block(b"G0 X1", 2) == []
    assert interpreter.finish() == []


def test_state_is_a_snapshot() -> None:
    """(6.8)"""
    interpreter = Interpreter(AT_ORIGIN)
    interpreter.block(b"G1 G642 X1 F250 S1000 M3 T2", 1)
    before = interpreter.state
    interpreter.block(b"G0 X5 M5", 2)
    assert (before.motion, before.feed, before.position_mm, before.spindle_direction) == (
        "G1",
        250.0,
        (1.0, 0.0, 0.0),
        1,
    )
    assert interpreter.state.motion == "G0"
