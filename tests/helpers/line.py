"""A tape in memory, a sender under a clock that the test turns, and a peer process behind a pty."""

from __future__ import annotations

import hashlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Self

from dnc import profile
from dnc.events import Alarm, Event, JobState, StateChanged
from dnc.journal import UNBOUNDED
from dnc.pacing import ByteClock, Pace
from dnc.rules import Rules
from dnc.sender import Sender
from dnc.spool import load_tape
from dnc.tape import Tape

PACE = Pace(byte_s=0.001, inflight_max_bytes=3, lag_s=0.0, slack=0.0)
XON, XOFF = b"\x11", b"\x13"
PEER = Path(__file__).with_name("peer.py")


def read_until(fd: int, mark: bytes, within_s: float = 10.0) -> bytes:
    """What the far end of a pty says up to a mark, in however many pieces; what there was, if the mark never comes."""
    data, end_s = b"", time.monotonic() + within_s
    while not data.endswith(mark) and select.select([fd], [], [], max(0.0, end_s - time.monotonic()))[0]:
        data += os.read(fd, 4096)
    return data


def tape_of(folder: Path, data: bytes, **rules: object) -> Tape:
    path = folder / "part.mpf"
    path.write_bytes(data)
    return load_tape(path, profile.Tape(**rules), folder / "spool")  # type: ignore[arg-type]


def sender_of(tape: Tape, pace: Pace = PACE, **rules: object) -> Sender:
    return Sender(tape, ByteClock(pace), Rules(**rules))  # type: ignore[arg-type]


def drain(sender: Sender, now_s: float, until_s: float = 1e9, limit: int = 100_000) -> tuple[bytes, float]:
    """Take and tick as the stream does, at the moments the sender asks for; returns the bytes and the time."""
    out = b""
    for _ in range(limit):
        out += sender.take(1 << 30, now_s)
        sender.tick(now_s)
        wake_s = sender.next_wake_s
        if sender.is_over or wake_s > until_s:
            break
        now_s = max(now_s, wake_s) + 1e-9
    return out, now_s


class NoJournal:
    """Lets everything leave at once."""

    bound_bytes = UNBOUNDED
    problem = ""

    def note(self, sent_bytes: int, state: JobState) -> None:
        pass


def states(events: list[Event]) -> list[JobState]:
    return [event.new for event in events if isinstance(event, StateChanged)]


def alarm_ids(events: list[Event]) -> list[str]:
    return [event.id for event in events if isinstance(event, Alarm)]


RUNTIME_FOLDERS: set[Path] = set()
"""What `runtime_of` has made; a run removes it at its end."""


def runtime_of(folder: Path) -> Path:
    """A short folder for the sockets of this test: a socket's path holds 107 bytes."""
    runtime = Path(tempfile.gettempdir()) / f"dnc-{hashlib.sha256(str(folder).encode()).hexdigest()[:12]}"
    runtime.mkdir(exist_ok=True)
    RUNTIME_FOLDERS.add(runtime)
    return runtime


class PeerProcess:
    """tests/helpers/peer.py as a child; `report` waits for what it saw."""

    def __init__(self, **settings: object) -> None:
        words = [f"{key}={value}" for key, value in settings.items()]
        self._child = subprocess.Popen([sys.executable, str(PEER), *words], stdout=subprocess.PIPE)
        self.pty = str(self._line()["pty"])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self._child.terminate()
        self._child.wait(10)
        assert self._child.stdout is not None
        self._child.stdout.close()

    def report(self) -> dict[str, object]:
        return self._line()

    def say_first(self) -> None:
        self._child.send_signal(signal.SIGUSR1)

    def stop(self) -> dict[str, object]:
        self._child.terminate()
        return self._line()

    def _line(self) -> dict[str, object]:
        assert self._child.stdout is not None
        ready, _, _ = select.select([self._child.stdout], [], [], 30)
        assert ready, "the peer said nothing"
        values = json.loads(self._child.stdout.readline())
        assert isinstance(values, dict)
        return values


class SendProcess:
    """`dnc send` as a child with its own state folder; at a terminal if one is given. The report is in a file."""

    def __init__(self, folder: Path, program: Path, pty: str, *options: str, terminal: int | None = None) -> None:
        self._report = folder / "report.json"
        runtime = runtime_of(folder)
        environment = {**os.environ, "XDG_STATE_HOME": str(folder / "state"), "XDG_RUNTIME_DIR": str(runtime)}
        words = ["send", str(program), "--port", pty, "--report", str(self._report), *options]
        self.child = subprocess.Popen(
            [sys.executable, "-m", "dnc", *words],
            env=environment,
            stdin=subprocess.DEVNULL if terminal is None else terminal,
            stdout=subprocess.PIPE if terminal is None else terminal,
            stderr=subprocess.PIPE if terminal is None else terminal,
            text=True,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        if self.child.poll() is None:
            self.child.kill()
        self.child.communicate(timeout=10)

    def finish(self, timeout_s: float = 30) -> tuple[int, str]:
        _, words = self.child.communicate(timeout=timeout_s)
        return self.child.returncode, words

    def report(self) -> dict[str, object]:
        values = json.loads(self._report.read_text())
        assert isinstance(values, dict)
        return values
