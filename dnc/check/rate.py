"""Whether the line can carry the program: bytes that the blocks of any 2 s need, at 100 and at 120 % override.

Times are lengths over feeds, rapids at the speed of their slowest axis: the shortest a machine could take, so the
figures err on the safe side. A dwell or a stop lets the line catch up.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

from dnc.check.finding import Finding, Severity
from dnc.check.track import Limits, length
from dnc.profile import Link
from sim.interpreter import canon

WINDOW_S = 2.0


def line_bytes_s(link: Link) -> float:
    """Bytes per second that the line carries: start, data, parity and stop bits.

    >>> line_bytes_s(Link(baud=9600, format="7E2"))
    872.7272727272727
    """
    parity = 0 if link.format[1] == "N" else 1
    return link.baud / (1 + int(link.format[0]) + parity + float(link.format[2:]))


@dataclass(slots=True)
class RateWindow:
    """The worst window of 2 s at one override: most bytes a second, and where it began."""

    override: float
    worst_bytes_s: float = 0.0
    worst_line: int = 0
    _blocks: deque[tuple[float, int, int]] = field(default_factory=deque)
    _time_s: float = 0.0
    _bytes: int = 0
    _waiting_bytes: int = 0

    def add(self, time_s: float, size_bytes: int, line: int) -> None:
        """One block: its machining time at 100 %, its size on the line; what takes no time counts with the next."""
        self._waiting_bytes += size_bytes
        if time_s <= 0.0:
            return
        size_bytes, self._waiting_bytes = self._waiting_bytes, 0
        scaled_s = time_s / self.override
        self._blocks.append((scaled_s, size_bytes, line))
        self._time_s += scaled_s
        self._bytes += size_bytes
        while self._time_s - self._blocks[0][0] >= WINDOW_S:
            gone_s, gone_bytes, _ = self._blocks.popleft()
            self._time_s -= gone_s
            self._bytes -= gone_bytes
        if self._time_s >= WINDOW_S and self._bytes / self._time_s > self.worst_bytes_s:
            self.worst_bytes_s, self.worst_line = self._bytes / self._time_s, self._blocks[0][2]


def move_time_s(command: canon.Command, limits: Limits) -> float:
    """The least time a command can take."""
    match command:
        case canon.Rapid():
            axes = limits.profile.axes
            ways = zip("XYZ", command.start, command.end, strict=True)
            return max(60.0 * abs(end - start) / axes[name].rapid_mm_min for name, start, end in ways)  # type: ignore[index]
        case canon.Line() | canon.Arc() | canon.Polynomial():
            return 60.0 * length(command) / command.feed_mm_min
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
