"""A `dnc mill` as a child process, and a small host at its pseudo-terminal."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import termios
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

from dnc.shipped import shipped_path
from tests.helpers.schemas import validated

XON, XOFF = 0x11, 0x13


def small_machine(folder: Path, **control: object) -> Path:
    """The shipped profile with another [control]: a path."""
    text = shipped_path("machines", "sinumerik-840d").read_text()
    for key, value in control.items():
        lines = [f"{key} = {value}" if line.startswith(f"{key} ") else line for line in text.splitlines()]
        text = "\n".join(lines) + "\n"
    path = folder / "small.toml"
    path.write_text(text)
    return path


class MillProcess:
    """Started and ready when entered; stopped when left."""

    def __init__(self, folder: Path, *words: str | Path) -> None:
        self.report_path = folder / "mill.json"
        self._words = ["mill", "--modbus", "127.0.0.1:0", "--report", str(self.report_path), *map(str, words)]
        self.ready: dict[str, Any] = {}

    def __enter__(self) -> Self:
        command = [sys.executable, "-m", "dnc", *self._words]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        readable, _, _ = select.select([self.process.stdout], [], [], 120.0)
        line = self.process.stdout.readline() if readable else ""
        assert line, self.process.stderr.read() if self.process.stderr else ""
        self.ready = validated(line)
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()

    def end(self, within_s: float = 60.0) -> int:
        return self.process.wait(within_s)

    def terminate(self, within_s: float = 60.0) -> int:
        self.process.send_signal(signal.SIGTERM)
        return self.end(within_s)

    @property
    def report(self) -> dict[str, Any]:
        report = json.loads(self.report_path.read_text())
        assert isinstance(report, dict)
        return report


@contextlib.contextmanager
def port(name: str) -> Iterator[int]:
    """The host's end, raw."""
    fd = os.open(name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        tty.setraw(fd, termios.TCSANOW)
        yield fd
    finally:
        os.close(fd)


def stuff(fd: int, data: bytes, within_s: float, *, obeys: bool) -> tuple[bytes, bytes]:
    """Write as fast as the port takes it, obeying DC1 and DC3 or not; what was not written, and what was heard."""
    heard, is_held, end_s = b"", False, time.monotonic() + within_s
    while data and (left_s := end_s - time.monotonic()) > 0:
        readable, writable, _ = select.select([fd], [] if is_held else [fd], [], left_s)
        if readable:
            said = os.read(fd, 64)
            heard += said
            for byte in said if obeys else b"":
                is_held = {XOFF: True, XON: False}.get(byte, is_held)
        if writable and not is_held:
            with contextlib.suppress(BlockingIOError):
                data = data[os.write(fd, data[:16]) :]
    return data, heard


def listen(fd: int, mark: bytes, within_s: float) -> bytes:
    """What is heard up to a mark."""
    heard, end_s = b"", time.monotonic() + within_s
    while mark not in heard and (left_s := end_s - time.monotonic()) > 0:
        if select.select([fd], [], [], left_s)[0]:
            heard += os.read(fd, 64)
    return heard
