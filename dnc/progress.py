"""Signs of life: what `dnc send` says of events, and on a terminal one line that counts."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import Self, TextIO

import click

from dnc.eventlog import Listener
from dnc.events import Alarm, Event, StateChanged
from dnc.sender import Sender

_PERIOD_S = 0.5
_CLEAR = "\r\x1b[K"
_HINTS = {"ARMED": "; press cycle start", "PAUSED": "; resume with dnc console, Ctrl-C aborts"}


def printable(text: str) -> str:
    r"""Text from outside, safe for a terminal: control, bidirectional and other unprintable characters as <1B>.

    >>> printable("a\x1b[31mb")
    'a<1B>[31mb'
    """
    return "".join(char if char.isprintable() else f"<{ord(char):02X}>" for char in text)


def tell(text: str) -> None:
    """A sentence on a line of its own, in place of the counting line where there is one.

    A terminal that is gone, or a full disk behind stderr, changes nothing for the job.
    """
    with contextlib.suppress(OSError):
        click.echo(f"{_CLEAR if sys.stderr.isatty() else ''}dnc: {text}", err=True)


def silence_output() -> None:
    """What is still to be written to a stdout that takes nothing must not fail again at the very end."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def event_lines(is_simulated: bool, is_leaving: Callable[[], bool] = lambda: False) -> Listener:
    """A listener that prints alarms and the stops of the job to stderr; who is leaving waits for nobody."""
    label = "SIMULATED " if is_simulated else ""

    def show(event: Event) -> None:
        if isinstance(event, Alarm):
            tell(f"{label}{event.severity.value} {event.id}: {event.text}; {event.remedy}")
        elif isinstance(event, StateChanged) and event.new.value in ("ARMED", "PAUSED"):
            tell(f"{label}{event.new.value}: {event.cause}{'' if is_leaving() else _HINTS[event.new.value]}")

    return show


class Ticker:
    """A line on a terminal, redrawn twice a second by a thread and taken away at the end; nothing elsewhere."""

    def __init__(self, line: Callable[[], str], out: TextIO) -> None:
        self._line, self._out = line, out
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="progress", daemon=True)

    def __enter__(self) -> Self:
        if self._out.isatty():
            self._thread.start()
        return self

    def __exit__(self, *_exc: object) -> None:
        self._end.set()
        if self._thread.is_alive():
            self._thread.join(1.0)
            self._write(_CLEAR)

    def _run(self) -> None:
        while not self._end.wait(_PERIOD_S):
            self._write(f"{_CLEAR}{self._fitted(self._line())}")

    def _fitted(self, line: str) -> str:
        """Cut before the border: a line that goes on below it could not be taken away, and would fill the screen."""
        with contextlib.suppress(OSError, ValueError):
            columns = os.get_terminal_size(self._out.fileno()).columns
            return line[: columns - 1] if columns > 1 else line
        return line

    def _write(self, text: str) -> None:
        with contextlib.suppress(OSError):
            self._out.write(text)
            self._out.flush()


def job_line(sender: Sender, is_simulated: bool) -> str:
    """State and bytes of a running job."""
    label = "SIMULATED " if is_simulated else ""
    held = f" for {time.monotonic() - sender.held_since_s:.0f} s" if sender.state.value == "HELD" else ""
    return f"{label}{sender.state.value}{held} {sender.offset_bytes}/{sender.tape.size_bytes} bytes"


def working(what: str) -> Ticker:
    """A sign of life for work that takes a while: what it is, and for how long it has been going on."""
    begun_s = time.monotonic()
    return Ticker(lambda: f"{what} {time.monotonic() - begun_s:.0f} s", sys.stderr)
