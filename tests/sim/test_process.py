"""What the mill says when its control's process keeps it waiting (1.7)."""

from __future__ import annotations

import contextlib
import multiprocessing
import re
import signal
import socket
from pathlib import Path

import pytest

from dnc.shipped import shipped_path
from planner.errors import UserError
from sim.faults import Faults
from sim.messages import Ready, Wire
from sim.process import _child, _wait_for
from sim.profile import load_mill_profile
from sim.setup import Setup


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


def test_an_interrupt_of_the_terminal_does_not_reach_a_control_that_still_loads() -> None:
    """(2.7) Ctrl-C in the first seconds of `dnc mill` showed a traceback of its child, which got it too."""
    name = shipped_path("machines", "virtual-mill")
    setup = Setup(load_mill_profile(name), Faults(), 1.0, "127.0.0.1", 0, False, None, None, 1.0)
    with _child(setup) as (child, _wire):
        blocked = re.search(r"SigBlk:\s*([0-9a-f]+)", Path(f"/proc/{child.pid}/status").read_text())
        ours = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    assert blocked is not None
    assert all(int(blocked[1], 16) >> (number - 1) & 1 for number in (signal.SIGINT, signal.SIGTERM))
    assert not {signal.SIGINT, signal.SIGTERM} & ours
