"""What keeps the sending loop on time: real-time priority where allowed, exact timers, no garbage collection."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import sys
from collections import deque
from collections.abc import Iterator

_PR_SET_TIMERSLACK = 29
_SWITCH_INTERVAL_S = 50e-6
_PRIORITY = 20


class HoldUps:
    """How late the loop was, and when: stretches above `least_s` that end at these monotonic times."""

    def __init__(self, least_s: float, kept: int) -> None:
        self.least_s = least_s
        self.worst_s = 0.0
        self.recent: deque[tuple[float, float]] = deque(maxlen=kept)

    def note(self, ended_s: float, lasted_s: float) -> None:
        """The loop came this late."""
        if lasted_s > self.least_s:
            self.worst_s = max(self.worst_s, lasted_s)
            self.recent.append((ended_s, lasted_s))

    def worst_between(self, first_s: float, last_s: float) -> float:
        """The longest stretch that touches this interval; 0 if none does."""
        touching = (lasted for ended, lasted in self.recent if ended >= first_s and ended - lasted <= last_s)
        return max(touching, default=0.0)


@contextlib.contextmanager
def on_time() -> Iterator[bool]:
    """Inside, this thread is as punctual as the system allows; yields whether real-time priority was granted.

    Threads and processes started inside do not inherit the priority. Other threads of ours give the interpreter back
    within 50 us.
    """
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    interval_s = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    is_realtime = True
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(_PRIORITY))
    except OSError:
        is_realtime = False
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(1), 0, 0, 0)
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield is_realtime
    finally:
        gc.enable()
        gc.unfreeze()
        sys.setswitchinterval(interval_s)
        if is_realtime:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(0, *before)
