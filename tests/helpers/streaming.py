"""A stream in a thread over a real pty, for the tests of the loop."""

from __future__ import annotations

import os
import pty
import threading
import time
import tty
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from dnc.events import Event, JobState
from dnc.pacing import Pace
from dnc.port import SerialPort
from dnc.profile import Link
from dnc.stream import Command, Stream
from tests.helpers.line import NoJournal, sender_of, tape_of

FAST = Pace(byte_s=20e-6, inflight_max_bytes=64, lag_s=0.0, slack=0.0)
PROGRAM = b"".join(b"N%d G1 X%d\n" % (index * 10, index) for index in range(1, 401)) + b"M30\n%\n"


@dataclass
class Cable:
    """A pty: the control's end, and ours held open as a plugged adapter does."""

    master: int
    slave: int
    name: str
    is_plugged: bool = True

    def read_all(self, count: int, timeout_s: float = 20.0) -> bytes:
        data, end_s = b"", time.monotonic() + timeout_s
        while len(data) < count and time.monotonic() < end_s:
            data += os.read(self.master, 65536)
        return data

    def unplug(self) -> None:
        if self.is_plugged:
            self.is_plugged = False
            os.close(self.slave)
            os.close(self.master)


def plugged() -> Iterator[Cable]:
    """A cable for one test; a fixture yields from it."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    cable = Cable(master, slave, os.ttyname(slave))
    yield cable
    cable.unplug()


class Running:
    """A stream in a thread, its events collected."""

    def __init__(self, tmp_path: Path, cable: Cable, pace: Pace = FAST, data: bytes = PROGRAM, **rules: object) -> None:
        self.port = SerialPort(cable.name, Link())
        self.sender = sender_of(tape_of(tmp_path, data), pace, **rules)
        self.events: list[Event] = []
        self.changed = threading.Condition()
        self.stream = Stream(self.sender, self.port, NoJournal(), self._add)  # type: ignore[arg-type]
        self.thread = threading.Thread(target=self.stream.run)

    def _add(self, event: Event) -> None:
        with self.changed:
            self.events.append(event)
            self.changed.notify_all()

    def wait_for(self, state: JobState) -> None:
        with self.changed:
            assert self.changed.wait_for(lambda: self.sender.state is state, 10), self.sender.state

    def is_stuck(self) -> bool:
        """Wait until nothing has left for a while."""
        end_s = time.monotonic() + 10
        while time.monotonic() < end_s:
            before = self.sender.offset_bytes
            threading.Event().wait(0.1)
            if before == self.sender.offset_bytes > 0:
                return True
        return False

    def __enter__(self) -> Self:
        self.thread.start()
        return self

    def __exit__(self, *_exc: object) -> None:
        self.stream.command(Command.ABORT)
        self.thread.join(10)
        self.port.close()
        self.stream.close()
        assert not self.thread.is_alive()
