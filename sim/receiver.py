"""The receive buffer of the control: a ring that says DC3 when it fills, DC1 when it has drained, and counts losses.

I/O-free. What the control says goes out through the `say` it is given, which returns when the byte begins to leave;
from that moment on, every byte that still reaches the control is overshoot of this cycle.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from sim.line import Run

Say = Callable[["Word", float], float]


class Word(Enum):
    """What a receiver can say."""

    XON = "XON"
    XOFF = "XOFF"


@dataclass(frozen=True, slots=True)
class Marks:
    """Size of the ring; DC3 goes out when only `xoff_free_bytes` are free, DC1 at `xon_fill_bytes` or less."""

    size_bytes: int
    xoff_free_bytes: int
    xon_fill_bytes: int

    @property
    def xoff_fill_bytes(self) -> int:
        """The fill at which DC3 goes out."""
        return max(1, self.size_bytes - self.xoff_free_bytes)


@dataclass(frozen=True, slots=True)
class Cycle:
    """One stop: when DC3 began to leave, bytes that arrived after that, bytes lost in it, when DC1 was said.

    `utilisation` is that of the run before it: its `run_bytes` over what the line could carry from the moment the host
    had DC1 until it had DC3, or until the last byte arrived if that was later; None for a run that no DC1 began.
    """

    xoff_s: float
    overshoot_bytes: int
    overrun_bytes: int
    xon_s: float
    run_bytes: int
    utilisation: float | None


class Receiver:
    """The ring. It keeps counts; the bytes it accepted wait in `accepted` until they are fetched."""

    def __init__(self, marks: Marks, say: Say) -> None:
        self.marks = marks
        self._say = say
        self._accepted = bytearray()
        self.fill_bytes = 0
        self.received_bytes = 0
        self.overrun_bytes = 0
        self.xoff_sent = 0
        self.cycles: list[Cycle] = []
        self._xoff_s: float | None = None
        self._overshoot_bytes = 0
        self._overrun_before = 0
        self._run_from_s: float | None = None
        self._run_until_s = 0.0
        self._run_bytes = 0
        self._byte_time_s = 0.0

    @property
    def is_held(self) -> bool:
        """The last word was DC3."""
        return self._xoff_s is not None

    @property
    def overshoot_bytes(self) -> int:
        """Overshoot of the stop that lasts now."""
        return self._overshoot_bytes

    @property
    def until_xoff_bytes(self) -> int:
        """How many bytes may still arrive before DC3 is said; at least 1."""
        return max(1, self.marks.xoff_fill_bytes - self.fill_bytes)

    def arrive(self, run: Run) -> None:
        """Bytes reached the control."""
        self._run_bytes += len(run.data)
        self._run_until_s, self._byte_time_s = run.last_s, run.byte_time_s
        while run.data:
            if self._xoff_s is not None:
                self._overshoot_bytes += run.count_after(self._xoff_s)
                self._accept(run.data)
                return
            part, run = run.split(self.until_xoff_bytes)
            self._accept(part.data)
            if self.fill_bytes >= self.marks.xoff_fill_bytes:
                self.hold(part.last_s)

    def take(self, count: int, now_s: float) -> None:
        """The control has read this many bytes out of the ring."""
        self.fill_bytes = max(0, self.fill_bytes - count)  # a reset forgets the ring while reads are on their way
        if self.is_held and self.fill_bytes <= self.marks.xon_fill_bytes:
            self.release(now_s)

    def hold(self, now_s: float) -> None:
        """Say DC3, whatever the fill is."""
        self.xoff_sent += 1
        self._overshoot_bytes, self._overrun_before = 0, self.overrun_bytes
        self._xoff_s = self._say(Word.XOFF, now_s)

    def release(self, now_s: float) -> None:
        """Say DC1 and close the cycle."""
        self._close_cycle(now_s)
        begin_s = self._say(Word.XON, now_s)
        self._run_from_s = begin_s + self._byte_time_s if math.isfinite(begin_s) else None
        self._run_bytes = 0

    def clear(self, now_s: float) -> None:
        """Forget what the ring holds (reset, power cycle), and say nothing."""
        self._close_cycle(now_s)
        self.fill_bytes = 0
        self._accepted.clear()

    def fetch(self) -> bytes:
        """The bytes accepted since the last call."""
        data = bytes(self._accepted)
        self._accepted.clear()
        return data

    def _close_cycle(self, now_s: float) -> None:
        if self._xoff_s is not None and math.isfinite(self._xoff_s):
            lost = self.overrun_bytes - self._overrun_before
            used = self._utilisation(self._xoff_s)
            self.cycles.append(Cycle(self._xoff_s, self._overshoot_bytes, lost, now_s, self._run_bytes, used))
        self._xoff_s = self._run_from_s = None

    def _utilisation(self, xoff_s: float) -> float | None:
        if self._run_from_s is None:
            return None
        run_s = max(xoff_s + self._byte_time_s, self._run_until_s) - self._run_from_s
        return self._run_bytes * self._byte_time_s / run_s if run_s > 0 else None

    def _accept(self, data: bytes) -> None:
        free = self.marks.size_bytes - self.fill_bytes
        kept = data[:free] if len(data) > free else data
        self.overrun_bytes += len(data) - len(kept)
        self.received_bytes += len(kept)
        self.fill_bytes += len(kept)
        self._accepted += kept
