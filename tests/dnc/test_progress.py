"""Signs of life on a real terminal, and none elsewhere (interface, section 1)."""

from __future__ import annotations

import io
import os
import pty
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


def test_nothing_is_drawn_where_nobody_looks() -> None:
    """(Interface, section 1)"""
    out = io.StringIO()
    with Ticker(lambda: "planning", out):
        pass
    assert out.getvalue() == ""
