"""What this computer costs the line: the quickest answer through a pseudo-terminal, and the processor's share.

The quickest answer bounds what any sender can reach. A bare loop (select, read, write; real-time priority, never asleep
for more than 1 ms) hears one byte and writes one; no flow control could do it with less. It is asked after a silence as
long as a hold.
"""

from __future__ import annotations

import contextlib
import os
import select
import statistics
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path

SILENCE_S = 0.05
NAP_S = 0.001
_XON = b"\x11"


def quickest_answer_s(times: int = 60) -> float:
    """Median time from one byte written at the mill's end to the answer read there, both ends a bare loop."""
    master, slave = os.openpty()
    tty.setraw(slave)
    child = os.fork()
    if child == 0:
        os.close(master)
        _answer(slave)
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    _hurry()
    took_s = []
    for _ in range(times):
        time.sleep(SILENCE_S)
        begun_s = time.monotonic()
        os.write(master, _XON)
        select.select([master], [], [])
        os.read(master, 16)
        took_s.append(time.monotonic() - begun_s)
    os.sched_setscheduler(0, *before)
    os.close(slave)
    os.close(master)
    os.waitpid(child, 0)
    return statistics.median(took_s)


def bare_loop_share(writes_per_s: float, seconds: float = 6.0) -> float:
    """Share of a processor that a loop takes which only selects with a time-out and writes, so many times a second."""
    with endless_control() as pty:
        child = os.fork()
        if child == 0:
            _write_on(pty, 1.0 / writes_per_s, seconds)
        _, _, used = os.wait4(child, 0)
    return (used.ru_utime + used.ru_stime) / seconds


@contextlib.contextmanager
def endless_control() -> Iterator[str]:
    """A pseudo-terminal whose other end takes everything and never stops us; gives its name."""
    master, slave = os.openpty()
    tty.setraw(slave)
    end = threading.Event()

    def swallow() -> None:
        while not end.wait(0.02):
            if select.select([master], [], [], 0)[0]:
                os.read(master, 1 << 16)

    thread = threading.Thread(target=swallow)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        end.set()
        thread.join()
        os.close(slave)
        os.close(master)


def cpu_s(pid: int) -> float:
    """CPU time of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _answer(slave: int) -> None:
    """The child's life: it ends when the terminal does."""
    _hurry()
    with contextlib.suppress(OSError):
        while True:
            if not select.select([slave], [], [], NAP_S)[0]:
                continue
            if not os.read(slave, 16):
                break
            os.write(slave, _XON)
    os._exit(0)


def _write_on(pty: str, period_s: float, seconds: float) -> None:
    """The life of the child that only writes."""
    port = os.open(pty, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    _hurry()
    due_s = time.monotonic()
    end_s = due_s + seconds
    while due_s < end_s:
        select.select([port], [], [], max(0.0, due_s - time.monotonic()))
        os.write(port, b"G1 X0.")
        due_s += period_s
    os._exit(0)


def _hurry() -> None:
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(20))
