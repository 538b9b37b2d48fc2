"""Where the blocks of a program come from: received one at a time, or a whole file that can be read anywhere."""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_right
from mmap import mmap

Data = bytes | mmap


class Source(ABC):
    """Lines by index from 0."""

    @abstractmethod
    def text(self, index: int) -> bytes | None:
        """The line without its LF, or None where it has not come yet, is no longer held, or the program has ended."""

    def line(self, index: int) -> int:
        """The physical line of this index, from 1."""
        return index + 1


class Received(Source):
    """Lines as they come; a drip-fed control holds none of those it has executed."""

    def __init__(self, *, is_kept: bool) -> None:
        self.is_kept = is_kept
        self._texts: list[bytes] = []
        self._lines: list[int] = []
        self._dropped = 0

    def add(self, raw: bytes, line: int) -> None:
        """The next line."""
        if not self.is_kept:
            self.skip(0)
        self._texts.append(raw)
        self._lines.append(line)

    def skip(self, count: int) -> None:
        """Let go of the lines held, and of the next `count`, which never come here."""
        self._dropped += len(self._texts) + count
        self._texts.clear()
        self._lines.clear()

    def text(self, index: int) -> bytes | None:
        """See Source."""
        place = index - self._dropped
        return self._texts[place] if 0 <= place < len(self._texts) else None

    def line(self, index: int) -> int:
        """The line number that came with the line."""
        place = index - self._dropped
        return self._lines[place] if 0 <= place < len(self._lines) else index + 1


class Whole(Source):
    """A program that is all there. Reading on costs nothing; going elsewhere walks from the nearest remembered line."""

    _STRIDE = 1024

    def __init__(self, data: Data) -> None:
        self._data = data
        self._marks: list[tuple[int, int]] = [(0, 0)]
        self._index, self._start = 0, 0

    def text(self, index: int) -> bytes | None:
        """See Source."""
        start = self.offset(index)
        if start is None:
            return None
        stop = self._data.find(b"\n", start)
        return self._data[start:] if stop < 0 else self._data[start:stop]

    def offset(self, index: int) -> int | None:
        """The byte where a line starts, or None beyond the end."""
        if index < 0:
            return None
        if index < self._index:
            self._index, self._start = self._marks[bisect_right(self._marks, (index, len(self._data))) - 1]
        while self._index < index:
            stop = self._data.find(b"\n", self._start)
            if stop < 0:
                return None
            self.place(self._index + 1, stop + 1)
        return self._start if self._start < len(self._data) else None

    def place(self, index: int, start: int) -> None:
        """Line `index` is known to start at this byte."""
        self._index, self._start = index, start
        if index >= self._marks[-1][0] + self._STRIDE:
            self._marks.append((index, start))
