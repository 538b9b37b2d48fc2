"""What the system refuses or the shell has closed is one sentence too, and changes no exit code (2.7)."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import click
import pytest

from dnc.cli import main
from dnc.cli._options import File
from dnc.shipped import shipped_path
from planner.errors import ExitCode


def test_a_full_disk_behind_the_output_is_a_sentence() -> None:
    """(2.7) `dnc machines > file` on a full disk; not 3, which says that a program was refused."""
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [sys.executable, "-m", "dnc", "machines"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == ExitCode.SETTINGS
    assert done.stderr == (
        "dnc: the output cannot be written: No space left on device; free some space and run it again\n"
    )


@pytest.mark.parametrize(
    ("words", "code"), [(["machines"], 0), (["check", "absent.mpf"], 3), (["send", "absent.mpf"], 2)], ids=str
)
@pytest.mark.parametrize("where", ["/dev/full", "closed", "nobody reads", "takes no more now"])
def test_a_lost_stderr_changes_no_exit_code(words: list[str], code: int, where: str) -> None:
    """(2.7) `2> file` on a full disk ended every command that had to complain with 120."""
    read, write = os.pipe()
    reader = os.fdopen(read, "rb")
    if where == "/dev/full":
        os.dup2(full := os.open(where, os.O_WRONLY), write)
        os.close(full)
    if where == "takes no more now":  # as a terminal that another program has set not to block
        os.set_blocking(write, False)
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(write, b"x" * 4096)
    else:
        reader.close()
    command = [sys.executable, "-m", "dnc", *words]
    if where == "closed":
        command = ["/bin/sh", "-c", 'exec "$@" 2>&-', "sh", *command]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=write, check=False)
    os.close(write)
    reader.close()
    assert done.returncode == code


def test_closed_streams_take_no_number_that_a_port_would_get() -> None:
    """(fault O2) What is opened behind a closed stderr must not be what messages are written to."""
    opened = "from dnc.standard_streams import open_standard_streams; open_standard_streams()"
    probe = f"{opened}; import os, sys; sys.exit(os.open('/', 0) < 3)"
    done = subprocess.run(["/bin/sh", "-c", f'exec {sys.executable} -c "{probe}" >&- 2>&- <&-'], check=False)
    assert done.returncode == 0


LONG = "x" * 300


@pytest.mark.parametrize(
    "words",
    [
        ["check", LONG], ["simulate", LONG], ["send", LONG, "--port", "/dev/null"], ["measure", LONG, "--job", LONG],
        ["split", LONG, "--job", "job.toml", "-o", "parts"], ["split", "part.mpf", "--job", "job.toml", "-o", LONG],
        ["plan", "job.toml", "-o", LONG], ["plan", LONG, "-o", "part.mpf"], ["check", "part.mpf", "--machine", LONG],
        ["mill", "--programs", LONG], ["mill", "--report", LONG], ["check", "round", "--sheet", "round"],
        ["simulate", "round"], ["send", "round", "--port", "/dev/null"], ["plan", "job.toml", "-o", "round"],
        ["simulate", "part.mpf", "--motion", "round"], ["check", "a\nb\x1b[2J.mpf"],
    ],
    ids=lambda words: " ".join(words).replace(LONG, "x..."),
)  # fmt: skip
def test_a_name_that_cannot_be_looked_up_is_a_sentence(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(2.7) Names that are too long and links that run in a circle were faults of ours."""
    monkeypatch.chdir(tmp_path)
    thesis = shipped_path("jobs", "thesis")
    job = thesis.read_text().replace("../surfaces", str(thesis.parents[1] / "surfaces"))
    Path("job.toml").write_text(job)
    Path("part.mpf").write_text("M30\n")
    Path("round").symlink_to("round")
    assert main.run_with(words) in (ExitCode.REJECTED, ExitCode.SETTINGS)
    said = capsys.readouterr().err
    assert said.startswith("dnc: ")
    assert (said.count("\n"), "fault" in said, "\x1b" in said) == (1, False, False)


@pytest.mark.parametrize(
    "words",
    [
        ["check", ""], ["send", "", "--dry-run"], ["plan", "job.toml", "-o", ""], ["demo", "--out", ""],
        ["plan", "job.toml", "-o", "part.mpf", "--knot-test", "--json"],
        ["plan", "job.toml", "-o", "part.mpf", "--knot-test", "--report", "r.json"],
        ["simulate", "part.mpf", "--pitch", "1"], ["status", "--count", "2"], ["check", "part.mpf", "--baud", "x"],
    ],
    ids=" ".join,
)  # fmt: skip
def test_what_means_nothing_is_usage(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(2.7) An empty name was the working folder, which `demo --out ""` filled; other options were passed over."""
    monkeypatch.chdir(tmp_path)
    assert main.run_with(words) == ExitCode.USAGE
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "integer range" not in said
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_may_not_be_looked_into_is_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(2.7) Settings in a folder of another user ended every command with a fault of ours."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / LONG))
    assert main.run_with(["machines"]) == ExitCode.SETTINGS
    assert capsys.readouterr().err.endswith("settings.toml: File name too long; check the name and the rights\n")


def test_without_a_home_folder_a_sentence_says_what_to_set(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(2.7) A user of a container, without HOME and entry in /etc/passwd, got a traceback."""

    def none() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", none)
    for name in ("XDG_CONFIG_HOME", "XDG_STATE_HOME"):
        monkeypatch.delenv(name, raising=False)
    assert main.run_with(["machines"]) == ExitCode.SETTINGS
    assert capsys.readouterr().err == "dnc: this user has no home folder; set HOME, or XDG_CONFIG_HOME\n"

    @click.command()
    def broken() -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(main, "program", broken)
    assert main.run_with([]) == ExitCode.INTERNAL
    assert capsys.readouterr().err == "dnc: internal fault: ZeroDivisionError: division by zero\n"


def test_help_is_there_whatever_the_settings_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(2.7) `dnc send --help` complained of settings.toml."""
    (tmp_path / "dnc").mkdir()
    (tmp_path / "dnc/settings.toml").write_text('baud = "fast"\n')
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert main.run_with(["send", "--help"]) == ExitCode.OK
    assert "--hold-timeout" in capsys.readouterr().out
    assert main.run_with(["machines"]) == ExitCode.SETTINGS


def test_who_reads_a_file_says_whether_it_can() -> None:
    """(2.7) A program without rights to read it was a wrong command line (exit 2), where a missing one is exit 3."""
    assert not File().readable


@pytest.mark.parametrize("words", [["check"], ["simulate"], ["split", "--bytes", "200", "--job", "JOB", "-o", "parts"]])
def test_no_name_acts_on_the_terminal(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(N7) What a file is called went to the terminal as it is, escape sequences and bytes that are no text too."""
    monkeypatch.chdir(tmp_path)
    name = "a\x1b[31m\udcff.mpf"
    Path(name).write_text("G0 G90 G17 Z50\nM30\n")
    job = str(shipped_path("jobs", "thesis"))
    main.run_with([words[0], name, *(job if word == "JOB" else word for word in words[1:])])
    said = capsys.readouterr()
    assert "\x1b" not in said.out + said.err
    assert "internal fault" not in said.err


def test_a_sheet_of_a_program_whose_name_is_no_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """(2.7) A name from an old disk, in another coding, was an internal fault."""
    program = tmp_path / "caf\udce9.mpf"
    program.write_text("G0 G90 G17 G54 Z50\nT1 D1 M6\nS1000 M3\nG1 X1 Z-1 F100\nG0 Z50\nM30\n")
    main.run_with(["check", str(program), "--sheet", str(tmp_path / "sheet.html")])
    assert "internal fault" not in capsys.readouterr().err
    assert "Setup sheet: caf?.mpf" in (tmp_path / "sheet.html").read_text()
