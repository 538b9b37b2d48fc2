"""Restarts: what the preamble restores, in which order, and what is refused."""

from __future__ import annotations

import dataclasses
import math
import random

import msgspec
import pytest

from dnc.errors import InputRejected
from dnc.preamble import Heights
from dnc.restart import restart_at_line, restart_at_number
from planner.post.base import write_program
from planner.post.written import ControlLimits
from sim.interpreter import canon
from sim.interpreter.run import Interpreter, interpret
from sim.interpreter.settings import Settings, Tool
from tests.planner.post.paths import job, polyline, spline, tool_path

HEIGHTS = Heights(safe_z_mm=50.0, clearance_z_mm=10.0, plunge_mm_min=100.0, dwell_s=2.0, retract_z_mm=400.0)
HEAD = "G17 G40 G64 G71 G90 G94\nTRANS X1 Y2 Z3\nG55\nG0 Z50\nT2 M6\nD1\nS1000 M3\nG4 F2\nM8\nG0 X0 Y0\nZ10\n"


def program(blocks: str = "poly") -> bytes:
    made = job(blocks=blocks)
    shapes = [polyline(1), polyline(2), polyline(3)] if blocks == "linear" else [spline(1), spline(2), spline(3)]
    return write_program(made, made.operation[0], tool_path(shapes), ControlLimits(retract_z_mm=400.0)).data


def cutting(commands: list[canon.Command]) -> list[canon.Command]:
    return [one for one in commands if isinstance(one, (canon.Line, canon.Polynomial, canon.Arc))]


def run_from(data: bytes, point, settings: Settings | None = None) -> tuple[list[canon.Command], int]:
    """What a control does with the preamble and the rest, and how many commands the preamble gave."""
    interpreter = Interpreter(settings or Settings(start_mm=(7.0, 7.0, 300.0)))
    commands: list[canon.Command] = []
    for number, text in enumerate(point.preamble, 1):
        commands += interpreter.block(text.encode(), number)
    before = len(commands)
    for number, raw in enumerate(data[point.offset_bytes :].splitlines(), len(point.preamble) + 1):
        commands += interpreter.block(raw, number)
    return commands + interpreter.finish(), before


def bare(command: canon.Command) -> canon.Command:
    return msgspec.structs.replace(command, line=0, block=None)


@pytest.mark.parametrize("blocks", ["poly", "linear"])
@pytest.mark.parametrize("number", [1, 2, 3])
def test_the_rest_cuts_the_same_from_every_pass_start(blocks: str, number: int) -> None:
    """From N of a pass start the cuts equal those of the whole program from there on (6.8)."""
    data = program(blocks)
    point = restart_at_number(data, number, HEIGHTS)
    whole = [bare(one) for one in cutting(list(interpret(data)))]
    commands, before = run_from(data, point)
    assert not [one for one in commands if isinstance(one, canon.Alarm)]
    rest = [bare(one) for one in cutting(commands[before:])]
    assert rest == whole[-len(rest) :]
    assert len(rest) == len(whole) * (4 - number) // 3


@pytest.mark.parametrize("blocks", ["poly", "linear"])
def test_the_rest_cuts_the_same_from_inside_a_pass(blocks: str) -> None:
    """Inside a pass the tool is fed straight down to where that block begins (6.8)."""
    data = program(blocks)
    lines = data.decode().splitlines()
    line = next(index for index, text in enumerate(lines, 1) if text.startswith("N2")) + 3
    point = restart_at_line(data, line, HEIGHTS)
    commands, before = run_from(data, point)
    rest = [bare(one) for one in cutting(commands[before:])]
    whole = [bare(one) for one in cutting(list(interpret(data)))]
    assert rest == whole[-len(rest) :]
    first = cutting(commands[:before])
    assert len(first) == 1
    assert first[0].start[:2] == first[0].end[:2] == point.position_mm[:2]
    assert first[0].end == pytest.approx(point.position_mm)
    assert first[0].feed_mm_min == 100.0


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


@pytest.mark.parametrize("is_inch", [False, True])
def test_a_program_in_inches_goes_on_in_inches(is_inch: bool) -> None:
    """(6.8) The preamble is in millimetres and sets the unit last, on a metric and on an inch machine."""
    settings = Settings(start_mm=(7.0, 7.0, 300.0), is_inch=is_inch)
    head = HEAD.replace("G71", "G700").replace("Z50", "Z2").replace("Z10", "Z.5")
    data = (head + "G1 Z.1 F4\nG641 ADIS=.01\nX1 F10\nX2 Y1\nG0 Z2\nM30\n").encode()
    point = restart_at_line(data, len(HEAD.splitlines()) + 4, HEIGHTS, settings)
    commands, before = run_from(data, point, settings)
    rest, whole = cutting(commands[before:]), cutting(list(interpret(data, settings)))
    assert [(one.start, one.end) for one in rest] == [(pytest.approx(whole[-1].start), pytest.approx(whole[-1].end))]
    assert rest[0].feed_mm_min == 254.0
    modes = [one for one in commands[:before] if isinstance(one, canon.SetPathMode)]
    assert modes[-1].tolerance_mm == pytest.approx(0.254)


def test_without_a_changer_the_operator_is_told_the_tool() -> None:
    """(6.8) T and M0 with a message, in the preamble too."""
    point = restart_at_number(program(), 2, HEIGHTS, Settings(has_tool_changer=False))
    at = point.preamble.index("T2")
    assert point.preamble[at - 1 : at + 3] == ('MSG("TOOL 2")', "T2", "M0", "MSG()")


def test_a_place_behind_an_alarm_is_refused_with_the_alarm() -> None:
    """(6.8)"""
    with pytest.raises(InputRejected, match=r"line 3 is not reached.*line 2 with alarm 12470: G777"):
        restart_at_line(b"G17\nG777\nG0 X1\nM30\n", 3, HEIGHTS)


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


@pytest.mark.parametrize(
    ("middle", "words"),
    [
        ("BSPLINE X5 Z2 PL=0 F250\nX10 PL=1\nX15 PL=2\n@X20 PL=0\n", "BSPLINE is running"),
        ("ROT RPL=30\nG1 X10 F250\n@X20\n", "turns, scales or mirrors"),
        ("G1 X10 F250\nCT X15 Y5\n@X20 Y5\n", "CT takes its direction"),
        ("IF R1==0\n@G1 X10 F250\nENDIF\n", "IF, a loop or a jump is open"),
        ("DEF REAL WIDTH=5\n@G1 X10 F250\n", "defined by DEF"),
    ],
)
def test_places_that_cannot_be_restored_are_refused_with_a_better_one(middle: str, words: str) -> None:
    """(6.8)"""
    text = HEAD + "G1 Z1 F100\n" + middle
    line = text.split("@")[0].count("\n") + 1
    data = (text.replace("@", "") + "G0 Z50\nM30\n").encode()
    settings = Settings(tools={2: Tool(4.0)})
    with pytest.raises(InputRejected, match=words) as caught:
        restart_at_line(data, line, HEIGHTS, settings)
    assert "restart at line" in str(caught.value)


def test_numbers_that_are_missing_or_stand_twice() -> None:
    with pytest.raises(InputRejected, match="no block N99"):
        restart_at_number(program(), 99, HEIGHTS)
    with pytest.raises(InputRejected, match="N5 stands 2 times"):
        restart_at_number(b"N5 G17\nN5 G90\nM30\n", 5, HEIGHTS)
    with pytest.raises(InputRejected, match="no line 50"):
        restart_at_line(b"G17\nM30\n", 50, HEIGHTS)


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


@pytest.mark.parametrize(
    ("middle", "words"),
    [
        ("@CT X15 Y5\n", "CT takes its direction"),
        ("@G64\nTRANS X9\nCSPLINE X15 Y5\nX20\n", "CSPLINE takes its direction"),
        ("BNAT\n@BTAN ASPLINE X15 Y5\nX20\n", "ASPLINE takes its direction"),
        ("G41\n@G1 X15\nX20\nG40 X30 Y9\n", "G41 is active"),
    ],
)
def test_a_first_move_that_leans_on_the_one_before_is_refused(middle: str, words: str) -> None:
    """(6.8) Behind the preamble the tool has come straight down: a curve that goes on from there would be another."""
    text = HEAD + "G1 Z1 F100\nX10\n" + middle
    line = text.split("@")[0].count("\n") + 1
    data = (text.replace("@", "") + "G1 Z5\nM30\n").encode()
    with pytest.raises(InputRejected, match=words):
        restart_at_line(data, line, HEIGHTS, Settings(tools={2: Tool(1.0)}))
    free = data.replace(b"BTAN ASPLINE", b"ASPLINE").replace(b"CSPLINE", b"BNAT CSPLINE")
    if free != data:
        assert restart_at_line(free, line, HEIGHTS)


def test_numbers_have_no_more_decimals_than_the_control_reads() -> None:
    """(6.8)"""
    heights = dataclasses.replace(HEIGHTS, decimals=3)
    blocks = preamble_at(HEAD.replace("X0 Y0", "X1.23456 Y2"), "G1 Z1 F100\nM30\n", heights=heights)
    assert "G0 X1.235 Y2" in blocks


LASTING = [
    *("G90", "G91", "G17", "G18", "G19", "G54", "G55", "G500", "TRANS X5 Y2", "TRANS", "G58 X3", "G59 Y1"),
    *("G60", "G64", "G641 ADIS=.3", "G642", "CTOL=.02", "G643", "G94", "G95", "F300", "F=R1+100", "R1=5", "R2=R1*2.5"),
    *("S1200 M3", "S500", "M4", "M5", "M8", "M7", "M9", "T2", "T1", "M6", "T3 M6", "D0", "D2", "SOFT", "BRISK"),
    *("FGROUP(X,Y)", "FGROUP()", "G70", "G71", "G700", "G710", "BNAT", "ENAT", "BTAN", "EAUTO"),
    *("ATRANS X1 Z2", "DRIVE", "CFTCP", "G451"),
    *("G25 X-900", "G26 X900 Y900", "WALIMOF", "WALIMON", "G25 S50", "G26 S900", "G4 F1", "M0", "ADIS=.7", "COMPCAD"),
    *("SUPA G0 Z400 D0", "G53 G0 X0", "G74 Z1=0", "ROT RPL=30", "MIRROR X0", "G9 G1 X1 F100", "R3=$AA_IW[X]"),
    *("BSPLINE X1 Z1", "X2 Z2", "X3 Z1", "X5 Z0", "G1 X7", "CSPLINE X1 Y1", "X4 Y6", "CT X9 Y30", "G41 G1 X5 Y5"),
    *("X20 Y5", "G40 G1 X30 Y0", "G0 X12", "G0 Z30", "G1 Z-1 F80", "G2 X14 Y9 CR=200", "G3 I5 J0", "Y-7.5", "Z3"),
    *("POLY PO[X]=(7,1,.5) PO[Z]=(2,.1)", "CIP X8 Y-3 I1=4 J1=9", "G1 X-11 Y4 Z2 F250.5"),
]  # fmt: skip


@pytest.mark.parametrize("seed", range(12))
def test_whatever_came_before_the_rest_of_a_program_is_the_same_after_a_restart(seed: int) -> None:
    """(6.8) Programs by chance: from every line the rest commands what it does in the whole run, or it is refused."""
    settings = Settings(
        start_mm=(0.0, 0.0, 500.0),
        tools={number: Tool(2.0) for number in range(4)},
        work_offsets_mm={"G54": (10.0, 20.0, 30.0), "G55": (-5.0, 7.0, 2.0)},
    )
    lines = _lines_by_chance(random.Random(seed), settings)
    data = "".join(f"{line}\n" for line in lines).encode()
    whole = list(interpret(data, settings))
    restarts = 0
    for number in range(8, len(lines) + 1):
        try:
            point = restart_at_line(data, number, HEIGHTS, settings)
        except InputRejected:
            continue
        commands, before = run_from(data, point, settings)
        rest = [one for one in whole if one.line >= number]
        assert not [one for one in commands if isinstance(one, canon.Alarm)], (number, lines)
        assert len(commands) - before == len(rest), (number, lines)
        for new, old in zip(commands[before:], rest, strict=True):
            assert _is_same(new, old), (number, lines, new, old)
        restarts += 1
    assert restarts > 0


def _lines_by_chance(chance: random.Random, settings: Settings) -> list[str]:
    """A program of 25 blocks by chance that the control accepts."""
    lines = ["G17 G90 G71 G94", "G54", "T1 M6", "D1", "S1000 M3", "G0 X0 Y0 Z12", "G1 Z1 F100"]
    while len(lines) < 32:
        tried = [*lines, chance.choice(LASTING)]
        text = "".join(f"{line}\n" for line in [*tried, "M30"])
        is_short_spline = "SPLINE" in tried[-1]
        if is_short_spline:
            text = text.replace("M30", "X51\nX52\nX53\nX54\nM30")
        if not any(isinstance(one, canon.Alarm) for one in interpret(text.encode(), settings)):
            lines = [*tried, "X51", "X52", "X53", "X54"] if is_short_spline else tried
    return [*lines, "M30"]


def _is_same(one: object, other: object) -> bool:
    """Equal but for line, block, and what a sixth decimal of an inch leaves."""
    if isinstance(one, canon.Command) and isinstance(other, canon.Command):
        names = [name for name in one.__struct_fields__ if name not in ("line", "block")]
        return type(one) is type(other) and all(_is_same(getattr(one, name), getattr(other, name)) for name in names)
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_is_same, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=3e-5, abs_tol=3e-5)
    return one == other
