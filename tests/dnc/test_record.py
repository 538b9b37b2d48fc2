"""What a job's record and its words say of lines: nothing before anything was sent, a restart's own lines (5.7)."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from dnc.profile import Control
from dnc.record import InDoubt, append_record, doubt_of, doubt_words, in_doubt, last_line, own_line
from tests.helpers.line import sender_of, tape_of

PROGRAM = b"".join(b"N%d G1 X%d\n" % (number, number) for number in range(1, 51)) + b"M30\n"
CONTROL = Control(receive_buffer_bytes=100, lookahead_blocks=3)
RESTART = {"line": 61, "lines_before": 3}


def test_nothing_is_in_doubt_before_the_first_byte_of_the_program(tmp_path: Path) -> None:
    """(5.7) A leader is no part of the program: with it alone sent, no block was."""
    with closing(tape_of(tmp_path, PROGRAM, leader="\\NUL*30")) as tape:
        assert tape.leader_bytes == 30
        assert [in_doubt(tape, sent_bytes, 0, CONTROL) for sent_bytes in (0, 29, 30)] == [None, None, None]
        assert in_doubt(tape, 31, 0, CONTROL) == InDoubt(1, 1, 30)
        assert doubt_of(sender_of(tape), CONTROL) is None
        assert doubt_words(tape, None) == "nothing of the program was sent"


def test_lines_of_a_restart_are_those_of_the_program_behind_its_preamble() -> None:
    """(5.7, 6.8) Three lines of preamble, then line 61 of the file."""
    assert [own_line(line, RESTART) for line in (1, 3, 4, 5)] == [None, None, 61, 62]
    assert [own_line(line, None) for line in (1, 2)] == [1, 2]


def test_the_words_name_lines_of_the_file(tmp_path: Path) -> None:
    """(5.7) What lies before line 1 is nothing, and is not called executed."""
    with closing(tape_of(tmp_path, PROGRAM)) as tape:
        assert (
            doubt_words(tape, InDoubt(1, 4, 20))
            == "in doubt from line 1 (N1) to line 4 (N4); nothing behind it was sent whole"
        )
        assert doubt_words(tape, InDoubt(2, 4, 20, is_proven=True)).startswith(
            "what lies before line 2 (N2) was executed; "
        )
        told = doubt_words(tape, InDoubt(3, 5, 20), RESTART)
        assert "before line 3 of the restart's preamble was executed, if the control took all" in told
        assert "to line 62 (N5);" in told


def test_the_record_is_kept_in_a_folder_that_there_is_or_is_not(tmp_path: Path) -> None:
    """(5.7) The first job of a computer makes the folder, the second finds it."""
    folder = tmp_path / "state" / "dnc"
    assert last_line(folder / "records.jsonl") == b""
    for job in ("1", "2"):
        append_record(folder, {"job": job})
    assert b'"job": "2"' in last_line(folder / "records.jsonl")


def test_a_long_record_is_found_whole_behind_others(tmp_path: Path) -> None:
    """(5.7) Only the last megabyte of the file is read; a torn line at its end goes, the whole lines stay."""
    path = tmp_path / "records.jsonl"
    path.write_bytes(b'{"job": "0", "why": "%s"}\n' % (b"x" * (3 << 19)) + b'{"job": "1"}\n{"jo')
    append_record(tmp_path, {"job": "2"})
    lines = path.read_bytes().split(b"\n")
    assert (len(lines[0]), lines[1], lines[2][:11], lines[3]) == ((3 << 19) + 23, b'{"job": "1"}', b'{"job": "2"', b"")
