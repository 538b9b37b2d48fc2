"""The loop over a system that keeps a queue: what waits in it, what is thrown out of it (5.2, 5.4, 5.5, 5.7)."""

from __future__ import annotations

import itertools
import math
import time
from pathlib import Path

import pytest

from dnc.errors import PortLost
from dnc.events import Event, JobState
from dnc.pacing import Pace
from dnc.port import Flow
from dnc.stream import Command, Stream
from tests.helpers.broken_port import PROGRAM, BrokenPort
from tests.helpers.line import XOFF, NoJournal, alarm_ids, sender_of, tape_of


class StuckPort(BrokenPort):
    """A port whose system takes everything and whose control then reads no more."""

    taken_bytes = 0
    stuck_bytes = 2

    def write(self, data: bytes) -> int:
        self.taken_bytes += len(data)
        return len(data)

    def queued_bytes(self) -> int:
        return 0 if self.taken_bytes < len(PROGRAM) else self.stuck_bytes


def test_what_a_control_no_longer_reads_is_thrown_away(tmp_path: Path) -> None:
    """(5.4, 5.5; fault A10) SENT with a note; the queue is emptied, for close would wait for it."""
    port = StuckPort(PortLost(""))
    sender = sender_of(tape_of(tmp_path, PROGRAM), Pace(1e-9, 64, 0.0, slack=0.0))
    seconds = itertools.count()
    stream = Stream(sender, port, NoJournal(), lambda _: None, clock=lambda: float(next(seconds)))  # type: ignore[arg-type]
    stream.run()
    assert (sender.state, port.is_purged) == (JobState.SENT, True)
    assert "2 bytes were still in the system's queue" in sender.note
    stream.close()
    port.close()


def test_the_end_of_a_tape_may_lie_in_the_queue_for_a_while(tmp_path: Path) -> None:
    """(5.4, 5.5) A late driver is no control that stopped reading: 2 s from when the line should have fallen silent."""
    port = StuckPort(PortLost(""))
    sender = sender_of(tape_of(tmp_path, PROGRAM), Pace(1e-9, 64, 0.0, slack=0.0))
    moments = itertools.count(1000.0, 0.1)

    def clock() -> float:
        now_s = next(moments)
        if sender.state is JobState.DRAINING and now_s > sender.clock.idle_at_s + 1.5:
            port.stuck_bytes = 0
        return now_s

    left_bytes: list[int] = []
    stream = Stream(sender, port, NoJournal(), lambda _: left_bytes.append(port.stuck_bytes), clock=clock)  # type: ignore[arg-type]
    stream.run()
    assert (sender.state, sender.note, port.is_purged) == (JobState.SENT, "", False)
    assert left_bytes == [2, 2, 0]  # SENDING, DRAINING, SENT
    stream.close()
    port.close()


@pytest.mark.parametrize("goes_on", [True, False])
def test_blocks_that_the_control_has_not_taken_are_waited_for(tmp_path: Path, *, goes_on: bool) -> None:
    """(5.3, 5.4; faults A9, C6) M0 or a tool change near the end: M30 was thrown away after 2 s and called SENT."""
    port = StuckPort(PortLost(""))
    port.stuck_bytes = len(b"30\n%\n")
    sender = sender_of(tape_of(tmp_path, PROGRAM), Pace(1e-9, 64, 0.0, slack=0.0), hold_timeout_s=0 if goes_on else 600)
    seconds = itertools.count()
    told: list[Event] = []

    def clock() -> float:
        now_s = float(next(seconds))
        if goes_on and now_s > 100_000:
            port.stuck_bytes = 0
        return now_s

    stream = Stream(sender, port, NoJournal(), told.append, clock=clock)  # type: ignore[arg-type]
    stream.run()
    if goes_on:
        assert (sender.state, port.is_purged, alarm_ids(told)) == (JobState.SENT, False, ["DNC-L1"])
    else:
        assert (sender.state, alarm_ids(told)) == (JobState.FAULTED, ["DNC-L1", "DNC-L1T"])
    stream.close()
    port.close()


class QueuePort(BrokenPort):
    """A port with a block in the system's queue; the operator acts as soon as it lies there."""

    def __init__(self, act: Command, looks: float) -> None:
        super().__init__(PortLost("gone"))
        self.act, self.looks = act, looks
        self.stream: Stream | None = None
        self.has_written = False

    def write(self, data: bytes) -> int:
        assert self.stream is not None
        self.stream.command(self.act)
        self.has_written = True
        return len(data)

    def queued_bytes(self) -> int:
        self.looks -= self.has_written
        return 3 if self.has_written and self.looks > 0 else 0


@pytest.mark.parametrize(
    ("act", "looks", "state"),
    [
        (Command.ABORT, math.inf, JobState.ABORTED),
        (Command.ABORT, 0, JobState.ABORTED),
        (Command.LEAVE, math.inf, JobState.ABORTED),
        (Command.LEAVE, 10, JobState.PAUSED),
    ],
)
def test_a_block_thrown_out_of_the_queue_is_cut(act: Command, looks: float, state: JobState, tmp_path: Path) -> None:
    """(5.5, 5.7) All of it was given out, so it counted as whole: the next program began behind half a block."""
    block = len(b"G1 X1\n")
    port = QueuePort(act, looks)
    sender = sender_of(tape_of(tmp_path, PROGRAM), Pace(0.01, block, 0.0, slack=0.0))
    moments = itertools.count()
    stream = port.stream = Stream(
        sender,
        port,
        NoJournal(),
        lambda _: None,
        clock=lambda: 0.001 * next(moments),  # type: ignore[arg-type]
    )
    stream.run()
    assert (sender.state, sender.offset_bytes, sender.is_cut) == (state, block, False)
    assert (sender.may_be_cut, port.is_purged) == (state is JobState.ABORTED, state is JobState.ABORTED)
    stream.close()
    port.close()


class TakingPort(BrokenPort):
    """A port that takes everything at once; what is asked of the loop meanwhile is asked at the first write."""

    waiting_bytes = 0
    asked: Command | None = None
    stream: Stream | None = None

    def write(self, data: bytes) -> int:
        if self.asked is not None and self.stream is not None:
            self.stream.command(self.asked)
            self.asked = None
        return len(data)

    def queued_bytes(self) -> int:
        return self.waiting_bytes


def test_a_process_that_leaves_sends_its_block_to_the_end(tmp_path: Path) -> None:
    """(5.7) SIGTERM in the middle of a block of which the line takes two bytes at a time."""
    port, moments = TakingPort(PortLost("")), itertools.count(0.0, 0.1)
    sender = sender_of(tape_of(tmp_path, PROGRAM), Pace(0.001, 2, 0.0, slack=0.0))
    stream = port.stream = Stream(sender, port, NoJournal(), lambda _: None, clock=lambda: next(moments))  # type: ignore[arg-type]
    port.asked = Command.LEAVE
    stream.run()
    assert (sender.state, sender.offset_bytes) == (JobState.PAUSED, len(b"G1 X1\n"))
    stream.close()
    port.close()


def test_nothing_is_laid_ready_while_bytes_wait_below(tmp_path: Path) -> None:
    """(5.2) With what still waits in the system's queue they would be more than may be beyond recall."""
    port = TakingPort(PortLost(""))
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    stream = Stream(sender, port, NoJournal(), lambda _: None)  # type: ignore[arg-type]
    sender.start(0.0)
    sender.hear(XOFF, 0.0)
    for port.waiting_bytes, ready in ((1, b""), (0, PROGRAM[:3])):
        stream._lay_ready(1.0)
        assert stream._answer == ready
    stream.close()
    port.close()


def test_a_run_that_woke_late_stays_within_the_journal(tmp_path: Path) -> None:
    """(5.6; decision 21) The clock has room for much then; of what the disk holds, some bytes are left."""
    port, journal, moments = TakingPort(PortLost("")), NoJournal(), itertools.count()
    journal.bound_bytes = 100
    sender = sender_of(tape_of(tmp_path, PROGRAM), Pace(0.001, 64, 0.0, slack=0.0))
    stream = Stream(sender, port, journal, lambda _: None, clock=lambda: float(next(moments)))  # type: ignore[arg-type]
    sender.start(0.0)
    stream._housekeeping.due_s = math.inf
    stream._coast()
    assert sender.offset_bytes == journal.bound_bytes
    stream.close()
    port.close()


class DrivenPort(BrokenPort):
    """A port whose driver obeys XOFF itself; of what it is given, so much waits."""

    flow = Flow.DRIVER
    waiting_bytes = 0

    def queued_bytes(self) -> int:
        return self.waiting_bytes


@pytest.mark.parametrize(("baud", "patience_s"), [(110, 0.29), (9600, 0.05)])
def test_a_slow_byte_is_no_hold(tmp_path: Path, baud: int, patience_s: float) -> None:
    """(5.3) At 110 baud a byte takes 0.1 s: each was a hold, and its end the proof of what had been executed."""
    port = DrivenPort(PortLost(""))
    sender = sender_of(tape_of(tmp_path, PROGRAM), Pace(11 / baud, 2, 0.0, slack=0.0), hears_xoff=False)
    stream = Stream(sender, port, NoJournal(), lambda _: None)  # type: ignore[arg-type]
    sender.start(0.0)
    stream._watch_flow(0.0)
    port.waiting_bytes = 2
    stream._watch_flow(0.95 * patience_s)
    assert sender.state is JobState.SENDING
    stream._watch_flow(1.1 * patience_s)
    assert sender.state is JobState.HELD
    port.waiting_bytes = 0
    stream._watch_flow(50.0)  # patience counts from when bytes last moved
    assert sender.state is JobState.SENDING
    port.waiting_bytes = 2
    stream._watch_flow(50.0 + 0.95 * patience_s)
    assert sender.state is JobState.SENDING
    stream.close()
    port.close()


class SlowPort(BrokenPort):
    """An adapter whose line is half as fast as it should be; it tells how many bytes wait in it."""

    byte_s = 0.4e-3

    def __init__(self) -> None:
        super().__init__(PortLost(""))
        self.empty_at_s = 0.0
        self.most_bytes = 0

    def queued_bytes(self) -> int:
        return max(0, math.ceil((self.empty_at_s - time.monotonic()) / self.byte_s))

    def write(self, data: bytes) -> int:
        self.most_bytes = max(self.most_bytes, self.queued_bytes() + len(data))
        self.empty_at_s = max(time.monotonic(), self.empty_at_s) + len(data) * self.byte_s
        return len(data)


def test_a_line_slower_than_its_rate_piles_nothing_up(tmp_path: Path) -> None:
    """(5.2) Where the system tells its queue, the bound holds whatever the byte clock believes, at every write."""
    port = SlowPort()
    sender = sender_of(tape_of(tmp_path, PROGRAM[-800:]), Pace(0.2e-3, 8, 0.0, slack=0.0))
    stream = Stream(sender, port, NoJournal(), lambda _: None)  # type: ignore[arg-type]
    stream.run()
    assert sender.state is JobState.SENT
    assert port.most_bytes <= 8
    stream.close()
    port.close()
