"""Which job `--resume` takes up, and from which line: what the record and the journals of a state folder say (5.7)."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from dnc.cli import main
from dnc.errors import ExitCode, JournalMismatch
from dnc.events import JobState
from dnc.joblist import PastJob
from dnc.journal import Journal
from dnc.profile import Control, Link, MachineProfile
from dnc.profile import Tape as Framing
from dnc.record import append_record
from dnc.resuming import _last_point_before
from dnc.sidecar import Point
from dnc.stopped import lines_in_doubt, stopped_job
from dnc.tape import Tape
from tests.helpers.line import tape_of

PORT, OTHER, MACHINE = "ttyUSB7", "ttyUSB8", "mill"
PROGRAM = b"".join(b"N%d G1 X%d\n" % (number, number) for number in range(1, 201)) + b"M30\n"
PROFILE = MachineProfile(
    link=Link(), control=Control(receive_buffer_bytes=100, lookahead_blocks=3), axes={}, tape=Framing()
)


@pytest.fixture
def look(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., PastJob]:
    """Put jobs of this program on record, the last one last, and look for the stopped one."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    for name in (PORT, OTHER):
        Path(name).touch()

    def found(*jobs: dict[str, Any], port: str | None = PORT, is_forced: bool = False) -> PastJob:
        with closing(tape_of(tmp_path, PROGRAM)) as tape:
            for number, more in enumerate(jobs):
                append_record(tmp_path / "dnc", {"job": f"2026-{number}", **recorded(tape), **more})
            return stopped_job(tape, MACHINE, port, is_forced=is_forced)

    return found


def recorded(tape: Tape) -> dict[str, Any]:
    sha = tape.program_sha256
    return {"outcome": "ABORTED", "program_sha256": sha, "port": PORT, "bytes_sent": 900, "machine": MACHINE}


def test_the_last_job_of_the_port_that_sent_anything(look: Callable[..., PastJob]) -> None:
    """(5.7; decision 39)"""
    jobs = ({}, {"outcome": "NOT_STARTED", "bytes_sent": 0}, {"port": OTHER}, {"rehearsal": True})
    assert look(*jobs).job == "2026-0"
    assert look(port=OTHER).job == "2026-2"
    assert look(port="/dev/no such", is_forced=True).job == "2026-2"


def test_no_older_job_where_the_last_one_may_have_left_no_trace(look: Callable[..., PastJob], tmp_path: Path) -> None:
    """(5.7) A job that could write nothing down was overseen, and the one before it resumed."""
    assert look({}).job == "2026-0"
    jobs = tmp_path / "dnc" / "jobs"
    jobs.touch()  # as on a folder without rights, which a test by root cannot make
    with pytest.raises(JournalMismatch, match="jobs cannot be written, so jobs leave no trace there; a later job may"):
        look()
    jobs.unlink()
    with (tmp_path / "dnc" / "records.jsonl").open("ab") as record:
        record.write(b"\xff\x00 not a record\n")
    with pytest.raises(JournalMismatch, match="lines that nobody can read: 1; a later job may be hidden"):
        look()


def test_the_list_of_jobs_tells_of_a_damaged_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(5.7) "no job was sent from here yet" was said over a record of which no line could be read."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    (tmp_path / "dnc").mkdir()
    (tmp_path / "dnc" / "records.jsonl").write_bytes(b"\xff\x00 not a record\n")
    assert main.run_with(["jobs"]) == ExitCode.OK
    said = capsys.readouterr().err
    assert "records.jsonl: lines that nobody can read: 1; their jobs may be missing here" in said
    assert "no job was sent" not in said


def test_a_restarted_job_counts_as_one_of_its_program(look: Callable[..., PastJob]) -> None:
    """(5.7) What it sent had another digest: a preamble and a part of the program."""
    with pytest.raises(JournalMismatch, match="no job of exactly this program"):
        look({"program_sha256": "00"}, {"program_sha256": "00", "restart": {"program_sha256": "11"}})
    whole = hashlib.sha256(PROGRAM).hexdigest()
    assert look({"job": "2026-9", "program_sha256": "00", "restart": {"program_sha256": whole}}).job == "2026-9"


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"outcome": "SENT"}, "how far the control came only it knows"),
        ({"machine": "another"}, "give --machine another"),
        ({"port": "socket://10.0.0.9:4001"}, "no job of this program through ttyUSB7"),
        ({"bytes_sent": 0}, "no job of exactly this program"),
    ],
)
def test_what_is_not_taken_up(look: Callable[..., PastJob], more: dict[str, Any], words: str) -> None:
    """(5.7; fault O4)"""
    with pytest.raises(JournalMismatch, match=words):
        look(more)


def test_a_job_that_still_runs_is_not_taken_up(look: Callable[..., PastJob], tmp_path: Path) -> None:
    """(5.7) Its journal lies there without a record, as that of a killed one does; its process lives."""
    look({})
    with subprocess.Popen([sys.executable, "-c", "input()", "dnc"], stdin=subprocess.PIPE) as running:
        folder = tmp_path / f"dnc/jobs/2027-{running.pid}"
        with closing(tape_of(tmp_path, PROGRAM)) as tape:
            sha = tape.program_sha256
        journal = Journal(folder / "journal", sha, 10, lambda: None)
        journal.open()
        journal.close(500, JobState.SENDING)
        (folder / "job.json").write_text(f'{{"program_sha256": "{sha}", "port": "{PORT}", "machine": "{MACHINE}"}}')
        with pytest.raises(JournalMismatch, match="is RUNNING; there is nothing to resume"):
            look()
        running.communicate(b"\n")
    assert (look().job, look().outcome) == (folder.name, "INTERRUPTED")


@pytest.mark.parametrize(
    ("doubt", "lines"),
    [([5, 9], (62, 66)), ([4, 4], (61, 61)), ([2, 10], (61, 67)), ([1, 3], (61, 61)), (None, (61, 61))],
)
def test_the_record_of_a_restart_is_read_in_lines_of_the_program(
    tmp_path: Path, doubt: list[int] | None, lines: tuple[int, int]
) -> None:
    """(5.7) It counts lines of what was sent: 3 of preamble, then the file from line 61 on; never before line 61."""
    restart = {"line": 61, "lines_before": 3}
    with closing(tape_of(tmp_path, PROGRAM)) as tape:
        past = PastJob("1", "ABORTED", {"in_doubt": doubt, "restart": restart})
        assert lines_in_doubt(past, tape, PROFILE) == lines
        whole = PastJob("1", "ABORTED", {"in_doubt": doubt})
        assert lines_in_doubt(whole, tape, PROFILE) == (tuple(doubt) if doubt else (1, 1))


def test_a_restart_point_at_the_first_line_in_doubt_is_early_enough(tmp_path: Path) -> None:
    """(6.8) The restart begins before its line; one that lies behind the first line in doubt never counts."""
    points = [Point(line) for line in (11, 25, 39)]
    assert [_last_point_before(points, line, tmp_path) for line in (11, 24, 25, 38, 39, 999)] == [
        11,
        11,
        25,
        25,
        39,
        39,
    ]
    with pytest.raises(JournalMismatch, match="no restart point lies before it"):
        _last_point_before(points, 10, tmp_path)
