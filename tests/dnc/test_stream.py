"""The loop between a real pty and the sender: exact bytes, partial writes, faults, commands, CPU (1.3, 5.5, 5.7)."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from dnc.events import Alarm, JobState
from dnc.pacing import Pace
from dnc.port import Flow, SerialPort
from dnc.profile import Link
from dnc.stream import Command, Stream
from tests.helpers.line import XOFF, XON, NoJournal, sender_of, states, tape_of
from tests.helpers.streaming import PROGRAM, Cable, Running, plugged


@pytest.fixture
def cable() -> Iterator[Cable]:
    yield from plugged()


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


@pytest.mark.parametrize("bound_bytes", [0, 1, 2])
def test_no_answer_goes_beyond_what_is_on_disk(tmp_path: Path, cable: Cable, bound_bytes: int) -> None:
    """(5.7) A disk that stalls in a hold stops the answer to its XON too: a power cut would leave bytes unrecorded."""
    port, sender = SerialPort(cable.name, Link()), sender_of(tape_of(tmp_path, PROGRAM))
    journal = NoJournal()
    journal.bound_bytes = bound_bytes
    stream = Stream(sender, port, journal, lambda _: None, clock=lambda: 1.0)  # type: ignore[arg-type]
    sender.start(1.0)
    sender.hear(XOFF, 1.0)
    stream._step()
    os.write(cable.master, XON)
    stream._step()
    assert sender.offset_bytes <= bound_bytes
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
