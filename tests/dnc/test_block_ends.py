"""What ends a block, in the file and on the tape: found, replaced, counted (5.4, 5.6, 5.7)."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnc import spool
from dnc.block_ends import Ends, normalised
from tests.helpers.line import tape_of


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
    assert tape.peek(0, tape.size_bytes) == b"".join(block + end for block in blocks)
    assert tape.lines.count == 20_000


@pytest.mark.parametrize("shift", [0, 1, 2])
def test_a_block_end_on_the_border_of_a_chunk(tmp_path: Path, shift: int) -> None:
    """(5.4; fault P5) CR before the border and LF behind it are one block end."""
    blocks = [b"X" * (1022 + shift), *[b"G" * 1022] * 130]
    tape = tape_of(tmp_path, b"".join(block + b"\r\n" for block in blocks), end_of_block="lfcr")
    assert tape.peek(0, tape.size_bytes) == b"".join(block + b"\n\r" for block in blocks)


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
