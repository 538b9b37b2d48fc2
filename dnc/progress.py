"""What `dnc send` shows: a line per event, and on a terminal one line that counts."""

from __future__ import annotations

import threading
import time
from typing import Self, TextIO

import click

from dnc.eventlog import Listener
from dnc.events import Alarm, Event, StateChanged
from dnc.sender import Sender

_PERIOD_S = 0.5
_HINTS = {"ARMED": "; press cycle start", "PAUSED": "; resume with dnc console, Ctrl-C aborts"}


def printable(text: str) -> str:
    r"""Text from outside, safe for a terminal: control, bidirectional and other unprintable characters as <1B>.

    >>> printable("a\x1b[31mb")
    'a<1B>[31mb'
    """
    return "".join(char if char.isprintable() else f"<{ord(char):02X}>" for char in text)


def event_lines(is_simulated: bool) -> Listener:
    """A listener that prints alarms and the stops of the job to stderr."""
    label = "SIMULATED " if is_simulated else ""

    def show(event: Event) -> None:
        if isinstance(event, Alarm):
            click.echo(f"dnc: {label}{event.severity.value} {event.id}: {event.text}; {event.remedy}", err=True)
        elif isinstance(event, StateChanged) and event.new.value in ("ARMED", "PAUSED"):
            click.echo(f"dnc: {label}{event.new.value}: {event.cause}{_HINTS[event.new.value]}", err=True)

    return show


class Progress:
    """A line on a terminal, redrawn twice a second by a thread; nothing where stderr is no terminal."""

    def __init__(self, sender: Sender, is_simulated: bool, out: TextIO) -> None:
        self._sender, self._label, self._out = sender, "SIMULATED " if is_simulated else "", out
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
            self._out.write("\n")

    def _run(self) -> None:
        while not self._end.wait(_PERIOD_S):
            self._out.write(f"\r{self._line()}\x1b[K")
            self._out.flush()

    def _line(self) -> str:
        sender = self._sender
        total = sender.tape.size_bytes
        held = ""
        if sender.state.value == "HELD":
            held = f" for {time.monotonic() - sender.held_since_s:.0f} s"
        return f"{self._label}{sender.state.value}{held} {sender.offset_bytes}/{total} bytes"
