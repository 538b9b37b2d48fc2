"""The loop between a real pty and the sender: exact bytes, partial writes, faults, commands, CPU (1.3, 5.5, 5.7)."""

from __future__ import annotations

import os
import pty
import threading
import time
import tty
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import pytest

from dnc.events import Alarm, Event, JobState
from dnc.journal import UNBOUNDED, Journal, read_journal
from dnc.pacing import Pace
from dnc.port import Flow, SerialPort
from dnc.profile import Link
from dnc.stream import Command, Stream
from tests.helpers.line import XOFF, XON, NoJournal, sender_of, states, tape_of

FAST = Pace(byte_s=20e-6, inflight_max_bytes=64, lag_s=0.0, slack=0.0)
PROGRAM = b"".join(b"N%d G1 X%d\n" % (index * 10, index) for index in range(1, 401)) + b"M30\n%\n"


@dataclass
class Cable:
    """A pty: the control's end, and ours held open as a plugged adapter does."""

    master: int
    slave: int
    name: str
    is_plugged: bool = True

    def read_all(self, count: int, timeout_s: float = 20.0) -> bytes:
        data, end_s = b"", time.monotonic() + timeout_s
        while len(data) < count and time.monotonic() < end_s:
            data += os.read(self.master, 65536)
        return data

    def unplug(self) -> None:
        if self.is_plugged:
            self.is_plugged = False
            os.close(self.slave)
            os.close(self.master)


@pytest.fixture
def cable() -> Iterator[Cable]:
    master, slave = pty.openpty()
    tty.setraw(slave)
    cable = Cable(master, slave, os.ttyname(slave))
    yield cable
    cable.unplug()


class Running:
    """A stream in a thread, its events collected."""

    def __init__(self, tmp_path: Path, cable: Cable, pace: Pace = FAST, data: bytes = PROGRAM, **rules: object) -> None:
        self.port = SerialPort(cable.name, Link())
        self.sender = sender_of(tape_of(tmp_path, data), pace, **rules)
        self.events: list[Event] = []
        self.changed = threading.Condition()
        self.stream = Stream(self.sender, self.port, NoJournal(), self._add)  # type: ignore[arg-type]
        self.thread = threading.Thread(target=self.stream.run)

    def _add(self, event: Event) -> None:
        with self.changed:
            self.events.append(event)
            self.changed.notify_all()

    def wait_for(self, state: JobState) -> None:
        with self.changed:
            assert self.changed.wait_for(lambda: self.sender.state is state, 10), self.sender.state

    def is_stuck(self) -> bool:
        """Wait until nothing has left for a while."""
        end_s = time.monotonic() + 10
        while time.monotonic() < end_s:
            before = self.sender.offset_bytes
            threading.Event().wait(0.1)
            if before == self.sender.offset_bytes > 0:
                return True
        return False

    def __enter__(self) -> Self:
        self.thread.start()
        return self

    def __exit__(self, *_exc: object) -> None:
        self.stream.command(Command.ABORT)
        self.thread.join(10)
        self.port.close()
        self.stream.close()
        assert not self.thread.is_alive()


def test_the_exact_bytes_arrive(tmp_path: Path, cable: Cable) -> None:
    """(1.3)"""
    with Running(tmp_path, cable) as running:
        assert cable.read_all(len(PROGRAM)) == PROGRAM
        running.wait_for(JobState.SENT)
    assert states(running.events) == [JobState.SENDING, JobState.DRAINING, JobState.SENT]


def test_a_full_queue_loses_and_repeats_nothing(tmp_path: Path, cable: Cable) -> None:
    """(5.5; fault A9) Partial writes and EAGAIN: the pty takes 4 kB, then nothing until it is read."""
    data = PROGRAM * 12
    pace = Pace(byte_s=1e-7, inflight_max_bytes=3000, lag_s=0.0, slack=0.0)
    with Running(tmp_path, cable, pace, data) as running:
        assert running.is_stuck()
        assert 3000 < running.sender.offset_bytes < len(data)
        assert cable.read_all(len(data)) == data
        running.wait_for(JobState.SENT)


def test_no_core_spins_while_held_or_full(tmp_path: Path, cable: Cable) -> None:
    """(1.3, 5.2; fault A9) A hold and a full queue cost next to nothing."""
    with Running(tmp_path, cable) as running:
        os.write(cable.master, XOFF)
        running.wait_for(JobState.HELD)
        running.stream.wake()  # as the journal does: one look around, and sleep again
        before_s = time.process_time()
        threading.Event().wait(1.0)
        assert time.process_time() - before_s < 0.02
    pace = Pace(byte_s=1e-7, inflight_max_bytes=3000, lag_s=0.0, slack=0.0)
    with Running(tmp_path, cable, pace, PROGRAM * 12):
        threading.Event().wait(0.2)
        before_s = time.process_time()
        threading.Event().wait(1.0)
        assert time.process_time() - before_s < 0.02


def test_a_young_hold_is_slept_through_in_naps(tmp_path: Path, cable: Cable) -> None:
    """(5.2) It may end soon, and a loop that has slept for long answers XON late; a long hold is left in peace."""
    now_s = [1.0]
    port, sender = SerialPort(cable.name, Link()), sender_of(tape_of(tmp_path, PROGRAM))
    stream = Stream(sender, port, NoJournal(), lambda _: None, clock=lambda: now_s[0])  # type: ignore[arg-type]
    sender.start(now_s[0])
    sender.hear(XOFF, now_s[0])
    stream._housekeep(now_s[0])
    assert stream._wait_s() == pytest.approx(0.001)
    now_s[0] += 0.5
    assert stream._wait_s() == pytest.approx(0.5)
    stream.close()
    port.close()


@pytest.mark.parametrize("accepted", [1, 3])
def test_the_first_bytes_lie_ready_for_the_end_of_a_hold(
    tmp_path: Path, cable: Cable, monkeypatch: pytest.MonkeyPatch, accepted: int
) -> None:
    """(5.2, 5.5) They leave with the XON, before anything is reckoned; what the system refuses is sent again."""
    now_s = [1.0]
    port, sender = SerialPort(cable.name, Link()), sender_of(tape_of(tmp_path, PROGRAM))
    stream = Stream(sender, port, NoJournal(), lambda _: None, clock=lambda: now_s[0])  # type: ignore[arg-type]
    sender.start(now_s[0])
    sender.hear(XOFF, now_s[0])
    stream._step()
    os.write(cable.master, XON)
    offsets: list[int] = []

    def refusing(data: bytes) -> int:
        offsets.append(sender.offset_bytes)
        return os.write(cable.slave, data[:accepted]) if len(offsets) == 1 else 0

    monkeypatch.setattr(port, "write", refusing)
    stream._step()
    assert (offsets[0], sender.offset_bytes) == (0, accepted)
    monkeypatch.undo()
    for _ in range(3):
        now_s[0] += 0.01
        stream._step()
    assert cable.read_all(sender.offset_bytes) == PROGRAM[: sender.offset_bytes]
    assert sender.offset_bytes > accepted
    stream.close()
    port.close()


def test_what_lay_ready_for_one_hold_does_not_leave_after_the_next(tmp_path: Path, cable: Cable) -> None:
    """(5.1, 5.2) Bytes laid ready and left once would, with the XON of the next hold, be cut a second time."""
    now_s = [1.0]
    port, sender = SerialPort(cable.name, Link()), sender_of(tape_of(tmp_path, PROGRAM))
    stream = Stream(sender, port, NoJournal(), lambda _: None, clock=lambda: now_s[0])  # type: ignore[arg-type]
    sender.start(now_s[0])
    for _ in range(4):
        for heard in (XOFF, XON):
            os.write(cable.master, heard)
            for _ in range(3):
                now_s[0] += 0.01
                stream._step()
    assert cable.read_all(sender.offset_bytes) == PROGRAM[: sender.offset_bytes]
    assert sender.tally.bytes_sent == sender.offset_bytes > 24
    stream.close()
    port.close()


@pytest.mark.parametrize("command", [Command.PAUSE, Command.ABORT])
def test_a_command_goes_before_bytes_that_lie_ready(tmp_path: Path, cable: Cable, command: Command) -> None:
    """(5.7) Asked for in the moment of the XON, a stop is not overtaken by the answer to it."""
    port, sender = SerialPort(cable.name, Link()), sender_of(tape_of(tmp_path, PROGRAM))
    stream = Stream(sender, port, NoJournal(), lambda _: None, clock=lambda: 1.0)  # type: ignore[arg-type]
    sender.start(1.0)
    sender.hear(XOFF, 1.0)
    stream._step()
    assert stream._answer == PROGRAM[:3]
    os.write(cable.master, XON)
    stream.command(command)
    stream._step()
    assert sender.offset_bytes == 0
    assert sender.state is (JobState.PAUSED if command is Command.PAUSE else JobState.ABORTED)
    stream.close()
    port.close()


def test_held_pause_resume_abort(tmp_path: Path, cable: Cable) -> None:
    """(5.7)"""
    slow = Pace(byte_s=1e-3, inflight_max_bytes=3, lag_s=0.0, slack=0.0)
    with Running(tmp_path, cable, slow) as running:
        running.wait_for(JobState.SENDING)
        os.write(cable.master, XOFF)
        running.wait_for(JobState.HELD)
        os.write(cable.master, XON)
        running.wait_for(JobState.SENDING)
        running.stream.command(Command.PAUSE)
        running.wait_for(JobState.PAUSED)
        assert not running.sender.is_cut
        os.write(cable.master, XON)
        running.stream.command(Command.RESUME)
        running.wait_for(JobState.SENDING)
        running.stream.command(Command.ABORT)
        running.wait_for(JobState.ABORTED)


def test_unplugged_in_the_middle(tmp_path: Path, cable: Cable) -> None:
    """(1.3, 5.5; fault A1) The other end closes: one alarm within a second, FAULTED."""
    slow = Pace(byte_s=1e-3, inflight_max_bytes=3, lag_s=0.0, slack=0.0)
    with Running(tmp_path, cable, slow) as running:
        running.wait_for(JobState.SENDING)
        before_s = time.monotonic()
        cable.unplug()
        running.wait_for(JobState.FAULTED)
        assert time.monotonic() - before_s < 1.0
        assert [event.id for event in running.events if isinstance(event, Alarm)] == ["DNC-A1"]


def test_a_pulled_cable_is_a_hold_where_a_modem_line_tells(tmp_path: Path, cable: Cable) -> None:
    """(5.3; fault L11) RTS/CTS: the line falls with the cable, HELD without an alarm; it rises again, every byte."""
    slow = Pace(byte_s=1e-4, inflight_max_bytes=3, lag_s=0.0, slack=0.0)
    running = Running(tmp_path, cable, slow)
    is_plugged = threading.Event()
    is_plugged.set()
    running.stream._flow = Flow.MODEM
    running.port.may_send = is_plugged.is_set  # type: ignore[method-assign]
    with running:
        running.wait_for(JobState.SENDING)
        is_plugged.clear()
        running.wait_for(JobState.HELD)
        sent = running.sender.offset_bytes
        assert running.sender.tally.xoff_count == 1
        assert cable.read_all(sent) == PROGRAM[:sent]
        is_plugged.set()
        assert cable.read_all(len(PROGRAM) - sent) == PROGRAM[sent:]
        running.wait_for(JobState.SENT)
        assert [event for event in running.events if isinstance(event, Alarm)] == []


def test_foreign_settings_pause(tmp_path: Path, cable: Cable, monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.4; fault A5) The check of once a second finds another program's change."""
    slow = Pace(byte_s=1e-3, inflight_max_bytes=3, lag_s=0.0, slack=0.0)
    running = Running(tmp_path, cable, slow)
    monkeypatch.setattr(running.port, "changed_settings", lambda: "baud rate")
    with running:
        running.wait_for(JobState.PAUSED)
        assert [event.id for event in running.events if isinstance(event, Alarm)] == ["DNC-A5"]


def test_a_computer_that_slept_pauses(tmp_path: Path, cable: Cable, monkeypatch: pytest.MonkeyPatch) -> None:
    """(fault H5) Once: what the operator has looked at and resumed goes on past the next look, a second later."""
    slow = Pace(byte_s=5e-4, inflight_max_bytes=3, lag_s=0.0, slack=0.0)
    running = Running(tmp_path, cable, slow, b"G1 X1\n" * 500)
    monkeypatch.setattr("dnc.stream._asleep_s", lambda: 3600.0)
    with running:
        running.wait_for(JobState.PAUSED)
        running.stream.command(Command.RESUME)
        running.wait_for(JobState.SENT)
        assert [event.id for event in running.events if isinstance(event, Alarm)] == ["DNC-H5"]


def test_a_journal_that_fails_is_an_alarm_once(tmp_path: Path, cable: Cable) -> None:
    """(fault H2) Not once a second: the job goes on for longer than that."""
    slow = Pace(byte_s=5e-4, inflight_max_bytes=3, lag_s=0.0, slack=0.0)
    running = Running(tmp_path, cable, slow, b"G1 X1\n" * 500)
    running.stream.journal.problem = "No space left on device"
    with running:
        running.wait_for(JobState.SENT)
        assert [event.id for event in running.events if isinstance(event, Alarm)] == ["DNC-H2"]


def test_the_journal_keeps_ahead_of_the_whole_tape(tmp_path: Path, cable: Cable) -> None:
    """(5.6, 5.7; decision 21) Of 200 bytes ahead none may leave before the disk has them, and all of the tape does."""
    running = Running(tmp_path, cable)
    journal = Journal(tmp_path / "journal", "ab" * 32, 200, running.stream.wake)
    running.stream.journal, write = journal, running.port.write

    def write_within(data: bytes) -> int:
        assert running.sender.offset_bytes <= read_journal(tmp_path / "journal")[-1].bound_bytes
        return write(data)

    running.port.write = write_within  # type: ignore[method-assign]
    journal.open()
    with running:
        assert cable.read_all(len(PROGRAM)) == PROGRAM
        running.wait_for(JobState.SENT)
    journal.close(running.sender.offset_bytes, running.sender.state)
    assert read_journal(tmp_path / "journal")[-1].sent_bytes == len(PROGRAM)


def test_nothing_leaves_beyond_the_journal(tmp_path: Path, cable: Cable) -> None:
    """(5.6; decision 8) The durable bound holds the line back, without spinning, until it moves."""
    running = Running(tmp_path, cable)
    journal = NoJournal()
    journal.bound_bytes = 100
    running.stream.journal = journal  # type: ignore[assignment]
    with running:
        assert len(cable.read_all(100)) == 100
        before_s = time.process_time()
        threading.Event().wait(0.5)
        assert time.process_time() - before_s < 0.02
        assert running.sender.offset_bytes == 100
        journal.bound_bytes = UNBOUNDED
        running.stream.wake()
        assert cable.read_all(len(PROGRAM) - 100) == PROGRAM[100:]
