"""The tape: the exact bytes for the line, spooled, hashed and framed before the first one leaves.

The job never reads the program's own file again: a file that changes, a share that drops or a disk that fills cannot
reach the line. Memory is constant; a sparse index finds the line of any byte.
"""

from __future__ import annotations

import bisect
import contextlib
import os
from array import array
from dataclasses import dataclass

_CHUNK_BYTES = 1 << 16
_LINES_PER_MARK = 1024
_END_WINDOW_BYTES = 1 << 16


@dataclass(frozen=True, slots=True)
class TapeEnd:
    """Where the program really ends: `essential_bytes` covers the last block, the rest may stay untaken.

    The bytes from `whole_from` to `whole_to` (the last block's end up to the closing %) leave together, because a
    control may stop reading as soon as it has read M30.
    """

    essential_bytes: int
    whole_from: int
    whole_to: int


@dataclass(frozen=True, slots=True)
class Frame:
    """How many bytes surround the program, and what ends a block."""

    leader_bytes: int
    trailer_bytes: int
    block_end: bytes


@dataclass(frozen=True, slots=True)
class Traits:
    """What the program says of where execution may stand.

    `branch_at` is where the line of the first jump, branch or loop begins, None where the blocks run as they stand.
    """

    branch_at: int | None = None
    is_compensated: bool = False
    is_incremental: bool = False
    has_other_plane: bool = False


class LineIndex:
    """Offsets of every 1024th line start; `mark` is what ends a line: all of a block end that was put, else LF or CR.

    Lines are those of the program's own file: what the leader holds is none.
    """

    def __init__(self, mark: bytes, leader_bytes: int) -> None:
        self.mark = mark
        self.starts = array("Q", [leader_bytes])
        self.count = 0
        self.written_bytes = leader_bytes

    def feed(self, chunk: bytes) -> None:
        """Count the lines of the next bytes of the tape; a mark is never torn between two chunks."""
        found = chunk.count(self.mark)
        if (self.count + found) // _LINES_PER_MARK > self.count // _LINES_PER_MARK:
            self._mark_starts(chunk)
        self.count += found
        self.written_bytes += len(chunk)

    def _mark_starts(self, chunk: bytes) -> None:
        after, number = 0, self.count
        while (at := chunk.find(self.mark, after)) >= 0:
            number += 1
            after = at + len(self.mark)
            if number % _LINES_PER_MARK == 0:
                self.starts.append(self.written_bytes + after)

    def line_at(self, tape: Tape, offset: int) -> int:
        """The physical line, from 1, that holds this byte of the tape."""
        near = max(0, bisect.bisect_right(self.starts, offset) - 1)
        line, at = near * _LINES_PER_MARK + 1, self.starts[near]
        while at < offset:
            chunk = tape.peek(at, min(_CHUNK_BYTES, offset - at))
            line += chunk.count(self.mark)
            if at + len(chunk) >= min(offset, tape.size_bytes):
                break
            at += len(chunk) - self._torn_bytes(chunk)
        return line

    def offset_of(self, tape: Tape, line: int) -> int:
        """Where this physical line begins; the end of the tape for a line beyond it."""
        near = min(max(0, (line - 1) // _LINES_PER_MARK), len(self.starts) - 1)
        number, at = near * _LINES_PER_MARK + 1, self.starts[near]
        while number < line:
            chunk = tape.peek(at, _CHUNK_BYTES)
            if at + len(chunk) >= tape.size_bytes and number + chunk.count(self.mark) < line:
                return tape.size_bytes
            after = 0
            while number < line and (found := chunk.find(self.mark, after)) >= 0:
                number += 1
                after = found + len(self.mark)
            at += after if number == line else len(chunk) - self._torn_bytes(chunk)
        return at

    def _torn_bytes(self, chunk: bytes) -> int:
        """How many bytes at the end of a chunk are to be read again, because a mark may begin there."""
        return min(len(chunk.split(self.mark)[-1]), len(self.mark) - 1)


class Tape:
    """The spooled bytes: read anywhere, hashed, with line look-up; close it when the job is over."""

    def __init__(
        self,
        spool: int,
        sha256: str,
        program_sha256: str,
        lines: LineIndex,
        frame: Frame,
        traits: Traits,
    ) -> None:
        self._spool = spool
        self.sha256, self.program_sha256 = sha256, program_sha256
        self.size_bytes = os.fstat(spool).st_size
        self.leader_bytes = frame.leader_bytes
        self.trailer_from = self.size_bytes - frame.trailer_bytes
        self.block_end = frame.block_end
        self.lines, self.traits = lines, traits
        self.end = _tape_end(self, frame)
        self._cache, self._cache_at = b"", 0

    def read(self, offset: int, count: int) -> bytes:
        """Up to `count` bytes from here; the kernel reads ahead, so that the caller need not wait for the disk."""
        at = offset - self._cache_at
        if at < 0 or (at + count > len(self._cache) and self._cache_at + len(self._cache) < self.size_bytes):
            self._cache, self._cache_at, at = os.pread(self._spool, _CHUNK_BYTES, offset), offset, 0
            with contextlib.suppress(OSError):
                os.posix_fadvise(self._spool, offset + _CHUNK_BYTES, 4 * _CHUNK_BYTES, os.POSIX_FADV_WILLNEED)
        return self._cache[at : at + count]

    def peek(self, offset: int, count: int) -> bytes:
        """As `read`, without touching what the sending loop has at hand; safe from another thread."""
        return os.pread(self._spool, count, max(0, offset))

    def is_block_end(self, offset: int) -> bool:
        """Whether a block ended just before this byte; the start, the closing % and all of the trailer count."""
        if offset <= self.leader_bytes or offset == self.end.whole_to or offset >= self.trailer_from:
            return True
        size = len(self.block_end)
        return self.peek(offset - size, size) == self.block_end

    def next_block_end(self, offset: int) -> int:
        """The first byte after the block that holds this one; with the last block goes the closing %."""
        at = max(0, offset - len(self.block_end) + 1)
        while at < self.size_bytes:
            chunk = self.peek(at, _CHUNK_BYTES)
            found = chunk.find(self.block_end)
            if found >= 0:
                after = at + found + len(self.block_end)
                return self.end.whole_to if after == self.end.essential_bytes else after
            at += max(1, len(chunk) - len(self.block_end) + 1)
        return self.size_bytes

    def close(self) -> None:
        """Let go of the spool."""
        with contextlib.suppress(OSError):
            os.close(self._spool)


def _tape_end(tape: Tape, frame: Frame) -> TapeEnd:
    """Find the last block that is more than % and blanks, looking at the tape's last bytes only."""
    size = tape.size_bytes
    start = max(0, size - frame.trailer_bytes - _END_WINDOW_BYTES)
    window = tape.peek(start, size - start)
    body = window[: len(window) - frame.trailer_bytes] if frame.trailer_bytes else window
    last = len(body.rstrip(b"%\0 \t\r\n" + frame.block_end))
    block_end = body.find(frame.block_end, last)
    if last == 0 or block_end < 0:
        return TapeEnd(size, size, size)
    essential = start + block_end + len(frame.block_end)
    percent = window.find(b"%", block_end)
    whole_to = start + percent + 1 if percent >= 0 else essential
    return TapeEnd(essential, essential - 1, whole_to)
