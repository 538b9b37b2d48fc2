"""One direction of the serial line under the byte clock: what was written, what is still in flight, what has arrived.

I/O-free. A byte that the host has handed over waits in the adapter's FIFO, is carried in one byte time, and has arrived
when its last stop bit has. Nothing here is fetched from a clock: every time is passed in, in machine seconds.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Run:
    """Bytes that follow each other without a gap; byte k (from 0) arrives at `first_s` + k `byte_time_s`."""

    first_s: float
    byte_time_s: float
    data: bytes

    @property
    def last_s(self) -> float:
        """When the last byte has arrived."""
        return self.first_s + (len(self.data) - 1) * self.byte_time_s

    def split(self, count: int) -> tuple[Run, Run]:
        """The first `count` bytes, and the others."""
        return (
            Run(self.first_s, self.byte_time_s, self.data[:count]),
            Run(self.first_s + count * self.byte_time_s, self.byte_time_s, self.data[count:]),
        )

    def count_after(self, time_s: float) -> int:
        """How many of the bytes arrive later than `time_s`."""
        size = len(self.data)  # the quotient is rounded, so that sums of times do not turn "at" into "after"
        if time_s < self.first_s:
            return size
        if time_s >= self.last_s:
            return 0
        return size - 1 - math.floor(round((time_s - self.first_s) / self.byte_time_s, 6))


class Line:
    """A FIFO of `fifo_bytes` and a shift register that carries one byte in each `byte_time_s`."""

    def __init__(self, byte_time_s: float, fifo_bytes: int) -> None:
        self.byte_time_s = byte_time_s
        self.fifo_bytes = fifo_bytes
        self._runs: deque[Run] = deque()
        self._waiting_bytes = 0
        self._free_s = -math.inf

    @property
    def waiting_bytes(self) -> int:
        """Bytes written and not yet arrived, as of the last `carried`."""
        return self._waiting_bytes

    @property
    def room_bytes(self) -> int:
        """Bytes the FIFO still takes; one more is in the shift register."""
        return self.fifo_bytes + 1 - self._waiting_bytes

    @property
    def next_arrival_s(self) -> float:
        """When the next byte arrives; infinite while the line is idle."""
        return self._runs[0].first_s if self._runs else math.inf

    @property
    def idle_from_s(self) -> float:
        """When the last byte written has arrived; minus infinity if there never was one."""
        return self._free_s

    def arrival_s(self, count: int) -> float:
        """When the byte number `count` (from 1) of those in flight arrives; infinite if there are fewer."""
        for run in self._runs:
            if count <= len(run.data):
                return run.first_s + (count - 1) * run.byte_time_s
            count -= len(run.data)
        return math.inf

    def write(self, data: bytes, now_s: float) -> float:
        """Hand over bytes; returns when the first of them begins to be sent."""
        begin_s = max(self._free_s, now_s)
        if not data:
            return begin_s
        self._free_s = begin_s + len(data) * self.byte_time_s
        self._waiting_bytes += len(data)
        self._runs.append(Run(begin_s + self.byte_time_s, self.byte_time_s, data))
        return begin_s

    def carried(self, until_s: float) -> list[Run]:
        """What has arrived by `until_s` and was not returned before."""
        arrived: list[Run] = []
        while self._runs and self._runs[0].first_s <= until_s:
            run = self._runs.popleft()
            late = run.count_after(until_s)
            if late:
                run, rest = run.split(len(run.data) - late)
                self._runs.appendleft(rest)
            self._waiting_bytes -= len(run.data)
            arrived.append(run)
            if late:
                break
        return arrived

    def drop(self) -> int:
        """Throw away what has not arrived (the line was cut); returns how many bytes."""
        lost, self._waiting_bytes = self._waiting_bytes, 0
        self._runs.clear()
        return lost
