"""Whether the line can carry the program: bytes that the blocks of any 2 s need, at 100 and at 120 % override.

Times are lengths over feeds, rapids at the speed of their slowest axis: the shortest a machine could take, so the
figures err on the safe side. A dwell or a stop lets the line catch up.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dnc.check.finding import Finding, Severity
from dnc.check.limits import Limits
from dnc.pacing import bits_per_byte
from dnc.profile import Link
from sim.interpreter import canon

WINDOW_S = 2.0
Numbers = NDArray[np.int64]
_NS = 1e9
_FEW = 256
_MOST_SIZES = 10_000


def line_bytes_s(link: Link) -> float:
    """Bytes per second that the line carries.

    >>> line_bytes_s(Link(baud=9600, format="7E2"))
    872.7272727272727
    """
    return link.baud / bits_per_byte(link.format)


@dataclass(slots=True)
class RateWindow:
    """The worst window of 2 s at one override: most bytes a second, and where it began.

    Times are whole nanoseconds at 100 %, so that sums are exact whichever way they are made.
    """

    override: float
    worst_bytes_s: float = 0.0
    worst_line: int = 0
    _blocks: deque[tuple[int, int, int]] = field(default_factory=deque)
    _time_ns: int = 0
    _bytes: int = 0
    _waiting_bytes: int = 0

    @property
    def _least_ns(self) -> int:
        return round(WINDOW_S * self.override * _NS)

    def add(self, time_ns: int, size_bytes: int, line: int) -> None:
        """One block: its machining time, its size on the line; what takes no time counts with the next."""
        self._waiting_bytes += size_bytes
        if time_ns <= 0:
            return
        size_bytes, self._waiting_bytes = self._waiting_bytes, 0
        self._blocks.append((time_ns, size_bytes, line))
        self._time_ns += time_ns
        self._bytes += size_bytes
        while self._time_ns - self._blocks[0][0] >= self._least_ns:
            gone_ns, gone_bytes, _ = self._blocks.popleft()
            self._time_ns -= gone_ns
            self._bytes -= gone_bytes
        if self._time_ns >= self._least_ns:
            self._compare(self._bytes / self._time_ns, self._blocks[0][2])

    def add_many(self, times_ns: Numbers, sizes_bytes: Numbers, lines: Numbers) -> None:
        """Blocks in a row, as so many calls of `add`."""
        if len(times_ns) < _FEW or not times_ns.all():
            for time_ns, size_bytes, line in zip(times_ns.tolist(), sizes_bytes.tolist(), lines.tolist(), strict=True):
                self.add(time_ns, size_bytes, line)
            return
        old = len(self._blocks)
        held = np.array(self._blocks, dtype=np.int64).reshape(old, 3)
        blocks = np.vstack([held, np.column_stack([times_ns, sizes_bytes, lines])])
        blocks[old, 1] += self._waiting_bytes
        self._waiting_bytes = 0
        sums = np.zeros((len(blocks) + 1, 2), dtype=np.int64)
        np.cumsum(blocks[:, :2], axis=0, out=sums[1:])
        ends = sums[old + 1 :]
        firsts = np.maximum(np.searchsorted(sums[:, 0], ends[:, 0] - self._least_ns, side="right") - 1, 0)
        spans = ends - sums[firsts]
        rates = np.where(spans[:, 0] >= self._least_ns, spans[:, 1] / spans[:, 0], 0.0)
        worst = int(rates.argmax())
        self._compare(float(rates[worst]), int(blocks[firsts[worst], 2]))
        first = int(firsts[-1])
        self._blocks = deque((time_ns, size_bytes, line) for time_ns, size_bytes, line in blocks[first:].tolist())
        self._time_ns, self._bytes = (int(total) for total in sums[-1] - sums[first])

    def _compare(self, bytes_ns: float, line: int) -> None:
        bytes_s = bytes_ns * _NS * self.override
        if bytes_s > self.worst_bytes_s:
            self.worst_bytes_s, self.worst_line = bytes_s, line


class LineSizes:
    """The bytes of lines until a command of their block or a later one comes."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[int, int]] = deque()

    def note(self, line: int, size_bytes: int) -> None:
        """Remember the size of a line; of very many the oldest are added up."""
        self._waiting.append((line, size_bytes))
        if len(self._waiting) > _MOST_SIZES:
            _, oldest_bytes = self._waiting.popleft()
            line, size_bytes = self._waiting.popleft()
            self._waiting.appendleft((line, size_bytes + oldest_bytes))

    def up_to(self, line: int) -> int:
        """The bytes of the lines up to this one since the last call."""
        size_bytes = 0
        while self._waiting and self._waiting[0][0] <= line:
            size_bytes += self._waiting.popleft()[1]
        return size_bytes


def whole_ns(time_s: float) -> int:
    """A time in nanoseconds."""
    return round(time_s * _NS)


def run_times_ns(lengths_mm: NDArray[np.float64], feeds_mm_min: NDArray[np.float64]) -> Numbers:
    """The least times of straight cuts, nanoseconds."""
    return np.rint(60.0 * lengths_mm / feeds_mm_min * _NS).astype(np.int64)


def move_time_s(command: canon.Command, limits: Limits, length_mm: float) -> float:
    """The least time a command can take; `length_mm` is that of a feed move."""
    match command:
        case canon.Rapid():
            axes = limits.profile.axes
            ways = zip("XYZ", command.start, command.end, strict=True)
            return max(60.0 * abs(end - start) / axes[name].rapid_mm_min for name, start, end in ways)  # type: ignore[index]
        case canon.Line() | canon.Arc() | canon.Polynomial():
            return 60.0 * length_mm / command.feed_mm_min
        case canon.Dwell(time_s=time_s):
            return time_s
        case _:
            return 0.0


def rate_findings(windows: tuple[RateWindow, ...], limits: Limits) -> Iterator[Finding]:
    """What the worst windows say about the line of the profile."""
    link = limits.profile.link
    capacity = line_bytes_s(link)
    for window in windows:
        if window.worst_bytes_s > capacity:
            share = 100.0 * capacity * window.override / window.worst_bytes_s
            yield Finding(
                "line-too-slow",
                Severity.WARNING,
                window.worst_line,
                1,
                f"at {window.override:.0%} override the blocks from here need {window.worst_bytes_s:.0f} bytes/s, "
                f"the line at {link.baud} baud carries {capacity:.0f}",
                "once its buffer is empty the machine stops between blocks and may leave marks",
                f"keep the override below {share:.0f} %, or raise the baud rate",
            )
            return
