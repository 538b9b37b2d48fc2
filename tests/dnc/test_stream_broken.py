"""The loop over a port that breaks or is stuck: what is told, what is thrown away (5.1, 5.4, 5.5)."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from dnc.errors import PortLost
from dnc.events import Event, JobState
from dnc.pacing import Pace
from dnc.stream import Command, Stream
from tests.helpers.broken_port import PROGRAM, BrokenPort
from tests.helpers.line import XOFF, XON, NoJournal, alarm_ids, sender_of, states, tape_of


def test_a_lost_port_purges_and_faults(tmp_path: Path) -> None:
    """(5.5; fault C1) After every stop in the middle, what the system still holds is thrown away."""
    port = BrokenPort(PortLost("gone"))
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    events: list[Event] = []
    stream = Stream(sender, port, NoJournal(), events.append)  # type: ignore[arg-type]
    stream.run()
    assert sender.state is JobState.FAULTED
    assert port.is_purged
    stream.close()
    port.close()


@pytest.mark.parametrize("later", [Command.PAUSE, Command.RESUME, Command.LEAVE])
def test_a_process_that_leaves_is_not_held_back(later: Command, tmp_path: Path) -> None:
    """(5.7) Another SIGTERM put the end off, and an order in between made it an abort by the operator, exit 7."""
    port = BrokenPort(PortLost(""))
    sender = sender_of(tape_of(tmp_path, PROGRAM), Pace(0.01, 3, 0.0, slack=0.0))
    stream = Stream(sender, port, NoJournal(), lambda _: None)  # type: ignore[arg-type]
    sender.start(0.0)
    sender.take(3, 0.0)  # inside a block, and no more comes: a disk that stalls
    stream._obey(Command.LEAVE, 0.1)
    stream._obey(later, 1.9)
    stream._housekeep(2.1)
    assert (sender.state, sender.is_cut, stream.last_command) == (JobState.ABORTED, True, Command.LEAVE)
    stream.close()
    port.close()


def test_an_abort_ends_a_process_that_leaves_at_once(tmp_path: Path) -> None:
    """(5.7) Ctrl-C while a SIGTERM waits for the end of the block: nothing waits for anything any more."""
    port = BrokenPort(PortLost(""))
    sender = sender_of(tape_of(tmp_path, PROGRAM), Pace(0.01, 3, 0.0, slack=0.0))
    stream = Stream(sender, port, NoJournal(), lambda _: None)  # type: ignore[arg-type]
    sender.start(0.0)
    sender.take(3, 0.0)
    stream._obey(Command.LEAVE, 0.1)
    stream._obey(Command.ABORT, 0.2)
    assert (sender.state, stream.last_command) == (JobState.ABORTED, Command.ABORT)
    stream.close()
    port.close()


class SilentPort(BrokenPort):
    """A port whose look at the modem lines, once a second, finds the control gone."""

    def write(self, data: bytes) -> int:
        return len(data)

    def changed_settings(self) -> str:
        raise self.fails


def test_a_control_that_comes_back_resumes_nothing(tmp_path: Path) -> None:
    """(5.7; fault C9) Held when it was switched off: the job is over before the XON of its power-on."""
    port = SilentPort(PortLost("DSR went off"))
    port.hear(XOFF)
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    told: list[Event] = []
    stream = Stream(sender, port, NoJournal(), told.append)  # type: ignore[arg-type]
    stream.run()
    sent = sender.offset_bytes
    assert (states(told)[-1], alarm_ids(told)) == (JobState.FAULTED, ["DNC-A1"])
    assert sender.hear(XON, 100.0) == []
    assert (sender.take(100, 100.0), sender.offset_bytes) == (b"", sent)
    stream.close()
    port.close()


def test_what_was_heard_before_the_port_broke_is_told(tmp_path: Path) -> None:
    """(5.1, 5.2) The first bytes leave before anybody hears of the XON; if that write fails, the XON is still told."""
    port = BrokenPort(PortLost("gone"))
    sender = sender_of(tape_of(tmp_path, PROGRAM), waits_for_xon=True)
    told: list[Event] = []
    told_at_write: list[int] = []

    def write(_data: bytes) -> int:
        told_at_write.append(len(told))
        raise port.fails

    port.write = write  # type: ignore[method-assign]
    port.hear(XON)
    stream = Stream(sender, port, NoJournal(), told.append)  # type: ignore[arg-type]
    stream.run()
    assert states(told) == [JobState.ARMED, JobState.SENDING, JobState.FAULTED]
    assert told_at_write == [1]
    stream.close()
    port.close()


def test_a_hold_is_no_hold_up(tmp_path: Path) -> None:
    """(5.2) The first bytes of a run are not late, however long ago the line fell silent; only the loop can be late."""
    port = SilentPort(PortLost(""))
    sender = sender_of(tape_of(tmp_path, PROGRAM), Pace(1e-3, 6, 0.0, slack=0.0))
    journal = NoJournal()
    journal.bound_bytes = sender.clock.refill_bytes
    stream = Stream(sender, port, journal, lambda _: None)  # type: ignore[arg-type]
    stream._housekeeping.due_s = math.inf
    sender.start(0.0)
    stream._coast()
    assert sender.offset_bytes == journal.bound_bytes
    assert stream.hold_ups.worst_s < 1.0
    stream.close()
    port.close()
