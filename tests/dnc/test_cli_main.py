"""The rim of the command line: every error is one sentence with its exit code, never a traceback."""

from __future__ import annotations

from pathlib import Path

import click
import pytest

from dnc.cli import main
from dnc.errors import PortUnavailable
from dnc.shipped import shipped_names, shipped_path
from planner.errors import ExitCode, SettingsRejected


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
    assert capsys.readouterr().err == "dnc: no such command 'sned'; see dnc --help\n"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["send", "part.mpf"], "dnc: give --port PORT, or --dry-run for the virtual mill; see dnc send --help\n"),
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


def test_unknown_machine_lists_the_known(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SettingsRejected, match=r"known: .*sinumerik-840d"):
        shipped_path("machines", "sinumerik-840")
    assert "thesis" in shipped_names("jobs")
