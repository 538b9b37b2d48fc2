"""The rim of the command line: every error is one sentence with its exit code, never a traceback."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import click
import pytest

from dnc.cli import main
from dnc.errors import PortUnavailable
from dnc.shipped import shipped_path
from planner.errors import ExitCode


def _fail_with(error: Exception) -> click.Command:
    @click.command()
    def command() -> None:
        raise error

    return command


def test_user_error_becomes_its_sentence(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(main, "program", _fail_with(PortUnavailable("/dev/ttyUSB0 is absent; plug it in")))
    assert main.run_with([]) == ExitCode.PORT
    assert capsys.readouterr().err == "dnc: /dev/ttyUSB0 is absent; plug it in\n"


def test_internal_fault_is_a_sentence_and_a_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(main, "program", _fail_with(ZeroDivisionError("division by zero")))
    assert main.run_with([]) == ExitCode.INTERNAL
    shown = capsys.readouterr().err
    assert "Traceback" not in shown
    assert shown.count("\n") == 1
    assert "ZeroDivisionError" in (tmp_path / "dnc/fault.txt").read_text()


def test_no_command_shows_the_commands(capsys: pytest.CaptureFixture[str]) -> None:
    """(2.7)"""
    assert main.run_with([]) == ExitCode.USAGE
    assert "\nCommands:\n" in capsys.readouterr().err


def test_unknown_command_is_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run_with(["sned"]) == ExitCode.USAGE
    assert capsys.readouterr().err == "dnc: no such command 'sned'; did you mean send? see dnc --help\n"
    assert main.run_with(["xyzzy"]) == ExitCode.USAGE
    assert capsys.readouterr().err == "dnc: no such command 'xyzzy'; see dnc --help\n"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["send", "part.mpf"], "dnc: give --port PORT, or --dry-run for the virtual mill; see dnc send --help\n"),
        (
            ["send", "part.mpf", "--port", "/dev/ttyUSB0", "--speed", "2"],
            "dnc: --speed goes with --dry-run; a real control keeps its own time; see dnc send --help\n",
        ),
        (["send", "part.mpf", "--port"], "dnc: option '--port' requires an argument; see dnc send --help\n"),
        (
            ["plan", "job.toml", "-o", "p.mpf", "--workers", "2"],
            "dnc: --workers is not built yet; see dnc plan --help\n",
        ),
        (
            ["send", "part.mpf", "--dry-run", "--format", "9N1"],
            "dnc: invalid value for '--format': 9N1 is no format of a line, such as 8N1 or 7E2; see dnc send --help\n",
        ),
        (
            ["split", "part.mpf", "--job", "job.toml", "-o", ""],
            "dnc: invalid value for '-o' / '--output': the name of the folder is empty; see dnc split --help\n",
        ),
        (["serve"], "dnc: serve is not built yet; see dnc --help\n"),
        (
            ["console"],
            "dnc: the console needs a terminal; dnc status --watch reads the same too; see dnc console --help\n",
        ),
        (
            ["mill", "--speed", "0"],
            "dnc: invalid value for '--speed': 0.0 is not in the range 0.001<=x<=100000; see dnc mill --help\n",
        ),
    ],
)
def test_a_wrong_command_line_is_one_sentence(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """(2.7) What is wrong and where its help is, not the whole usage."""
    assert main.run_with(words) == ExitCode.USAGE
    assert capsys.readouterr().err == sentence


@pytest.mark.parametrize(
    "words",
    [
        ["plan", "job.toml", "-o", "part.mpf", "--lift"],
        ["simulate", "part.mpf", "--pitch"],
        ["split", "part.mpf", "-o", "parts", "--job", "job.toml", "--retract-z"],
        ["send", "part.mpf", "--dry-run", "--speed"],
        ["send", "part.mpf", "--dry-run", "--start-timeout"],
        ["send", "part.mpf", "--dry-run", "--hold-timeout"],
        ["receive", "--port", "/dev/null", "-o", ".", "--wait"],
        ["receive", "--port", "/dev/null", "-o", ".", "--silence"],
        ["test-handshake", "--port", "/dev/null", "--yes", "--resume-wait"],
        ["mill", "--speed"],
        ["mill", "--probe-pitch"],
        ["demo", "--speed"],
        ["demo", "--window"],
    ],
    ids=" ".join,
)
@pytest.mark.parametrize("number", ["nan", "inf", "1e308"])
def test_a_number_that_is_none_is_usage(words: list[str], number: str, capsys: pytest.CaptureFixture[str]) -> None:
    """(2.7)"""
    assert main.run_with([*words, number]) == ExitCode.USAGE
    said = capsys.readouterr().err
    assert said.startswith(f"dnc: invalid value for '{words[-1]}': ")
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "lost"),
    [
        (["send", "part.mpf", "--dry-run", "--report", "part.mpf"], "part.mpf"),
        (["send", "part.mpf", "--dry-run", "--report", "part.mpf.json"], "part.mpf.json"),
        (["send", "part.mpf", "--dry-run", "--job", "job.toml", "--report", "job.toml"], "job.toml"),
        (["send", "part.mpf", "--dry-run", "--report", "/dev/null"], "/dev/null"),
        (["measure", "points.csv", "--job", "job.toml", "--report", "points.csv"], "points.csv"),
        (["mill", "--nominal", "job.toml", "--report", "job.toml"], "job.toml"),
    ],
    ids=" ".join,
)
def test_a_report_takes_nothing_away(
    words: list[str], lost: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(2.7) `send --report part.mpf` put the report in the program's place, and a device's."""
    monkeypatch.chdir(tmp_path)
    thesis = shipped_path("jobs", "thesis")
    job = thesis.read_text().replace("../surfaces", str(thesis.parents[1] / "surfaces"))
    for name, text in {"part.mpf": "M30\n", "part.mpf.json": "{}", "points.csv": "x_mm", "job.toml": job}.items():
        Path(name).write_text(text)
    before = Path(lost).read_bytes()
    assert main.run_with(words) == ExitCode.REJECTED
    assert capsys.readouterr().err.startswith(f"dnc: {lost}: is ")
    assert Path(lost).read_bytes() == before


def test_a_state_folder_that_cannot_be_made_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(2.7) It was taken for a mark of a job that had been cut off: exit 9, reset the control."""
    (tmp_path / "file").write_text("")
    (tmp_path / "part.mpf").write_text("M30\n")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    assert main.run_with(["send", str(tmp_path / "part.mpf"), "--port", "/dev/null"]) == ExitCode.SETTINGS
    said = capsys.readouterr().err
    assert said.startswith(f"dnc: {tmp_path}/file/dnc: the folder for journal and records cannot be made: ")
    assert said.endswith("; set XDG_STATE_HOME to a folder of yours\n")


def test_a_pitch_too_fine_is_refused_before_anything_is_cut(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """(2.7) The mill took the whole program first, and then had nothing to measure it with."""
    job = str(shipped_path("jobs", "thesis"))
    assert main.run_with(["mill", "--nominal", job, "--probe-pitch", "0.001"]) == ExitCode.REJECTED
    assert capsys.readouterr().err.startswith("dnc: a probe pitch of 0.001 mm takes ")
    (tmp_path / "bad.mpf").write_text("XYZ\n")
    words = ["simulate", str(tmp_path / "bad.mpf"), "--job", job, "--pitch", "0.001"]
    assert main.run_with(words) == ExitCode.REJECTED


@pytest.mark.parametrize(
    "words", [["mill", "--nominal", "JOB", "--probe-pitch"], ["simulate", "bad.mpf", "--job", "JOB", "--pitch"]]
)
def test_a_pitch_too_coarse_is_refused(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(3.2) At 1000 mm 4 probes said that all was covered, and 71 um of a scallop of 80."""
    monkeypatch.chdir(tmp_path)
    Path("bad.mpf").write_text("M30\n")
    job = str(shipped_path("jobs", "thesis"))
    assert main.run_with([job if word == "JOB" else word for word in [*words, "8.1"]]) == ExitCode.REJECTED
    assert "8.1 mm is wider than the cutter, 8 mm" in capsys.readouterr().err


def test_nobody_reads_the_output_any_more() -> None:
    """(2.7) `dnc machines | head -1`: ended as by the signal that other programs die of, without a word."""
    child = subprocess.Popen([sys.executable, "-m", "dnc", "machines"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert child.stdout is not None
    assert child.stderr is not None
    child.stdout.close()
    assert child.stderr.read() == b""
    assert child.wait() == 128 + signal.SIGPIPE
    child.stderr.close()
