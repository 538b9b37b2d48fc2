"""What a look-ahead can hold, against the interpreter: no spline block without a span, no move to nowhere (5.7)."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from dnc.branches import Codes
from dnc.lookahead import first_unsure_line
from sim.interpreter import canon
from sim.interpreter.run import Interpreter
from sim.interpreter.settings import Settings, Tool
from tests.helpers.line import tape_of

HEAD = [b"G17 G54 G64 G90", b"T2 M6", b"D1", b"S1000 M3", b"G0 X0 Y0 Z50"]
BLOCKS = 12
MOTIONS = canon.Line | canon.Rapid | canon.Arc | canon.Polynomial
PL = b" PL=%d"


def a_pass(number: int, code: bytes, interval: bytes, points: int) -> list[bytes]:
    """As the planner writes one: down, a run, up."""
    start, end = (0, points) if number % 2 else (points, 0)
    run = [b"X%d Z%d" % (start + (end - start) * at // points, -1 - at % 2) for at in range(1, points + 1)]
    if interval:
        run = [text + interval % (0 if at in (0, points - 1) else 25) for at, text in enumerate(run)]
    return [b"G0 X%d Y%d" % (start, number), b"G1 G9 Z-1 F100", code + b" " + run[0], *run[1:], b"G0 Z10"]


def executing_before(lines: list[bytes], blocks: int, settings: Settings | None = None) -> list[int]:
    """For so many lines read, from 0: the line that a control may still execute, which reads on while it has room."""
    interpreter, moved, found = Interpreter(settings), [0], [1]
    for number, line in enumerate(lines, 1):
        found.append(max(1, moved[-blocks + 1] if len(moved) >= blocks else 1))
        commands = interpreter.block(line, number)
        assert not [one for one in commands if isinstance(one, canon.Alarm)], line
        moved += [one.line for one in commands if isinstance(one, MOTIONS)]
    return found


@pytest.mark.parametrize("points", [6, 9])
@pytest.mark.parametrize(("code", "interval"), [(b"BSPLINE", PL), (b"BSPLINE", b""), (b"CSPLINE", b""), (b"G1", b"")])
def test_no_line_of_a_spline_is_executed_that_a_full_look_ahead_may_hold(
    tmp_path: Path, code: bytes, interval: bytes, points: int
) -> None:
    """(5.7) Each block counted as a place: of planned B-splines a line was executed that still lay before the tool."""
    lines = [*HEAD, *(text for number in range(1, 9) for text in a_pass(number, code, interval, points))]
    with closing(tape_of(tmp_path, b"\n".join([*lines, b"M30"]) + b"\n")) as tape:
        for read, executing in enumerate(executing_before(lines, BLOCKS)):
            first = first_unsure_line(tape, tape.lines.offset_of(tape, read + 1), BLOCKS)
            assert first <= executing
        assert first > len(lines) - 5 * (points + 3)


@pytest.mark.parametrize("nowhere", [b"X%d", b"G1 X%d.0 Y0", b"X=%d", b"G0 Z50"])
def test_a_move_to_where_the_axes_stand_takes_no_place_in_a_look_ahead(tmp_path: Path, nowhere: bytes) -> None:
    """(5.7) A CAM system's doubled points filled it: lines were executed that still lay before the tool."""
    lines = list(HEAD)
    for number in range(1, 41):
        lines += [b"G1 X%d F250" % number, *[nowhere % number if b"%" in nowhere else nowhere] * 3]
    with closing(tape_of(tmp_path, b"\n".join([*lines, b"M30"]) + b"\n")) as tape:
        for read, executing in enumerate(executing_before(lines, BLOCKS)):
            first = first_unsure_line(tape, tape.lines.offset_of(tape, read + 1), BLOCKS)
            assert first <= executing
        assert first > len(lines) - 4 * (BLOCKS + 2)


def test_two_spellings_of_one_place_take_no_place_in_a_look_ahead(tmp_path: Path) -> None:
    """(5.7) X=3+4 behind X7 counted as a move: lines were executed that still lay before the tool."""
    lines = [*HEAD, b"G1 X7 F250"]
    for number in range(1, 41):
        lines += [b"X=3+4", b"X7", b"X=2+5", b"X7", b"Y%d" % number]
    with closing(tape_of(tmp_path, b"\n".join([*lines, b"M30"]) + b"\n")) as tape:
        for read, executing in enumerate(executing_before(lines, BLOCKS)):
            first = first_unsure_line(tape, tape.lines.offset_of(tape, read + 1), BLOCKS)
            assert first <= executing
        assert first > len(lines) - 5 * (BLOCKS + 2)


def begins_early_enough(folder: Path, lines: list[bytes]) -> list[int]:
    """Where the window begins after each line; every time at or before the line that may still be executed."""
    firsts = []
    with closing(tape_of(folder, b"\n".join([*lines, b"M30"]) + b"\n")) as tape:
        for read, executing in enumerate(executing_before(lines, BLOCKS)):
            firsts.append(first_unsure_line(tape, tape.lines.offset_of(tape, read + 1), BLOCKS))
            assert firsts[-1] <= executing, (read, lines[read - 1])
    return firsts


@pytest.mark.parametrize("zero", [b"X0", b"X0.0", b"X-0 Y0", b"G1 X.0", b"X0 F250", b"G91 X0", b"N7 X=0 Y=0", b"Z0"])
@pytest.mark.parametrize("step", [b"X1", b"X1 Y2", b"Y-.5"])
def test_increments_of_nothing_take_no_place_in_a_look_ahead(tmp_path: Path, zero: bytes, step: bytes) -> None:
    """(5.7) X0 behind X1 under G91 counted as a move: lines were executed that still lay before the tool."""
    lines = [*HEAD, b"G1 G91 X1 F250", *[step, zero, zero] * 40]
    firsts = begins_early_enough(tmp_path, lines)
    if step == b"X1 Y2":
        assert firsts[-1] == 1 or firsts[-1] > len(lines) - 9 * BLOCKS


@pytest.mark.parametrize(
    "elsewhere",
    [
        [b"X10", b"ATRANS X1", b"X9", b"TRANS", b"X10"],
        [b"G91 X3", b"G90 X8", b"X5"],
        [b"X10", b"G55", b"X10", b"G54", b"X10"],
        [b"X25.4", b"G700", b"X1", b"G710", b"X25.4"],
        [b"X4", b"X=IC(4)", b"X8", b"X4"],
        [b"X4", b"X=R1", b"X0", b"X4"],
        [b"X4", b"X=(5-1)*2", b"X8", b"X4"],
        [b"SUPA X10", b"X10", b"Y0"],
    ],
)
def test_one_place_under_two_names_takes_no_place_in_a_look_ahead(tmp_path: Path, elsewhere: list[bytes]) -> None:
    """(5.7) Behind TRANS, an offset, G91 or inches another number may be the same place."""
    begins_early_enough(tmp_path, [*HEAD, b"G1 X5 F250", *elsewhere * 20])


@pytest.mark.parametrize("corner", [b"G450", b"G451"])
@pytest.mark.parametrize("lifts", [0, 1, 14])
@pytest.mark.parametrize("plane", [b"G17", b"G18"])
def test_a_contour_beside_the_tool_is_held_until_the_next_moves_are_read(
    tmp_path: Path, corner: bytes, lifts: int, plane: bytes
) -> None:
    """(5.7) Under G41 a move waits for the next in the plane: it was called executed before it had begun."""
    first, second, across = (b"X", b"Y", b"Z") if plane == b"G17" else (b"Z", b"X", b"Y")
    lines = [*HEAD, b"G1 F250 " + plane + b" " + corner, b"G41 " + first + b"9 " + second + b"9"]
    for number in range(10, 50):
        up = [across + b"%d" % (at + number) for at in range(lifts)]
        lines += [first + b"%d " % number + second + b"%d" % (9 + number % 2 * 5), *up]
    lines += [b"G40 X0 Y0 Z0"]
    tools = Settings(tools={2: Tool(1.0)})
    with closing(tape_of(tmp_path, b"\n".join([*lines, b"M30"]) + b"\n")) as tape:
        for read, executing in enumerate(executing_before(lines, BLOCKS, tools)):
            begin = first_unsure_line(tape, tape.lines.offset_of(tape, read + 1), BLOCKS)
            assert begin <= executing, (read, lines[read - 1])
        assert begin > len(lines) - (3 * BLOCKS) * (lifts + 1)


@pytest.mark.parametrize(
    "passed_over",
    [
        b"GOTOF BEHIND\n%sBEHIND: R1=1",
        b"IF R1>5\n%sENDIF",
        b"N7IF R1==0\nR1=1\nELSE\n%sENDIF",
        b"if R1==0 gotof BEHIND\n%sBEHIND:",
        b"WHILE R1>5\n%sENDWHILE",
    ],
)
def test_what_a_jump_may_pass_over_fills_no_look_ahead(tmp_path: Path, passed_over: bytes) -> None:
    """(5.7) Blocks that never ran counted as moves: lines before the jump were executed that lay before the tool."""
    lines = [*HEAD, *(b"G1 X%d F250" % x for x in range(40))]
    ahead = len(lines)
    lines += (passed_over % b"".join(b"X%d\n" % x for x in range(60, 100))).split(b"\n")
    lines += [b"G1 Y%d" % y for y in range(1, 8)]
    with closing(tape_of(tmp_path, b"\n".join([*lines, b"M30"]) + b"\n")) as tape:
        for read, executing in enumerate(executing_before(lines, BLOCKS)):
            first = first_unsure_line(tape, tape.lines.offset_of(tape, read + 1), BLOCKS)
            assert first <= executing
        assert first == ahead - BLOCKS + 1


@pytest.mark.parametrize("aside", [b"; IF IT BREAKS", b"(WAIT FOR TOOL)", b'MSG("GOTO 5")', b"N1 M8 ; if", b"R_IF=1"])
def test_words_of_jumps_in_texts_are_none(tmp_path: Path, aside: bytes) -> None:
    """(5.7)"""
    lines = [*HEAD, aside, *(b"G1 X%d F250" % x for x in range(40))]
    with closing(tape_of(tmp_path, b"\n".join(lines) + b"\n")) as tape:
        assert tape.traits.branch_at is None
        assert first_unsure_line(tape, tape.size_bytes, BLOCKS) == len(lines) - BLOCKS + 1
    with closing(tape_of(tmp_path, b"X1\n" * 40000 + b"GOTOF A\nA: X2")) as tape:
        assert tape.traits.branch_at == 120000


def test_codes_are_found_in_whatever_pieces_the_tape_comes() -> None:
    """(5.7)"""
    text = b"N1 g1 X4.1\nN2 G041 X1\nN3 L X+1 RL F9\nN4 G091\nG18 X9\n"
    for size in range(1, 12):
        codes = Codes()
        for at in range(0, len(text), size):
            codes.feed(text[at : at + size])
        assert (codes.is_compensated, codes.is_incremental, codes.has_other_plane) == (True, True, True)
    codes = Codes()
    codes.feed(b"G17 G40 G90\nG1 X41 Y91 Z18\n")
    assert (codes.is_compensated, codes.is_incremental, codes.has_other_plane) == (False, False, False)
