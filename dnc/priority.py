"""What keeps the sending loop on time: priority and light sleep where allowed, exact timers, no garbage collection."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import struct
import sys
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

_PR_SET_TIMERSLACK = 29
_SWITCH_INTERVAL_S = 50e-6
_PRIORITY = 20
LATENCY_WISH = Path("/dev/cpu_dma_latency")
WAKES_WITHIN_US = 20
"""Shallow idle states wake within this; deep ones may take longer than bytes of a fast line."""


class Punctuality(NamedTuple):
    """What the system granted."""

    is_realtime: bool
    is_light_sleeper: bool


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
def on_time() -> Iterator[Punctuality]:
    """Inside, this thread is as punctual as the system allows; yields what it granted.

    Threads and processes started inside do not inherit the priority. Other threads of ours give the interpreter back
    within 50 us.
    """
    interval_s = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        with light_sleep(LATENCY_WISH) as is_light_sleeper, in_front() as is_realtime:
            yield Punctuality(is_realtime, is_light_sleeper)
    finally:
        gc.enable()
        gc.unfreeze()
        sys.setswitchinterval(interval_s)


@contextlib.contextmanager
def light_sleep(wish: Path) -> Iterator[bool]:
    """Inside, idle processors doze but do not sleep deeply; yields whether the system took the wish.

    The kernel's PM QoS interface: microseconds as a 32-bit integer, which count while the file is open.
    """
    with contextlib.ExitStack() as held:
        try:
            held.enter_context(wish.open("r+b", buffering=0)).write(struct.pack("=i", WAKES_WITHIN_US))
        except OSError:
            yield False
        else:
            yield True


def may_go_first() -> bool:
    """Whether the system lets this thread run before all that is not real time."""
    with in_front() as is_realtime:
        return is_realtime


@contextlib.contextmanager
def in_front() -> Iterator[bool]:
    """Inside, this thread runs before all that is not real time; yields whether that is so."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(_PRIORITY))
    except OSError:
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(1), 0, 0, 0)
        yield False
        return
    try:
        yield True
    finally:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, *before)
