"""What a port remembers of the job before, and the record that a full disk or a power cut tears."""

from __future__ import annotations

import errno
import io
import os
from pathlib import Path

import pytest

from dnc import record
from dnc.aftermath import begin_mark, leave_mark, refuse_dirty_control
from dnc.errors import JournalMismatch
from dnc.joblist import first_broken_link, past_jobs
from dnc.record import append_record

PORT = "usb-FTDI_A"


def ended(outcome: str, sent: int = 500, *, is_cut: bool = False) -> dict[str, object]:
    return {
        "job": "1",
        "program": "a.mpf",
        "outcome": outcome,
        "is_block_cut": is_cut,
        "bytes_sent": sent,
        "in_doubt": [1, 9],
    }


def is_refused(*, is_yes: bool = False, was_reset: bool = False) -> bool:
    try:
        refuse_dirty_control(PORT, is_yes, was_reset)
    except JournalMismatch:
        return True
    return False


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path / "dnc"


def test_a_job_that_never_ended_asks_for_a_reset() -> None:
    """(5.7; fault C10) kill -9, power cut: nobody was left to write a mark, so it stands before the first byte."""
    begin_mark(PORT, "1", "a.mpf")
    assert is_refused(is_yes=True)
    assert not is_refused(was_reset=True)
    assert not is_refused()


def test_a_job_that_sent_nothing_leaves_what_was_known() -> None:
    """(5.7; fault C10) A start that timed out says nothing of the control, twice in a row neither."""
    begin_mark(PORT, "1", "a.mpf")
    leave_mark(PORT, ended("ABORTED", is_cut=True))
    for _ in range(2):
        begin_mark(PORT, "2", "a.mpf")
        leave_mark(PORT, ended("FAULTED", 0))
        assert is_refused(is_yes=True)
    begin_mark(PORT, "3", "a.mpf")
    leave_mark(PORT, ended("SENT"))
    assert not is_refused()
    begin_mark(PORT, "4", "a.mpf")
    leave_mark(PORT, ended("NOT_STARTED", 0))
    assert not is_refused()


def test_a_full_disk_leaves_the_mark_that_stands(state: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.6, 5.7) The mark of the start is not lost to the one that does not fit."""
    begin_mark(PORT, "1", "a.mpf")

    def full(_number: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        leave_mark(PORT, ended("PAUSED"))
    assert [path.suffix for path in (state / "ports").iterdir()] == [".json"]
    assert is_refused(is_yes=True)


@pytest.mark.parametrize("torn", [b"", b"{", b"[1]", b"\xff"])
def test_a_mark_that_cannot_be_read_is_one(torn: bytes, state: Path) -> None:
    """(5.7; fault C10) In doubt the control holds something."""
    begin_mark(PORT, "1", "a.mpf")
    next((state / "ports").iterdir()).write_bytes(torn)
    assert is_refused(is_yes=True)


def test_a_torn_line_spoils_no_other(state: Path) -> None:
    """(5.7; fault H2) The next job's line stands by itself, and the chain holds."""
    for job in ("1", "2"):
        append_record(state, {"job": job, "outcome": "SENT"})
    path = state / "records.jsonl"
    path.write_bytes(path.read_bytes()[:-9])
    append_record(state, {"job": "3", "outcome": "SENT"})
    assert [job.job for job in past_jobs(state)] == ["1", "3"]
    assert first_broken_link(state) is None


def test_a_job_that_a_fault_of_ours_ended_is_interrupted(state: Path) -> None:
    """(5.7) It stood as SENDING in the list for ever, and could not be resumed."""
    append_record(state, {"job": "1", "outcome": "SENDING", "bytes_sent": 40})
    append_record(state, {"job": "2", "outcome": "SENT"})
    assert [(job.job, job.outcome) for job in past_jobs(state)] == [("1", "INTERRUPTED"), ("2", "SENT")]


@pytest.mark.parametrize("outcome", ["PAUSED", "NOT_STARTED"])
def test_a_job_that_ended_with_a_word_is_not_interrupted(outcome: str, state: Path) -> None:
    """(5.7; section 7) SIGTERM, or no first XON: the job told what it had sent."""
    append_record(state, {"job": "1", "outcome": outcome, "bytes_sent": 40})
    assert [(job.job, job.outcome) for job in past_jobs(state)] == [("1", outcome)]


def test_a_line_that_does_not_fit_is_not_begun(state: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.7; fault H2) The disk takes half of it: the record is as it was, and the caller hears of it."""
    append_record(state, {"job": "1", "outcome": "SENT"})
    before = (state / "records.jsonl").read_bytes()

    class Full(io.FileIO):
        def write(self, data: bytes) -> int:  # type: ignore[override]
            return super().write(data[: len(data) // 2])

    monkeypatch.setattr(Path, "open", lambda path, mode, **_: Full(path, mode.replace("b", "")))
    monkeypatch.setattr(record, "last_line", lambda _path: before[:-1])
    with pytest.raises(OSError, match="No space"):
        append_record(state, {"job": "2", "outcome": "SENT"})
    assert (state / "records.jsonl").read_bytes() == before
