"""The tape: framing, refusals with line and column, line look-up (5.4, 5.6)."""

from __future__ import annotations

import hashlib
import os
import resource
import signal
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnc import profile, spool
from dnc.errors import InputRejected, SettingsRejected
from dnc.framing import escaped_bytes
from dnc.spool import load_tape
from tests.helpers.line import tape_of

PROGRAM = b"N10 G1 X1\nN20 X2\nN30 M30\n"


def whole(tape: object) -> bytes:
    return tape.peek(0, tape.size_bytes)  # type: ignore[attr-defined, no-any-return]


def test_bytes_as_in_the_file(tmp_path: Path) -> None:
    """(5.6)"""
    data = b"N10 G1 X1\r\nN20 M30\r\n%"
    tape = tape_of(tmp_path, data)
    assert whole(tape) == data
    assert tape.sha256 == tape.program_sha256 == hashlib.sha256(data).hexdigest()
    assert tape.block_end == b"\r\n"


def test_leader_and_trailer(tmp_path: Path) -> None:
    """(5.4)"""
    tape = tape_of(tmp_path, b"%\nM30\n%\n", leader=r"\NUL*50\DC2", trailer=r"\DC4\x03")
    assert whole(tape) == b"\0" * 50 + b"\x12%\nM30\n%\n\x14\x03"
    assert tape.leader_bytes == 51
    assert tape.sha256 != tape.program_sha256


@pytest.mark.parametrize(("data_bits", "column", "what"), [(5, 1, "'G'"), (6, 1, "'G'"), (7, 7, "'\xe4'")])
def test_a_character_that_the_format_cannot_carry_is_refused(
    tmp_path: Path, data_bits: int, column: int, what: str
) -> None:
    """(5.4, 5.6) Five data bits would carry G as 0x07: refused with line and column before the first byte leaves."""
    (tmp_path / "part.mpf").write_bytes(b"\r\nG1 X1 \xe4\r\n")
    rules = profile.Tape(character_set="any")
    with pytest.raises(InputRejected, match="does not fit") as refused:
        load_tape(tmp_path / "part.mpf", rules, tmp_path, data_bits)
    assert f"part.mpf:2:{column}: character {what}" in str(refused.value)
    load_tape(tmp_path / "part.mpf", rules, tmp_path, 8).close()


@pytest.mark.parametrize(
    ("rules", "words"),
    [
        ({"leader": r"\FOO"}, r"tape.leader .* is no known escape"),
        ({"leader": r"%\CRLF"}, r"would send the text 'LF'; write \\LF"),
        ({"trailer": "\u20ac"}, r"tape.trailer .*: no line carries"),
        ({"trailer": r"\xFF"}, r"tape.trailer .*: 0xFF does not fit into 7 data bits"),
        ({"end_of_block": "cr-lf"}, r"tape.end_of_block 'cr-lf' ends no block"),
        ({"end_of_block": "crlf "}, r"ends no block"),
        ({"end_of_block": ""}, r"ends no block"),
        ({"end_of_block": r"\LF\x13"}, r"ends no block"),
    ],
)
def test_framing_that_no_control_reads_is_refused(rules: dict[str, str], words: str, tmp_path: Path) -> None:
    """(5.4) With the key, before a byte leaves; letters were sent as they stood."""
    (tmp_path / "part.mpf").write_bytes(PROGRAM)
    with pytest.raises(SettingsRejected, match=words):
        load_tape(tmp_path / "part.mpf", profile.Tape(**rules), tmp_path, 7)


def test_text_follows_an_escape() -> None:
    """(5.4) The longest known name counts."""
    assert escaped_bytes("leader", r"%\LFO1234\LF100\NUL*2") == b"%\nO1234\n100\0\0"


def test_lines_are_those_of_the_file(tmp_path: Path) -> None:
    """(5.7) Whatever the leader holds; the sentence of doubt named a line three further on."""
    with closing(tape_of(tmp_path, PROGRAM, leader=r"\CR\LF\LF\LF")) as tape:
        assert tape.lines.line_at(tape, 0) == 1
        assert tape.lines.line_at(tape, tape.leader_bytes) == 1
        assert tape.lines.offset_of(tape, 1) == tape.leader_bytes
        second = tape.leader_bytes + PROGRAM.index(b"\n") + 1
        assert (tape.lines.line_at(tape, second), tape.lines.offset_of(tape, 2)) == (2, second)


@pytest.mark.parametrize(
    ("data", "line", "column", "words"),
    [
        (b"G1 X1\nG1 X2 ;\x13 stop\n", 2, 8, "DC3"),
        (b"G1 X1\r\nG0\x00\r\n", 2, 3, "NUL"),
        (b"\xef\xbb\xbfG1\n", 1, 1, "byte order mark"),
        (b"\xff\xfeG\x001\x00", 1, 1, "UTF-16"),
        (b"G1\n;\xc3\xa9\n", 2, 2, "not ASCII"),
        (b"G1\rG2\rG3\x1b\r", 3, 3, "ESC"),
    ],
)
def test_bytes_that_act_on_the_line_are_refused(
    tmp_path: Path, data: bytes, line: int, column: int, words: str
) -> None:
    """(5.6; faults P3, P4, P5)"""
    with pytest.raises(InputRejected, match=words) as refused:
        tape_of(tmp_path, data)
    assert (refused.value.line, refused.value.column) == (line, column)


def test_a_refusal_far_into_the_file_has_the_right_place(tmp_path: Path) -> None:
    data = b"G1 X1.000\n" * 50_000 + b"G1 \x07\n"
    with pytest.raises(InputRejected) as refused:
        tape_of(tmp_path, data)
    assert (refused.value.line, refused.value.column) == (50_001, 4)


def test_iso_set_refuses_lower_case(tmp_path: Path) -> None:
    """(5.6)"""
    with pytest.raises(InputRejected, match="'g' is not in the control's set iso"):
        tape_of(tmp_path, b"G1\ng1\n", character_set="iso")


def test_what_is_no_program(tmp_path: Path) -> None:
    """(fault P6) Empty file, directory, FIFO, absent file, endless line: one sentence each, nothing waits."""
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "empty").touch()
    for name, words in [("fifo", "FIFO"), ("empty", "empty"), (".", "directory"), ("none", "No such file")]:
        with pytest.raises(InputRejected, match=words):
            load_tape(tmp_path / name, profile.Tape(), tmp_path)
    with pytest.raises(InputRejected, match="a line of more than 4096 bytes"):
        tape_of(tmp_path, b"X" * 10_000_000)


@given(blocks=st.lists(st.binary(max_size=30).map(lambda raw: raw.hex().encode()), min_size=1, max_size=50))
def test_lines_and_offsets_agree(tmp_path_factory: pytest.TempPathFactory, blocks: list[bytes]) -> None:
    data = b"".join(block + b"\n" for block in blocks)
    tape = tape_of(tmp_path_factory.mktemp("tape"), data)
    offset = 0
    for number, block in enumerate(blocks, start=1):
        assert tape.lines.offset_of(tape, number) == offset
        assert tape.lines.line_at(tape, offset) == number
        assert tape.is_block_end(offset)
        offset += len(block) + 1
        assert tape.next_block_end(offset - 1) == offset
    tape.close()


def test_line_lookup_beyond_the_first_mark(tmp_path: Path) -> None:
    tape = tape_of(tmp_path, b"".join(b"N%d\n" % index for index in range(1, 200_001)))
    for line in (1, 1024, 1025, 1026, 99_999, 200_000):
        at = tape.lines.offset_of(tape, line)
        assert tape.peek(at, 20).split(b"\n")[0] == b"N%d" % line
        assert tape.lines.line_at(tape, at) == line


@pytest.mark.parametrize(
    ("data", "essential", "whole_from", "whole_to"),
    [
        (b"G1\nM30\n%\n", 7, 6, 8),
        (b"G1\nM30\n", 7, 6, 7),
        (b"G1\r\nM30\r\n%\r\n", 9, 8, 10),
        (b"G1\nM30", 6, 6, 6),
        (b"%\n", 2, 2, 2),
    ],
)
def test_where_the_program_really_ends(
    tmp_path: Path, data: bytes, essential: int, whole_from: int, whole_to: int
) -> None:
    """(5.4) The last block's end and the closing % leave together."""
    end = tape_of(tmp_path, data).end
    assert (end.essential_bytes, end.whole_from, end.whole_to) == (essential, whole_from, whole_to)


def test_a_file_that_changes_does_not_reach_the_line(tmp_path: Path) -> None:
    """(5.6; faults P1, P2)"""
    data = b"G1 X1\n" * 1000
    tape = tape_of(tmp_path, data)
    (tmp_path / "part.mpf").write_bytes(b"G1 X9\n")
    (tmp_path / "part.mpf").unlink()
    assert whole(tape) == data


def test_disk_full_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.6) A spool that cannot grow ends before anything is sent, and leaves no descriptor open."""
    monkeypatch.setattr(spool, "_MEMORY_BYTES", 0)
    before = len(list(Path("/proc/self/fd").iterdir()))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    (tmp_path / "part.mpf").write_bytes(b"G1 X1\n" * 100_000)
    old = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (65536, hard))
    try:
        with pytest.raises(SettingsRejected, match="cannot be copied"):
            load_tape(tmp_path / "part.mpf", profile.Tape(), tmp_path / "spool")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, old)
    assert len(list(Path("/proc/self/fd").iterdir())) == before


@pytest.mark.soak
def test_a_gigabyte_takes_constant_memory(tmp_path: Path) -> None:
    """(5.6) 1 GB spooled and hashed within 60 MB of resident memory."""
    block = b"N10 G1 X123.456 Y123.456 Z-12.345\n" * 30_000
    path = tmp_path / "big.mpf"
    with path.open("wb") as file:
        for _ in range(1 + 10**9 // len(block)):
            file.write(block)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    tape = load_tape(path, profile.Tape(), tmp_path / "spool")
    assert tape.size_bytes >= 10**9
    assert tape.lines.line_at(tape, tape.size_bytes - 1) == tape.lines.count
    tape.close()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 60_000


def test_a_place_beyond_the_tape_is_its_last_line(tmp_path: Path) -> None:
    """(5.7) A journal's bound may lie there; with a block end of two bytes and a trailer the search never ended."""
    tape = tape_of(tmp_path, b"G1 X1\nM30\n", end_of_block="crlf", trailer="%")
    assert tape.lines.line_at(tape, tape.size_bytes + 5000) == tape.lines.line_at(tape, tape.size_bytes) == 3
    tape.close()
