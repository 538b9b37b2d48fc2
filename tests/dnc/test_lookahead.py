"""How far back execution may stand: a look-ahead holds moves, whatever lies between them (5.7)."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from dnc.lookahead import first_unsure_line, moves
from dnc.profile import Control
from dnc.record import in_doubt
from tests.helpers.line import tape_of

ASIDE = [b"", b"; X1 Y2", b"(X1)", b"M8", b"G90 G64", b"F250", b'MSG("A")', b"G4 X2", b"/N5 G1 X3", b"R1=5"]


@pytest.mark.parametrize("aside", ASIDE)
@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\n\r", b"\n\r\r"])
def test_what_does_not_move_takes_no_place_in_a_look_ahead(tmp_path: Path, aside: bytes, end: bytes) -> None:
    """(5.7) Between the moves lie three lines each that it does not hold: moves in it were called executed."""
    lines = [text for number in range(1, 101) for text in (b"N%d G1 X%d" % (number, number), aside, aside, aside)]
    with closing(tape_of(tmp_path, end.join(lines) + end)) as tape:
        read_bytes = tape.lines.offset_of(tape, 4 * 60 + 1)
        assert first_unsure_line(tape, read_bytes, 20) == 4 * 40 + 1
        assert first_unsure_line(tape, read_bytes, 60) == first_unsure_line(tape, read_bytes, 61) == 1
        doubt = in_doubt(tape, read_bytes + 200, 0, Control(receive_buffer_bytes=200, lookahead_blocks=20))
        assert doubt is not None
        assert doubt.first == 4 * 40 + 1


def test_where_every_line_moves_lines_are_counted(tmp_path: Path) -> None:
    """(5.6) Also over the borders of the pieces that are read, with a line longer than a piece, with a leader."""
    lines = [b"X%d Y1 ;%s" % (number, b"long" * (3000 if number == 700 else number % 50)) for number in range(1, 1001)]
    with closing(tape_of(tmp_path, b"\n".join(lines) + b"\n", leader="\\NUL*30", line_max_bytes=20_000)) as tape:
        for line, blocks in ((1000, 1), (1000, 299), (1000, 300), (1000, 301), (1000, 998), (701, 1), (2, 1), (1, 5)):
            assert first_unsure_line(tape, tape.lines.offset_of(tape, line), blocks) == max(1, line - blocks)


@pytest.mark.parametrize("code", [b"BSPLINE", b"aspline", b"CSPLINE"])
def test_a_run_of_splines_is_unsure_from_its_begin(tmp_path: Path, code: bytes) -> None:
    """(5.7) A control may read the whole run before it moves: its first points were called executed."""
    run = [
        b"N1 G1 X0 Y0",
        b"N2 X1 ; BSPLINE",
        code + b" X2 Y0 PL=0",
        *(b"X%d Y1" % at for at in range(3, 60)),
        b"G1 X70",
    ]
    rest = [b"X%d" % at for at in range(71, 90)]
    with closing(tape_of(tmp_path, b"\n".join(run + rest) + b"\n")) as tape:

        def first(line: int) -> int:
            return first_unsure_line(tape, tape.lines.offset_of(tape, line), 3)

        assert [first(line) for line in (3, 4, 30, 61, 63)] == [1, 1, 1, 1, 3]
        assert [first(line) for line in (64, 70)] == [61, 67]


@pytest.mark.parametrize(
    ("text", "is_so"),
    [
        (b"N2G1G9Z2.7908F100", True),
        (b"POLY PO[X]=(49.8,12.1,9.2)PO[Z]=(2.9,2.9,-.7)F250G9", True),
        (b"L X+10 Y-2.5 R0 FMAX", True),
        (b"CIP X1 Y2 Z3 I1=4 J1=5", True),
        (b"g1 x=AC(5)", True),
        (b"G59 X3", False),
        (b"CC X+0 Y+0", False),
        (b"CYCLE81(X1)", False),
        (b"T2 M6", False),
        (b"MAX1=5", False),
        (b"%_N_X1_MPF", False),
    ],
)
def test_which_blocks_move_for_certain(text: bytes, *, is_so: bool) -> None:
    assert moves(text) is is_so
