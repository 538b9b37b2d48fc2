"""The tape: framing, block ends, refusals with line and column, line look-up (5.4, 5.6)."""

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
from dnc.block_ends import Ends, normalised
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


@pytest.mark.parametrize(
    ("name", "end"),
    [("lf", b"\n"), ("cr", b"\r"), ("crlf", b"\r\n"), ("lfcr", b"\n\r"), ("lfcrcr", b"\n\r\r"), (r";\LF", b";\n")],
)
def test_every_block_end(tmp_path: Path, name: str, end: bytes) -> None:
    """(5.4; fault P5) Mixed ends of the file become the control's end."""
    ends = [b"\n", b"\r\n", b"\n"]
    blocks = [b"G1 X%d" % index for index in range(20_000)]
    data = b"".join(block + ends[index % 3] for index, block in enumerate(blocks))
    tape = tape_of(tmp_path, data, end_of_block=name)
    assert whole(tape) == b"".join(block + end for block in blocks)
    assert tape.lines.count == 20_000


@pytest.mark.parametrize("shift", [0, 1, 2])
def test_a_block_end_on_the_border_of_a_chunk(tmp_path: Path, shift: int) -> None:
    """(5.4; fault P5) CR before the border and LF behind it are one block end."""
    blocks = [b"X" * (1022 + shift), *[b"G" * 1022] * 130]
    tape = tape_of(tmp_path, b"".join(block + b"\r\n" for block in blocks), end_of_block="lfcr")
    assert whole(tape) == b"".join(block + b"\n\r" for block in blocks)


@given(runs=st.lists(st.text("\r\nX", max_size=9), max_size=12))
def test_block_ends_are_the_same_wherever_chunks_are_cut(runs: list[str]) -> None:
    """(5.4, 5.6) One LF, whatever CR stands about it, is one end; only a CR alone is another."""
    chunks = [run.encode() for run in runs]
    whole_text = b"".join(chunks)
    together = b"".join(normalised(iter([whole_text]), b";\n"))
    assert b"".join(normalised(iter(chunks), b";\n")) == together
    assert together.count(b"\n") >= whole_text.count(b"\n")
    assert together.replace(b";\n", b"") == whole_text.translate(None, b"\r\n")
    ends = Ends(None)
    for chunk in chunks:
        ends.feed(chunk)
    single = Ends(None)
    single.feed(whole_text)
    assert (ends.common, ends.is_closed) == (single.common, single.is_closed)


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


@pytest.mark.parametrize(
    ("data", "block_end"),
    [
        (b"%\r\nN10\nN20\nM30\n", b"\n"),
        (b"%\r\nN10\r\nM30\r\n", b"\r\n"),
        (b"%\rN10\rM30\r", b"\r"),
        (b"%\nN10\r\nM30", b"\n"),
        (b"N" * 65535 + b"\r" + b"\nM30\r\n", b"\r\n"),
        (b"%\n\rN10\n\r\n\rM30\n\r", b"\n\r"),
        (b"%\n\rN10\n\rM30\n", b"\n\r"),
        (b"%\n\r\rN10\n\r\rM30\n\r\r%", b"\n\r\r"),
        (b"%\n\r\rN10\n\rM30\n\r\r%", b"\n\r"),
        (b"%\n\rN10\nM30\n\r", b"\n"),
        (b"N" * 65535 + b"\n" + b"\r\rM30\n\r\r", b"\n\r\r"),
        (b"N" * 65534 + b"\n\r" + b"\rM30\n\r\r", b"\n\r\r"),
    ],
    ids=[
        *("mixed", "CR LF", "CR", "LF first", "torn by a chunk", "LF CR", "LF CR, cut off", "LF CR CR"),
        *("LF CR and LF CR CR", "LF CR and LF", "LF CR CR torn", "LF CR CR torn later"),
    ],
)
def test_as_is_a_block_ends_where_every_block_does(data: bytes, block_end: bytes, tmp_path: Path) -> None:
    """(5.4, 5.7; fault C5) One CR LF at the head of an LF file: a pause had no place before the last byte."""
    with closing(tape_of(tmp_path, data, line_max_bytes=100_000)) as tape:
        assert (tape.block_end, tape.peek(0, len(data) + 1)) == (block_end, data)


@pytest.mark.parametrize(
    ("data", "trailer", "wire"),
    [
        (b"N10\r\nM30", "%", b"N10\r\nM30\r\n%"),
        (b"N10\nM30\n", "%", b"N10\nM30\n%"),
        (b"N10\nM30", r"\LF%", b"N10\nM30\n%"),
        (b"N10\nM30", "", b"N10\nM30"),
        (b"N10\n\rM30", "%", b"N10\n\rM30\n\r%"),
    ],
)
def test_a_trailer_is_no_part_of_the_last_block(data: bytes, trailer: str, wire: bytes, tmp_path: Path) -> None:
    """(5.4) `M30%` is another word than `M30`."""
    with closing(tape_of(tmp_path, data, trailer=trailer)) as tape:
        assert tape.peek(0, 100) == wire


@pytest.mark.parametrize("last", ["", "\n"])
@pytest.mark.parametrize(
    ("end", "trailer", "wire"),
    [
        (r"\LF\NUL", "%", b"N10\n\0M30\n\0%"),
        ("crlf", r"\LF%", b"N10\r\nM30\r\n\n%"),
        (r";\LF", "%", b"N10;\nM30;\n%"),
    ],
)
def test_one_block_end_before_a_trailer(end: str, trailer: str, wire: bytes, last: str, tmp_path: Path) -> None:
    """(5.4) The control's own end, once: one that closes with NUL stood twice, and LF alone stood for CR LF."""
    with closing(tape_of(tmp_path, b"N10\nM30" + last.encode(), end_of_block=end, trailer=trailer)) as tape:
        assert tape.peek(0, 100) == wire


@pytest.mark.parametrize("end", ["as-is", "lf", "cr", "crlf", "lfcr", "lfcrcr", r"\CR\CR", r"\LF\LF", r";\CR\LF"])
@pytest.mark.parametrize("blank", [1, 3])
def test_lines_are_found_whatever_ends_a_block(end: str, blank: int, tmp_path: Path) -> None:
    """(5.4, 5.7) The line in doubt and its text, behind many chunks too; a doubled end counted every line twice."""
    data = b"".join(b"N%d G1\n" % line + b"\n" * (blank - 1) for line in range(1, 30_000, blank))
    with closing(tape_of(tmp_path, data, end_of_block=end)) as tape:
        assert tape.lines.count == data.count(b"\n")
        for line in (1, 1021, 1024, 1025, 1027, 16_387, 29_998):
            block = (line - 1) // blank * blank + 1
            at = tape.lines.offset_of(tape, block)
            assert tape.peek(at, 20).startswith(b"N%d G1" % block)
            assert tape.is_block_end(at)
            assert tape.lines.line_at(tape, at) == tape.lines.line_at(tape, at + 4) == block
            assert tape.next_block_end(at) == tape.lines.offset_of(tape, block + 1)
        assert tape.lines.offset_of(tape, 40_000) == tape.size_bytes


def test_a_long_run_of_empty_lines_takes_constant_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.6) What is kept for the next chunk is at most the start of one end."""
    seen: list[int] = []
    monkeypatch.setattr(spool.LineIndex, "feed", lambda _lines, chunk: seen.append(len(chunk)))
    data = b"N10\n" + b"\n\r" * 200_000 + b"\r\n" * 200_000 + b"M30\n"
    with closing(tape_of(tmp_path, data, end_of_block="lf")) as tape:
        assert tape.size_bytes == 4 + 400_000 + 4
        assert max(seen) <= 65536


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
