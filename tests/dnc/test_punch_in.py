"""Programs from the control: where they end, what they are called, how they are stored (5.4)."""

from __future__ import annotations

import itertools
import json
import os
import pty
import subprocess
import sys
import tty
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnc.punch_in import End, PunchIn, Received, program_name
from dnc.receiving import put_away


def fed(data: bytes, *, seven: bool = False) -> list[Received]:
    punch_in = PunchIn(5.0, 10_000, is_seven_bit=seven)
    return [*punch_in.hear(data, 0.0), *punch_in.tick(10.0)]


@pytest.mark.parametrize(
    ("data", "programs"),
    [
        (b"\x12G0\nM30\n\x14", [(b"G0\nM30\n", End.CODE)]),
        (b"\0" * 50 + b"%\nO1\nM30\n%\n", [(b"%\nO1\nM30\n%\n", End.PERCENT)]),
        (b"%\nO1\nM30\n%\n%\nO2\nM30\n%\n", [(b"%\nO1\nM30\n%\n", End.PERCENT), (b"%\nO2\nM30\n%\n", End.PERCENT)]),
        (b"%_N_A_MPF\nG0\nM30\n", [(b"%_N_A_MPF\nG0\nM30\n", End.SILENCE)]),
        (b"G0\n\x03\x04", [(b"G0\n", End.CODE)]),
        (b"%\nO77\nN10 G1 X2\nN2", [(b"%\nO77\nN10 G1 X2\nN2", End.CUT)]),
        (b"%\nO77\nM30\n%", [(b"%\nO77\nM30\n%", End.SILENCE)]),
        (b"O77\nG0\nN20 M30", [(b"O77\nG0\nN20 M30", End.SILENCE)]),
        (b"O77\nG0\nN20 M3", [(b"O77\nG0\nN20 M3", End.CUT)]),
        (b"N10 R1=5\n", [(b"N10 R1=5\n", End.OPEN)]),
        (
            b"%_N_A_MPF\nM30\n%_N_B_MPF\nM30\n",
            [(b"%_N_A_MPF\nM30\n", End.NEXT), (b"%_N_B_MPF\nM30\n", End.SILENCE)],
        ),
        (
            b"%_N_A_MPF\nG0\n%_N_B_MPF\nM17\n",
            [(b"%_N_A_MPF\nG0\n", End.OPEN), (b"%_N_B_MPF\nM17\n", End.SILENCE)],
        ),
        (b"%\nO77\nN10 G1 X2\n", [(b"%\nO77\nN10 G1 X2\n", End.UNCLOSED)]),
        (b"\x11\x13\x11\0\0", []),
    ],
)
def test_where_a_program_ends(data: bytes, programs: list[tuple[bytes, End]]) -> None:
    """(5.4) One cut in the middle of a block is not whole; a last block may lack its end."""
    assert [(one.data, one.end) for one in fed(data)] == programs


@pytest.mark.parametrize("end", [b"\n", b"\r", b"\r\n", b"\n\r", b"\n\r\r"])
def test_the_closing_percent_keeps_its_line_end(end: bytes) -> None:
    """(5.4) Of an end of two or three bytes the first alone was kept: the file was not what the control had sent."""
    tape = end.join([b"%", b"O77", b"G0 X1", b"M30", b"%", b""])
    assert [(one.data, one.end) for one in fed(b"\0\0" + tape + tape + b"\0")] == [(tape, End.PERCENT)] * 2
    short = tape[: len(tape) - len(end)] + b"\n"
    assert [one.data for one in fed(short + tape)] == [short, tape]


def test_a_long_program_takes_no_longer_a_line() -> None:
    """(5.4) Each byte and each line end copied all that had come: a long program came faster than it was taken."""
    copied = [0]

    class Watched(bytearray):
        def rstrip(self, *words: bytes | None) -> bytearray:
            copied[0] += len(self)
            return super().rstrip(*words)

        def strip(self, *words: bytes | None) -> bytearray:
            copied[0] += len(self)
            return super().strip(*words)

    punch_in = PunchIn(5.0, 10_000_000)
    punch_in._data = Watched()
    for line in [b"%\n", b"O1\n", *[b"N10 G1 X1.5\n"] * 2000]:
        punch_in.hear(line, 0.0)
        assert punch_in.tick(0.1) == []
    assert copied[0] < 100_000


@given(cuts=st.lists(st.integers(0, 40), max_size=10))
def test_pieces_make_no_difference(cuts: list[int]) -> None:
    data = b"\0\x12%\nO77\nG0 X1\nM30\n%\n\x14\0%\nO78\nM30\n%\n"
    punch_in = PunchIn(5.0, 10_000)
    edges = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    got = [one for a, b in itertools.pairwise(edges) for one in punch_in.hear(data[a:b], 0.0)]
    assert [one.name for one in got] == ["O77", "O78"]


@given(data=st.binary(max_size=400))
def test_any_bytes_give_safe_names_and_no_codes(data: bytes) -> None:
    """(fault C12) Whatever the control says is stored, never obeyed, under a name that is safe."""
    for one in fed(data):
        assert one.name
        assert all(char.isalnum() or char in "_.-" for char in one.name)
        assert not set(one.data) & {0, 0x11, 0x12, 0x13, 0x14, 3, 4}


@pytest.mark.parametrize(
    ("data", "end"),
    [
        (b"O8\nM30\n", End.LAST),
        (b"%_N_A_MPF\nG0\nM17\n", End.LAST),
        (b"%\nO8\nM30\n", End.BREAK),
        (b"O8\nG1 X1\n", End.BREAK),
    ],
)
def test_where_a_program_stands_when_nobody_listens_any_longer(data: bytes, end: End) -> None:
    """(5.7) Its last block is its end, unless a closing % is still to come."""
    punch_in = PunchIn(5.0, 10_000)
    assert punch_in.hear(data, 0.0) == []
    assert [one.end for one in punch_in.break_off()] == [end]


def test_size_limit_and_parity() -> None:
    assert fed(b"X" * 25_000)[0].end is End.FULL
    even = bytes(code | (code.bit_count() & 1) << 7 for code in b"\x12%\nO9\nM30\n%\n\x14")
    assert [one.data for one in fed(even, seven=True)] == [b"%\nO9\nM30\n%\n"]


@pytest.mark.parametrize(("odd", "end"), [(0, End.EVEN), (1, End.ODD)])
def test_a_program_with_parity_bits_is_not_whole(odd: int, end: End) -> None:
    """(5.4; fault A8) A control at 7E1 and a profile of 8N1: the words say what to do, where garbage was stored."""
    program = b"%_N_A_MPF\nN10 G1 X1 Y2 Z3\nN20 X4 Y5.25\nM30\n"
    sent = bytes(code | (code.bit_count() & 1 ^ odd) << 7 for code in program)
    assert [(one.end, one.end.is_whole) for one in fed(sent)] == [(end, False)]
    assert [one.end for one in fed(program.replace(b"M30", b"(\xe4)\nM30"))] == [End.SILENCE]


@pytest.mark.parametrize(
    ("head", "name"),
    [
        (b"%_N_WAVE_1_SPF\n", "WAVE_1.SPF"),
        (b"%\n:0815\n", "O0815"),
        (b"$PART.MIN%\n", "PART.MIN"),
        (b"../../x\n", "program"),
    ],
)
def test_names(head: bytes, name: str) -> None:
    assert program_name(head + b"M30\n") == name


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    """An equal program is left alone; another of the same name gets a number."""
    first = put_away(Received("A.MPF", b"one", End.CODE), tmp_path)
    again = put_away(Received("A.MPF", b"one", End.CODE), tmp_path)
    other = put_away(Received("A.MPF", b"two", End.CODE), tmp_path)
    assert (first.is_new, again.is_new, other.path.name) == (True, False, "A-2.MPF")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["A-2.MPF", "A.MPF"]


@pytest.mark.system
def test_the_command(tmp_path: Path) -> None:
    """`dnc receive` on a pty: told by XON to begin, two programs, exit 0, JSON."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    words = ["receive", "--port", os.ttyname(slave), "-o", str(tmp_path), "--count", "2", "--json", "--send-xon"]
    child = subprocess.Popen([sys.executable, "-m", "dnc", *words], stdout=subprocess.PIPE, text=True)
    assert os.read(master, 1) == b"\x11"
    os.write(master, b"\x12%\nO1\nM30\n%\n\x14\x12%\nO2\nM30\n%\n\x14")
    out, _ = child.communicate(timeout=20)
    assert child.returncode == 0
    assert [Path(one["path"]).name for one in json.loads(out)["programs"]] == ["O1", "O2"]
    assert (tmp_path / "O2").read_bytes() == b"%\nO2\nM30\n%\n"
    os.close(slave)
    os.close(master)
