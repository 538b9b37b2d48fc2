"""Time of the mill: machine seconds, which run `speed` times as fast as the clock on the wall; and being on time."""

from __future__ import annotations

import contextlib
import gc
import os
import time
from collections import deque
from collections.abc import Callable, Iterator


class MachineClock:
    """Machine time in seconds since the mill was switched on; the only place where it meets the monotonic clock."""

    def __init__(self, speed: float, begun_wall_s: float, monotonic: Callable[[], float] = time.monotonic) -> None:
        self.speed = speed
        self._begun_wall_s = begun_wall_s
        self._monotonic = monotonic

    def now_s(self) -> float:
        """Machine time now."""
        return (self._monotonic() - self._begun_wall_s) * self.speed

    def wall_s(self, machine_s: float) -> float:
        """The monotonic time at which machine time is `machine_s`."""
        return self._begun_wall_s + machine_s / self.speed


class HoldUps:
    """How long a process could not attend to its line, and when; monotonic times, stretches above `least_s` only."""

    def __init__(self, least_s: float) -> None:
        self.least_s = least_s
        self.worst_s = 0.0
        self._recent: deque[tuple[float, float]] = deque(maxlen=4096)

    def note(self, ended_s: float, lasted_s: float) -> None:
        """A stretch during which nobody looked at the line has ended."""
        if lasted_s > self.least_s:
            self.worst_s = max(self.worst_s, lasted_s)
            self._recent.append((ended_s, lasted_s))

    def worst_between(self, first_s: float, last_s: float) -> float:
        """The longest stretch that touched this interval; 0 if none did."""
        touching = (lasted for ended, lasted in self._recent if ended >= first_s and ended - lasted <= last_s)
        return max(touching, default=0.0)


@contextlib.contextmanager
def punctual(priority: int) -> Iterator[bool]:
    """Real-time priority where it is allowed (yields whether it is), and no garbage collection meanwhile."""
    is_real_time = True
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError:
        is_real_time = False
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield is_real_time
    finally:
        gc.enable()
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
