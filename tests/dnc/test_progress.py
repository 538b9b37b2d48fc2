"""Signs of life on a real terminal, and none elsewhere (interface, section 1)."""

from __future__ import annotations

import io
import os
import pty
import termios
import threading

from dnc.progress import Ticker
from tests.helpers.line import read_until


def test_a_line_is_redrawn_on_a_terminal_and_taken_away() -> None:
    """(Interface, section 1) Long work shows progress on a terminal only."""
    master, slave = pty.openpty()
    is_drawn = threading.Event()

    def line() -> str:
        is_drawn.set()
        return "planning 3 s"

    with os.fdopen(slave, "w") as terminal, Ticker(line, terminal):
        assert is_drawn.wait(10.0)
    shown = read_until(master, b"planning 3 s\r\x1b[K")
    os.close(master)
    assert shown.endswith(b"planning 3 s\r\x1b[K")


def test_a_line_does_not_run_over_the_border() -> None:
    """(2.7) In a narrow terminal every redraw left a line behind."""
    master, slave = pty.openpty()
    termios.tcsetwinsize(slave, (10, 20))
    is_drawn = threading.Event()

    def line() -> str:
        is_drawn.set()
        return "SIMULATED HELD for 3 s 1234/3956 bytes"

    with os.fdopen(slave, "w") as terminal, Ticker(line, terminal):
        assert is_drawn.wait(10.0)
    shown = read_until(master, b"HELD for \r\x1b[K")
    os.close(master)
    assert shown == b"\r\x1b[KSIMULATED HELD for \r\x1b[K"


def test_nothing_is_drawn_where_nobody_looks() -> None:
    """(Interface, section 1)"""
    out = io.StringIO()
    with Ticker(lambda: "planning", out):
        pass
    assert out.getvalue() == ""
