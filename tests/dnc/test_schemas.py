"""What the lists print as JSON, against the schemas that the interface promises (section 5)."""

from __future__ import annotations

import re
from pathlib import Path

import jsonschema
import pytest

from dnc.cli import main
from dnc.events import JobState
from dnc.journal import Journal
from dnc.record import append_record
from dnc.shipped import shipped_path
from tests.helpers.schemas import SCHEMAS, validated

ROOT = Path(__file__).parents[2]


def test_every_report_has_a_schema_and_every_schema_a_report() -> None:
    """(Interface, section 5) The snapshot of a running job is no report: it stands in PROTOCOL.md."""
    sources = [path.read_text() for package in ("dnc", "sim", "planner") for path in (ROOT / package).rglob("*.py")]
    named = {name for text in sources for name in re.findall(r'"dripmill\.([a-z-]+)"', text)}
    assert named | {"mill-ready"} == {*SCHEMAS, "job"}
    for schema in SCHEMAS.values():
        jsonschema.Draft202012Validator.check_schema(schema)


@pytest.mark.parametrize("command", ["machines", "ports", "doctor"])
def test_lists(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    """(Interface, section 5)"""
    main.run_with([command, "--json"])
    assert validated(capsys.readouterr().out)["schema"] == f"dripmill.{command}"


def test_jobs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """(Interface, section 5) One that ended with a word and one without."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    append_record(tmp_path / "dnc", {"job": "20260101T000000-1", "outcome": "SENT", "bytes_sent": 5, "bytes_total": 5})
    journal = Journal(tmp_path / "dnc/jobs/20260102T000000-99999999/journal", "ab" * 32, 100, lambda: None)
    journal.open()
    journal.close(42, JobState.SENDING)
    assert main.run_with(["jobs", "--json"]) == 0
    jobs = validated(capsys.readouterr().out)["jobs"]
    assert [(job["outcome"], job["bytes_sent"]) for job in jobs] == [("SENT", 5), ("INTERRUPTED", 42)]


def test_parts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """(Interface, section 5)"""
    program, job = tmp_path / "part.mpf", str(shipped_path("jobs", "thesis"))
    program.write_text("G90 G54\nT2 M6\nD1\nG0 Z50\nM30\n")
    assert main.run_with(["split", str(program), "-o", str(tmp_path / "parts"), "--job", job, "--json"]) == 0
    (part,) = validated(capsys.readouterr().out)["parts"]
    assert (tmp_path / "parts" / part["file"]).stat().st_size == part["bytes"]
