"""The journal is ahead of the line, and readable after any end (5.6, 5.7; faults H1, H2, H3)."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnc.errors import JournalMismatch
from dnc.events import JobState
from dnc.journal import RECORD_BYTES, UNBOUNDED, Journal, Record, read_journal, unpacked

SHA = "ab" * 32


def journal_at(path: Path, ahead: int = 1000) -> tuple[Journal, threading.Event]:
    progress = threading.Event()
    return Journal(path, SHA, ahead, progress.set), progress


def test_a_bound_is_durable_before_anything_may_leave(tmp_path: Path) -> None:
    journal, _ = journal_at(tmp_path / "journal")
    assert journal.bound_bytes == 0
    journal.open()
    assert journal.bound_bytes == 1000
    assert read_journal(tmp_path / "journal")[-1].bound_bytes == 1000
    journal.close(0, JobState.LOADED)


def test_a_bound_waits_for_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.6; decision 21) Written is not durable: no bound counts before the disk has been asked to keep it."""
    journal, progress = journal_at(tmp_path / "journal")
    kept: list[tuple[int, int]] = []
    really = os.fdatasync

    def keep(fd: int) -> None:
        kept.append((journal.bound_bytes, read_journal(tmp_path / "journal")[-1].bound_bytes))
        really(fd)

    monkeypatch.setattr(os, "fdatasync", keep)
    journal.open()
    journal.note(600, JobState.SENDING)
    assert progress.wait(10)
    journal.close(600, JobState.SENDING)
    assert kept[:2] == [(0, 1000), (1000, 1600)]


def test_the_bound_runs_ahead_and_never_back(tmp_path: Path) -> None:
    journal, progress = journal_at(tmp_path / "journal")
    journal.open()
    journal.note(0, JobState.SENDING)
    for sent in (400, 600, 900, 1500):
        progress.clear()
        journal.note(sent, JobState.SENDING)
        if sent >= 600:
            assert progress.wait(10)
    journal.close(1600, JobState.SENT)
    records = read_journal(tmp_path / "journal")
    bounds = [record.bound_bytes for record in records]
    assert bounds == sorted(bounds)
    assert all(record.sent_bytes <= record.bound_bytes for record in records)
    assert (records[-1].sent_bytes, records[-1].state) == (1600, JobState.SENT)
    assert [record.seq for record in records] == list(range(len(records)))


@given(cut=st.integers(0, RECORD_BYTES * 3 - 1), flip=st.integers(0, RECORD_BYTES - 1))
def test_torn_and_flipped_records_end_the_reading(
    tmp_path_factory: pytest.TempPathFactory, cut: int, flip: int
) -> None:
    """(H1) Whatever remains of the last record, everything before it is believed and nothing after it."""
    records = [Record(seq, JobState.SENDING, b"j" * 16, seq * 10, seq * 10 + 5, 1.0, 2.0) for seq in range(3)]
    data = b"".join(record.packed() for record in records)[:cut]
    path = tmp_path_factory.mktemp("journal") / "journal"
    path.write_bytes(data)
    whole = cut // RECORD_BYTES
    if whole:
        assert read_journal(path) == records[:whole]
        damaged = bytearray(data)
        damaged[(whole - 1) * RECORD_BYTES + flip] ^= 0x10
        path.write_bytes(bytes(damaged))
        if whole > 1:
            assert read_journal(path) == records[: whole - 1]
    if whole < 1:
        with pytest.raises(JournalMismatch):
            read_journal(path)


def test_another_version_is_no_record() -> None:
    """(H9)"""
    data = bytearray(Record(0, JobState.SENT, b"j" * 16, 1, 2, 0.0, 0.0).packed())
    assert unpacked(bytes(data)) is not None
    assert unpacked(bytes(data[:-1])) is None


def test_a_full_disk_is_a_problem_not_a_stop(tmp_path: Path) -> None:
    """(H2) Sending goes on, unbounded and unjournaled, and the problem has a name."""
    journal, _ = journal_at(Path("/dev/full"))
    journal.open()
    assert journal.problem == "No space left on device"
    assert journal.bound_bytes == UNBOUNDED
    nowhere, _ = journal_at(tmp_path / "journal" / "x")
    (tmp_path / "journal").write_text("in the way")
    nowhere.open()
    assert nowhere.problem


def test_a_record_that_was_not_written_whole_is_no_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """(H2) A disk may take a part of a record and say no more than how much: what is torn bounds nothing."""
    journal, progress = journal_at(tmp_path / "journal")
    journal.open()
    really = os.write
    monkeypatch.setattr(os, "write", lambda fd, data: really(fd, data[: RECORD_BYTES // 2]))
    journal.note(600, JobState.SENDING)
    assert progress.wait(10)
    assert journal.problem == "No space left on device"
    assert journal.bound_bytes == UNBOUNDED
    assert [record.bound_bytes for record in read_journal(tmp_path / "journal")] == [1000]
    journal.close(600, JobState.SENDING)


def test_a_stalled_disk_holds_up_only_the_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """(H3) `note` returns at once while the disk stands; the bound stays where it was durable."""
    journal, progress = journal_at(tmp_path / "journal")
    journal.open()
    release = threading.Event()
    really = os.fdatasync
    monkeypatch.setattr(os, "fdatasync", lambda fd: (release.wait(10), really(fd))[1])
    for sent in range(0, 900, 10):
        journal.note(sent, JobState.SENDING)
    assert journal.bound_bytes == 1000
    release.set()
    assert progress.wait(10)
    journal.close(900, JobState.SENT)
    assert journal.bound_bytes > 1000
