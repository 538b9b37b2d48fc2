"""Restarts: the rest of a program cuts the same from every place, and what is refused."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import random
import re

import pytest

from dnc.errors import InputRejected
from dnc.restart import clear_points, restart_at_line, restart_at_number
from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import Settings, Tool
from tests.dnc.restarts import HEAD, HEIGHTS, bare, cutting, program, run_from


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


@pytest.mark.parametrize("is_inch", [False, True])
def test_a_program_in_inches_goes_on_in_inches(is_inch: bool) -> None:
    """(6.8) The preamble speaks in the unit of the program, on a metric and on an inch machine."""
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


def test_a_place_behind_an_alarm_is_refused_with_the_alarm() -> None:
    """(6.8)"""
    with pytest.raises(InputRejected, match=r"line 3 is not reached.*line 2 with alarm 12470: G777"):
        restart_at_line(b"G17\nG777\nG0 X1\nM30\n", 3, HEIGHTS)


@pytest.mark.parametrize(
    ("middle", "words"),
    [
        ("BSPLINE X5 Z2 PL=0 F250\nX10 PL=1\nX15 PL=2\n@X20 PL=0\n", "BSPLINE is running"),
        ("ROT RPL=30\nG1 X10 F250\n@X20\n", "turns, scales or mirrors"),
        ("G1 X10 F250\nCT X15 Y5\n@X20 Y5\n", "CT takes its direction"),
        ("IF R1==0\n@G1 X10 F250\nENDIF\n", "IF, a loop or a jump is open"),
        ("DEF REAL WIDTH=5\n@G1 X10 F250\n", "defined by DEF"),
        ("G41\nG1 X10 F250\nX20\nG40\n@X30 Y9\n", "is ended by the next move only"),
        ("G1 X10 F250\nG0 SUPA Z400 D0\n@T2\nD1\n", "D0 is in force"),
        ("G1 X10 F250\nG0 SUPA Z400\n@G0 X20 Y9\nZ50\n", "where Z stands depends on work offsets"),
        ("G1 X10 Y-2 F250\nG0 Z50\nG54 G0 X20\nZ12\n@G1 Z1\n", "where Y stands depends on work offsets"),
        ("G1 X10 F250\nG0 Z50\nG53 G0 X0 Y0\nG91 X5\n@G90 X20 Y9\n", "where X, Y stands depends on work offsets"),
        ("SUPA G1 X3\n@Y9\n", "where X stands depends on work offsets"),
        ("G75 X1=0\n@Y9\n", "where X stands depends on work offsets"),
        ("G1 Z=R10 F80\n@X20\n", "reads R10 before, and only the control knows"),
        ("R1=$AA_IM[Z]\n@G1 X20\n", r"reads \$AA_IM before"),
        ("S0\n@G1 X20\nS500\n", "turns at a speed that the program does not name"),
        ("SPOS=90\n@G1 X20\nM3\n", "stands at an angle"),
        ("M19\n@G1 X20\nX30\nM5\n", "stands at an angle"),
        ("X10\n@X10\nCT X15 Y5\n", "CT takes its direction"),
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
    named = re.search(r"restart at line (\d+)", str(caught.value))
    assert named is not None
    assert restart_at_line(data, int(named[1]), HEIGHTS, settings).line == int(named[1]) < line
    for later in range(int(named[1]) + 1, line):
        with pytest.raises(InputRejected):
            restart_at_line(data, later, HEIGHTS, settings)


def test_dimensions_in_the_new_offset_say_where_the_axes_stand() -> None:
    """(6.8) The same numbers under another offset are another place; once all are named, a restart can begin."""
    blocks = HEAD + "G1 X10 Y-2 F250\nG0 Z50\nG54\nG0 X10 Y-2\nZ50\nZ12\nG1 Z1\nM30\n"
    line = blocks.count("\n") - 3
    assert restart_at_line(blocks.encode(), line + 1, HEIGHTS).position_mm == (10.0 + 1.0, -2.0 + 2.0, 50.0 + 3.0)
    for incremental in ("X=IC(10)", "G91 X10"):
        with pytest.raises(InputRejected, match="where X"):
            restart_at_line(blocks.replace("G0 X10", f"G0 {incremental}").encode(), line + 1, HEIGHTS)
    branch = blocks.replace("G0 X10 Y-2\n", "IF R1\nG0 X10 Y-2\nENDIF\n")
    with pytest.raises(InputRejected, match="where X, Y stands"):
        restart_at_line(branch.encode(), line + 3, HEIGHTS)


@pytest.mark.parametrize(
    ("head", "words"),
    [
        (HEAD.replace("T2 M6\n", ""), "no tool is called before"),
        (HEAD.replace("G55\n", ""), "no work offset is named before"),
        (HEAD.replace("G0 X0 Y0", "G0 X0"), "where Y stands is not said before"),
        (HEAD.replace("G0 X0 Y0\nZ10", "G91 G0 X5\nG90 Y0"), "where X stands is not said before"),
        (HEAD.replace("G0 Z50\n", "G91 G0 Z5\nG90\n").replace("Z10\n", "Z=IC(-3)\n"), "where Z stands is not said"),
    ],
)
def test_what_the_program_leaves_to_the_operator_is_not_guessed(head: str, words: str) -> None:
    """(6.8) Tool, work offset and axes of which nothing is said before are those of the control, not 0 and G500."""
    data = (head + "G1 X10 F250\nX20\nG0 Z50\nM30\n").encode()
    assert restart_at_line((HEAD + "G1 X10 F250\nX20\nG0 Z50\nM30\n").encode(), HEAD.count("\n") + 1, HEIGHTS)
    with pytest.raises(InputRejected, match=words):
        restart_at_line(data, head.count("\n") + 1, HEIGHTS)


def test_axes_stay_where_they_stand_until_the_first_rapid_moves_them() -> None:
    """(6.8) Before the first pass X and Y are the operator's: the preamble went to X0 Y0 of the program."""
    head, behind = HEAD.removesuffix("G0 X0 Y0\nZ10\n"), "N1 G0 X7 Y8\nZ10\nG1 Z1 F100\nX10\nG0 Z50\nM30\n"
    line = head.count("\n") + 1
    preamble = restart_at_line((head + behind).encode(), line, HEIGHTS).preamble
    assert not [block for block in preamble if "X" in block and block.startswith("G0")]
    assert [block for block in preamble if block.startswith("G0 Z")] == ["G0 Z50", "G0 Z50"]
    others = ["G0 X7", "G1 X7 Y8 F100", "G91 G0 X7 Y8", "SUPA G0 X7 Y8"]
    # The last would come down aslant from over the part, where the first run has stopped.
    for other in (*(f"N1 {block}\n" for block in others), "/N1 G0 X7 Y8\n", "N1 G0 X7 Y8 Z10\n"):
        with pytest.raises(InputRejected, match="where X, Y stands is not said before"):
            restart_at_line((head + behind.replace("N1 G0 X7 Y8\n", other)).encode(), line, HEIGHTS)


def test_a_program_that_names_its_places_by_parameters_is_restarted() -> None:
    """(6.8) X=R1 says where X stands as X7 does."""
    rest = "G1 Z1 F100\nX20\nG0 Z50\nM30\n"
    told = (HEAD.replace("X0 Y0\nZ10", "X7 Y3\nZ12") + rest).encode()
    text = HEAD.replace("Z50", "Z=R3").replace("X0 Y0\nZ10", "X=R1 Y=AC(R2/3)\nZ=R2+3")
    line = HEAD.count("\n") + 2
    point = restart_at_line(f"R1=7 R2=9 R3=50\n{text}{rest}".encode(), line + 1, HEIGHTS)
    assert point.preamble == ("R1=7", "R2=9", "R3=50", *restart_at_line(told, line, HEIGHTS).preamble)
    for unsaid in ("X=IC(R1)", "X=R4"):
        with pytest.raises(InputRejected, match=r"where X stands is not said|reads R4 before"):
            restart_at_line(f"R1=7 R2=9 R3=50\n{text}{rest}".replace("X=R1", unsaid).encode(), line + 1, HEIGHTS)


def test_heights_do_not_sink_with_a_frame_that_lowers_z() -> None:
    """(6.8) Under TRANS Z-40 the preamble went aside 40 mm below the safe height of the job, through the part."""
    data = (HEAD.replace("Z3", "Z-40") + "G1 Z1 F100\nX10\nX20\nG0 Z50\nM30\n").encode()
    commands, before = run_from(data, restart_at_line(data, HEAD.count("\n") + 3, HEIGHTS))
    moves = [one for one in commands[:before] if isinstance(one, (canon.Rapid, canon.Line))]
    aside = [one for one in moves if one.start[:2] != one.end[:2]]
    assert [one.start[2] for one in aside] == [HEIGHTS.safe_z_mm]
    assert min(one.end[2] for one in moves if isinstance(one, canon.Rapid)) == HEIGHTS.clearance_z_mm
    assert moves[-1].end[2] == 1.0 - 40.0


def test_before_a_tool_is_called_no_line_is_named() -> None:
    """(6.8) A tool that has a name and no number counts as called."""
    head = HEAD.replace("T2 M6\n", "") + "ROT RPL=30\nG1 X10 F250\n"
    line = head.count("\n")
    with pytest.raises(InputRejected, match="run the program from its start"):
        restart_at_line((head + "M30\n").encode(), line, HEIGHTS)
    named = head.replace("G0 Z50\n", 'G0 Z50\nT="BALL" M6\n')
    with pytest.raises(InputRejected, match=f"restart at line {line}$"):
        restart_at_line((named + "M30\n").encode(), line + 1, HEIGHTS)


def test_a_last_line_without_an_end_is_a_line_and_behind_it_is_none() -> None:
    """(6.8) Files that were cut or written by hand end so."""
    data = (HEAD + "G1 Z1 F100\nX10\nX20").encode()
    last = len(data.splitlines())
    point = restart_at_line(data, last, HEIGHTS)
    assert data[point.offset_bytes :] == b"X20"
    with pytest.raises(InputRejected, match=f"no line {last + 1}"):
        restart_at_line(data, last + 1, HEIGHTS)
    with pytest.raises(InputRejected, match=f"no line {last + 1}"):
        restart_at_line(data + b"\n", last + 1, HEIGHTS)


def test_clear_points_are_where_passes_end() -> None:
    """(6.8) Once for each time the tool stands clear, behind a rapid, with a tool: a cut up there is no pass's end."""
    blocks = "G0 Z10\nG0 X1\nG1 Z1 F100\nX10\nG0 Z10\nX0\nG1 Z1 F100\nX10\nG1 Z20\nX20\nG1 Z1\nG0 Z10\nM30\n"
    data = (HEAD + "G1 Z1 F100\n" + blocks).encode()
    first = HEAD.count("\n") + 1
    assert [point.line for point in clear_points(data, HEIGHTS)] == [6, first + 2, first + 6, first + 13]


def test_numbers_that_are_missing_or_stand_twice() -> None:
    with pytest.raises(InputRejected, match="no block N99"):
        restart_at_number(program(), 99, HEIGHTS)
    with pytest.raises(InputRejected, match="N5 stands 2 times"):
        restart_at_number(b"N5 G17\nN5 G90\nM30\n", 5, HEIGHTS)
    with pytest.raises(InputRejected, match="no line 50"):
        restart_at_line(b"G17\nM30\n", 50, HEIGHTS)


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
    *("G0 X=R1 Y=AC(R2)", "Z=R1+9", "G1 Y=IC(R2) F90", "X=$P_EP[X]+1", "R7=R7+1", "POLY X=PO(8,1,.5)"),
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
    for number in range(9, len(lines) + 1):
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


@pytest.mark.parametrize("seed", range(20, 25))
def test_a_restart_holds_on_a_machine_whose_offsets_and_places_are_its_own(seed: int) -> None:
    """(6.8) Work offsets, where the axes began, R parameters and reference points are the control's: none is taken."""
    chance = random.Random(seed)
    known = Settings(tools={number: Tool(2.0) for number in range(4)})
    machine = dataclasses.replace(
        known,
        start_mm=(chance.uniform(-50, 50), chance.uniform(-50, 50), 300.0),
        work_offsets_mm={f"G{number}": (chance.uniform(-9, 9), 7.0, chance.uniform(-9, 9)) for number in (54, 55)},
        reference_point_mm=(11.0, 12.0, 13.0),
    )
    lines = _lines_by_chance(chance, machine)
    data = "".join(f"{line}\n" for line in lines).encode()
    whole = list(interpret(data, machine))
    for number in range(2, len(lines) + 1):
        with contextlib.suppress(InputRejected):
            commands, before = run_from(data, restart_at_line(data, number, HEIGHTS, known), machine)
            rest = [one for one in whole if one.line >= number]
            assert len(commands) - before == len(rest), (number, lines)
            for new, old in zip(commands[before:], rest, strict=True):
                assert _is_same(new, old), (number, lines, new, old)


def _lines_by_chance(chance: random.Random, settings: Settings) -> list[str]:
    """A program of 25 blocks by chance that the control accepts."""
    lines = ["R1=1 R2=2", "G17 G90 G71 G94", "G54", "T1 M6", "D1", "S1000 M3", "G0 X0 Y0 Z12", "G1 Z1 F100"]
    while len(lines) < 33:
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
