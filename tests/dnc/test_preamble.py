"""The preamble of a restart: what it restores, and in which order."""

from __future__ import annotations

import dataclasses
import re

import pytest

from dnc.errors import InputRejected
from dnc.preamble import Heights
from dnc.restart import restart_at_line, restart_at_number
from sim.interpreter import canon
from sim.interpreter.run import Interpreter, interpret
from sim.interpreter.settings import Settings
from tests.dnc.restarts import HEAD, HEIGHTS, bare, cutting, program, run_from


def test_order_is_z_tool_spindle_xy_coolant_plunge() -> None:
    """Z before anything, X and Y only with tool, edge, offset and spindle restored (6.8)."""
    data = program()
    line = next(index for index, text in enumerate(data.decode().splitlines(), 1) if text.startswith("N2")) + 3
    commands, before = run_from(data, restart_at_line(data, line, HEIGHTS))
    kinds = [type(one).__name__ for one in commands[:before] if not isinstance(one, canon.SetPathMode)]
    order = ["Rapid", "ChangeTool", "SelectEdge", "Rapid", "Spindle", "Dwell", "Rapid", "Coolant", "Rapid", "Line"]
    wanted = iter(kinds)
    assert all(any(kind == found for found in wanted) for kind in order), kinds
    moves = [one for one in commands[:before] if isinstance(one, (canon.Rapid, canon.Line))]
    assert moves[0].start[:2] == moves[0].end[:2]
    for move in moves:
        assert move.start[2] == move.end[2] or move.start[:2] == move.end[:2]


def test_the_spindle_is_waited_for_only_if_there_is_a_time_to_wait() -> None:
    """(6.8) G4 F0 is a block that a control may refuse."""
    data, line = program(), HEAD.count("\n") + 3
    waits = [
        [block for block in restart_at_line(data, line, heights).preamble if block.startswith("G4")]
        for heights in (HEIGHTS, dataclasses.replace(HEIGHTS, dwell_s=0.0))
    ]
    assert waits == [["G4 F2"], []]


def test_modes_frame_and_offset_are_those_before_the_block() -> None:
    """Everything modal is as it was, the path mode included (6.8)."""
    data = (HEAD + "G1 Z1 F100\nG642 CTOL=.02 SOFT\nX10 F250\nX20\nG0 Z50\nM30\n").encode()
    line = len(HEAD.splitlines()) + 4
    point = restart_at_line(data, line, HEIGHTS)
    interpreter = Interpreter()
    for text in point.preamble:
        assert not [one for one in interpreter.block(text.encode(), 1) if isinstance(one, canon.Alarm)], text
    original = Interpreter()
    for number, raw in enumerate(data.splitlines()[: line - 1], 1):
        original.block(raw, number)
    now, then = interpreter.state, original.state
    for field in dataclasses.fields(then):
        if field.name in ("tangent", "last_motion", "message", "is_ended", "position_mm", "frame"):
            continue
        assert getattr(now, field.name) == getattr(then, field.name), field.name
    assert now.position_mm == pytest.approx(then.position_mm)
    assert now.frame.shift == then.frame.shift


def test_without_a_changer_the_operator_is_told_the_tool() -> None:
    """(6.8) T and M0 with a message, in the preamble too."""
    point = restart_at_number(program(), 2, HEIGHTS, Settings(has_tool_changer=False))
    at = point.preamble.index("T2")
    assert point.preamble[at - 1 : at + 3] == ('MSG("TOOL 2")', "T2", "M0", "MSG()")


def test_r_parameters_are_restored() -> None:
    """(6.8) What the program has computed before stands in the preamble."""
    data = (HEAD + "R1=2.5 R7=-4\nG1 Z1 F100\nX10 F250\nX=R1*8\nG0 Z50\nM30\n").encode()
    point = restart_at_line(data, len(HEAD.splitlines()) + 4, HEIGHTS)
    assert point.preamble[:2] == ("R1=2.5", "R7=-4")
    commands, before = run_from(data, point)
    assert cutting(commands[before:])[0].end[0] == 20.0 + 1.0


def test_r_parameters_are_restored_however_small_or_large() -> None:
    """(6.8) The coefficient of a square, lost at the sixth decimal, would be a quarter of a millimetre in Z."""
    data = (HEAD + "R1=2.5EX-7 R2=-1/3 R3=2.5EX9\nG1 Z1 F100\nX10 F250\nX20 Z=R1*1EX6+R2*3+R3/1EX9\nM30\n").encode()
    commands, before = run_from(data, restart_at_line(data, len(HEAD.splitlines()) + 4, HEIGHTS))
    assert cutting(commands[before:])[0].end[2] == pytest.approx(3.0 + 0.25 - 1.0 + 2.5, abs=1e-9)


def test_an_offset_that_is_not_the_reference_is_respected() -> None:
    """Position words count in the offset and frame that are active at the block (6.8)."""
    settings = Settings(work_offsets_mm={"G54": (100.0, 0.0, 0.0), "G55": (0.0, 50.0, 7.0)}, start_mm=(0, 0, 300))
    data = (HEAD + "G1 Z1 F100\nX10 F250\nX20\nG0 Z50\nM30\n").encode()
    point = restart_at_line(data, len(HEAD.splitlines()) + 3, HEIGHTS, settings)
    commands, before = run_from(data, point, settings)
    rest, whole = cutting(commands[before:]), cutting(list(interpret(data, settings)))
    assert [bare(one) for one in rest] == [bare(one) for one in whole[-1:]]


def test_resumed_interpreter_goes_on_like_the_first() -> None:
    """A fresh interpreter set to a state gives the same commands as one that came there (6.10)."""
    head, tail = HEAD + "G1 Z1 F100\nG2 X10 CR=8 F250\n", "X20 CR=9\nG1 Z2\nG0 Z50\n"
    first = Interpreter()
    for number, text in enumerate(head.splitlines(), 1):
        first.block(text.encode(), number)
    second = Interpreter()
    second.go_on_from(first)
    for number, text in enumerate(tail.splitlines(), 1):
        assert second.block(text.encode(), number) == first.block(text.encode(), number)
    assert first.state == second.state


def preamble_at(head: str, text: str, settings: Settings | None = None, heights: Heights = HEIGHTS) -> tuple[str, ...]:
    """The preamble at the first block of `text` behind `head`."""
    return restart_at_line((head + text).encode(), head.count("\n") + 1, heights, settings).preamble


@pytest.mark.parametrize(
    ("block", "restored"),
    [
        ("T5", "T5"),
        ("G26 S900", "G26 S900"),
        ("G25 S50", "G25 S50"),
        ("G25 X-9 Z-2", "G25 X-9 Z-2"),
        ("WALIMOF", "G17 G40 G71 G90 G94 G64 BRISK CFC G450 WALIMOF"),
        ("BNAT EAUTO", "G17 G40 G71 G90 G94 G64 BRISK CFC G450 BNAT EAUTO"),
        ("ADIS=.7", "ADIS=.7"),
        ("ATRANS X4", "G59 X4"),
        ("COMPCAD FFWON", "COMPCAD"),
        ("CYCLE832(.01,_FINISH,1)", "CYCLE832(.01,_FINISH,1)"),
        ("OTOL=.5", "OTOL=.5"),
        ("DYNFINISH", "DYNFINISH"),
        ("M42", "M42"),
    ],
)
def test_everything_that_lasts_is_restored(block: str, restored: str) -> None:
    """(6.8) The tool chosen for later, limits, fine offsets, and words for the real control alone."""
    assert restored not in preamble_at(HEAD, "G1 Z1 F100\nX10\nM30\n")
    assert restored in preamble_at(HEAD + block + "\n", "G1 Z1 F100\nX10\nM30\n")


def test_the_tool_chosen_for_later_is_the_one_that_m6_changes_to() -> None:
    """(6.8) A restart between T and M6 must not change to the tool before."""
    data = (HEAD + "G1 Z1 F100\nT7\nX10\nX20\nG0 Z50\nM6\nM30\n").encode()
    commands, before = run_from(data, restart_at_line(data, HEAD.count("\n") + 4, HEIGHTS))
    assert [one.number for one in commands[before:] if isinstance(one, canon.ChangeTool)] == [7]


def test_the_spindle_is_limited_before_it_turns() -> None:
    """(6.8)"""
    blocks = preamble_at(HEAD.replace("S1000", "G26 S800\nS1000"), "G1 Z1 F100\nM30\n")
    assert blocks.index("G26 S800") < blocks.index("S1000 M3")


def test_numbers_have_no_more_decimals_than_the_control_reads() -> None:
    """(6.8)"""
    heights = dataclasses.replace(HEIGHTS, decimals=3)
    blocks = preamble_at(HEAD.replace("X0 Y0", "X1.23456 Y2"), "G1 Z1 F100\nM30\n", heights=heights)
    assert "G0 X1.235 Y2" in blocks


@pytest.mark.parametrize("name", ["BALL_R4", "FINISHER", "MILL8"])
def test_a_tool_that_has_a_name_is_called_by_it(name: str) -> None:
    """(6.8) The digits of the name were called as a number: another tool; a name without a digit was not called."""
    data = program().replace(b"T2 M6", b'T="%s" M6' % name.encode())
    assert b'T="' in data
    point = restart_at_number(data, 2, HEIGHTS)
    assert f'T="{name}" M6' in point.preamble
    by_hand = restart_at_number(data, 2, HEIGHTS, Settings(has_tool_changer=False)).preamble
    at = by_hand.index(f'T="{name}"')
    assert by_hand[at - 1 : at + 3] == (f'MSG("TOOL {name}")', f'T="{name}"', "M0", "MSG()")
    assert not [text for text in (*point.preamble, *by_hand) if re.match(r"T\d", text)]


def test_a_name_that_cannot_be_written_is_no_place_to_restart() -> None:
    """(6.8)"""
    data = program().replace(b"T2 M6", 'T="FRÄSER" M6'.encode("latin-1"))
    with pytest.raises(InputRejected, match="tool's name"):
        restart_at_number(data, 2, HEIGHTS)
