"""A record that somebody changed, or a disk damaged, is told as that and hides no other job (5.7)."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path

import pytest

from dnc.cli.main import run_with
from dnc.errors import InputRejected, JournalMismatch
from dnc.events import JobState
from dnc.job import Job
from dnc.journal import Journal
from dnc.names import JobNames
from dnc.places import write_whole
from dnc.port import SerialPort
from dnc.profile import load_profile
from dnc.record import append_record
from dnc.resuming import plan_restart
from dnc.shipped import shipped_path
from dnc.spool import load_tape
from tests.helpers.line import PeerProcess, runtime_of, tape_of
from tests.helpers.restarts import planned

JOB = "20260101T000000.000000-1"


@pytest.mark.parametrize(
    "damage",
    [
        {"job": 5},
        {"outcome": ["SENT"]},
        {"bytes_sent": None, "bound_bytes": 7},
        {"job": None},
        {"bytes_total": None, "bound_bytes": 7},
        {"bytes_total": "9", "bound_bytes": 7, "alarms": 5, "restart": [1], "in_doubt": "12"},
    ],
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
    assert run_with(["jobs", JOB]) == 0
    assert f"{JOB}2" in capsys.readouterr().out
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


@pytest.mark.parametrize("text", [b"", b"{}", None])
def test_a_job_that_may_have_been_the_last_one_is_not_passed_over(
    tmp_path: Path, text: bytes | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """(5.7; fault H1) A power cut took the last job's description: an older job told where to restart, 400 lines on."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    program = planned(tmp_path, passes=40)
    profile = load_profile(shipped_path("machines", "sinumerik-840d"))
    with closing(load_tape(program, profile.tape, tmp_path / "spool")) as tape:
        older = {"job": f"{JOB}0", "outcome": "ABORTED", "program_sha256": tape.program_sha256, "in_doubt": [450, 460]}
        append_record(tmp_path / "state/dnc", older)
        plan = plan_restart(program, tape, ("mill", profile), None, None, port=None, is_forced=False)
        assert plan.doubt == (450, 460)
        folder = tmp_path / f"state/dnc/jobs/{JOB}1"
        journal = Journal(folder / "journal", tape.sha256, 10, lambda: None)
        journal.open()
        journal.close(1000, JobState.SENDING)
        if text is not None:
            (folder / "job.json").write_bytes(text)
        with pytest.raises(JournalMismatch, match=f"the job {JOB}1, later than {JOB}0, .* which program it sent"):
            plan_restart(program, tape, ("mill", profile), None, None, port=None, is_forced=False)


@pytest.mark.parametrize("is_gone", [False, True])
@pytest.mark.parametrize("start_at", ["N2", None])
def test_a_program_written_anew_meanwhile_is_no_program_to_restart(
    tmp_path: Path, is_gone: bool, start_at: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """(5.6, 5.7) The lines in doubt are those of the tape; planned again during a long --check they are others."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    program = planned(tmp_path, passes=40)
    profile = load_profile(shipped_path("machines", "sinumerik-840d"))
    with closing(load_tape(program, profile.tape, tmp_path / "spool")) as tape:
        older = {"job": f"{JOB}0", "outcome": "ABORTED", "program_sha256": tape.program_sha256, "in_doubt": [450, 460]}
        append_record(tmp_path / "state/dnc", older)
        planned(tmp_path, passes=41)
        if is_gone:
            program.unlink()
        with pytest.raises(InputRejected, match="is not there" if is_gone else "written anew"):
            plan_restart(program, tape, ("mill", profile), start_at, None, port=None, is_forced=False)


def test_what_was_checked_is_what_is_sent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(5.6) Planned again during a long --check, the new program was found good and the old one sent."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    program = planned(tmp_path, passes=40)
    monkeypatch.setattr("dnc.resuming.refuse_findings", lambda *_: planned(tmp_path, passes=41))
    assert run_with(["send", str(program), "--port", str(tmp_path / "none"), "--check"]) == 3
    assert "written anew while it was examined" in capsys.readouterr().err


@pytest.mark.parametrize("damage", [{"in_doubt": "x"}, {"in_doubt": [1]}, {"restart": {"line": 5}}])
def test_a_damaged_window_is_no_internal_fault(
    tmp_path: Path, damage: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """(5.7) A sentence, and the way that is left."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    program = planned(tmp_path, passes=40)
    profile = load_profile(shipped_path("machines", "sinumerik-840d"))
    with closing(load_tape(program, profile.tape, tmp_path / "spool")) as tape:
        record = {"job": JOB, "outcome": "ABORTED", "program_sha256": tape.program_sha256, "in_doubt": [450, 460]}
        append_record(tmp_path / "state/dnc", record | damage)
        with pytest.raises(JournalMismatch, match=f"the stopped job {JOB} is damaged; use --start-at"):
            plan_restart(program, tape, ("mill", profile), None, None, port=None, is_forced=False)


def test_what_a_job_is_lies_on_disk_before_its_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.7; fault H1) After a power cut the journal was there, and nobody knew of which program."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime_of(tmp_path)))
    profile = load_profile(shipped_path("machines", "sinumerik-840d"))
    written: list[tuple[str, bool, bool]] = []

    def write(path: Path, text: str, *, to_disk: bool = False) -> None:
        written.append((path.name, to_disk, (path.parent / "journal").exists()))
        write_whole(path, text, to_disk=to_disk)

    monkeypatch.setattr("dnc.job.write_whole", write)
    with closing(tape_of(tmp_path, b"G1 X1\nM30\n")) as tape, PeerProcess(baud=9600) as peer:
        job = Job(tape, SerialPort(peer.pty, profile.link), profile, JobNames(JOB, "part.mpf", "mill"), [])
        assert job.run().exit_code == 0
    assert written == [("job.json", True, False)]


@pytest.mark.parametrize("arguments", [["jobs"], ["jobs", "--json"], ["jobs", "--verify"]])
def test_a_record_that_cannot_be_read_is_neither_empty_nor_whole(
    tmp_path: Path, arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(5.7) It was listed as no jobs at all, and `--verify` called it whole."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    (tmp_path / "dnc/records.jsonl").mkdir(parents=True)  # root reads past missing rights, but never a folder
    assert run_with(arguments) == 9
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "records.jsonl: the record of jobs cannot be read: Is a directory; check its rights" in captured.err
