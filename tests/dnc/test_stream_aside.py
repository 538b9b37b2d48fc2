"""What the loop looks after beside the bytes: journal, foreign settings, a nap of the computer (5.4, 5.6, 5.7)."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from dnc.events import Alarm, JobState
from dnc.journal import UNBOUNDED, Journal, read_journal
from dnc.pacing import Pace
from dnc.stream import Command
from tests.helpers.line import NoJournal
from tests.helpers.streaming import PROGRAM, Cable, Running, plugged


@pytest.fixture
def cable() -> Iterator[Cable]:
    yield from plugged()


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
    monkeypatch.setattr("dnc.housekeeping.asleep_s", lambda: 3600.0)
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
