"""A record that somebody changed, or a disk damaged, is told as that and hides no other job (5.7)."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dnc.cli.main import run_with
from dnc.events import JobState
from dnc.journal import Journal
from dnc.record import append_record

JOB = "20260101T000000.000000-1"


@pytest.mark.parametrize(
    "damage", [{"job": 5}, {"outcome": ["SENT"]}, {"bytes_sent": None, "bound_bytes": 7}, {"job": None}]
)
def test_a_damaged_line_is_found_and_the_others_are_listed(
    tmp_path: Path, damage: dict[str, object], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(5.7) It ended `dnc jobs`, `--verify` and `--resume` with an internal fault."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    for number in range(3):
        append_record(tmp_path / "dnc", {"job": f"{JOB}{number}", "outcome": "SENT", "bytes_sent": 5})
    path = tmp_path / "dnc/records.jsonl"
    lines = path.read_text().splitlines()
    lines[1] = json.dumps(json.loads(lines[1]) | damage)
    path.write_text("\n".join(lines) + "\n")
    assert run_with(["jobs"]) == 0
    told = capsys.readouterr().out
    assert (f"{JOB}0" in told, f"{JOB}2" in told) == (True, True)
    assert run_with(["jobs", "--verify"]) == 9
    assert "records.jsonl:3:" in capsys.readouterr().err


@pytest.mark.parametrize("text", [b"[1]", b"5", b"\xff\xfe", b"{"])
def test_a_damaged_description_of_a_job_hides_no_other(
    tmp_path: Path, text: bytes, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(5.7)"""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    append_record(tmp_path / "dnc", {"job": f"{JOB}0", "outcome": "SENT", "bytes_sent": 5})
    journal = Journal(tmp_path / f"dnc/jobs/{JOB}1/journal", "ab" * 32, 10, lambda: None)
    journal.open()
    journal.close(0, JobState.HELD)
    (tmp_path / f"dnc/jobs/{JOB}1/job.json").write_bytes(text)
    assert run_with(["jobs"]) == 0
    told = capsys.readouterr().out
    assert (f"{JOB}0" in told, "INTERRUPTED" in told) == (True, True)
