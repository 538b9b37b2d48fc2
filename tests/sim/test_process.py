"""What the mill says when its control's process keeps it waiting (1.7)."""

from __future__ import annotations

import contextlib
import multiprocessing
import socket

import pytest

from planner.errors import UserError
from sim.messages import Ready, Wire
from sim.process import _wait_for


def test_a_control_that_is_late_is_not_called_dead() -> None:
    """(1.7) On an overloaded computer it was said to have ended without a word (code None), and to be reported."""
    ours, theirs = socket.socketpair()
    child = multiprocessing.get_context("spawn").Process()
    with contextlib.closing(ours), contextlib.closing(theirs):
        with pytest.raises(UserError, match=r"took longer than 0\.05 s; try again"):
            _wait_for(Wire(ours), child, Ready, 0.05, None)
        theirs.shutdown(socket.SHUT_RDWR)
        with pytest.raises(UserError, match="ended without a word"):
            _wait_for(Wire(ours), child, Ready, 10.0, None)
