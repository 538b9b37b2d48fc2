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


@pytest.fixture
def own_machines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's folder of profiles, with one of his own in it: `mine`."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    folder = tmp_path / "dnc/machines"
    folder.mkdir(parents=True)
    (folder / "mine.toml").write_bytes(shipped_path("machines", "virtual-mill").read_bytes())
    return folder


@pytest.mark.parametrize("command", ["plan", "check", "simulate", "split"])
def test_every_command_knows_the_users_machines(command: str, own_machines: Path, tmp_path: Path) -> None:
    """(2.7) What `dnc machines` lists can be named everywhere."""
    program = tmp_path / "part.mpf"
    program.write_text("N10 G0 G90 G17 Z50\nN20 M30\n")
    job = shipped_path("jobs", "thesis")
    words = {
        "plan": ["plan", str(job), "-o", str(program), "--knot-test"],
        "check": ["check", str(program)],
        "simulate": ["simulate", str(program)],
        "split": ["split", str(program), "-o", str(tmp_path / "parts"), "--job", str(job)],
    }
    assert main.run_with([*words[command], "--machine", "mine"]) == ExitCode.OK


def test_a_profile_of_a_shipped_name_is_said_not_to_be_used(
    own_machines: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """(Interface, section 1) The shipped ones go first; whoever wrote another of that name must hear of it."""
    own = own_machines / "sinumerik-840d.toml"
    own.write_text("[link\n")
    assert main.run_with(["check", "absent.mpf"]) == ExitCode.REJECTED
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith(f"dnc: warning: {own} is not used: the shipped profile sinumerik-840d goes first; ")
    assert said[1].startswith("dnc: absent.mpf: is not there")


def test_a_port_for_every_day(
    own_machines: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(Interface, section 1) From variable or file; a dry run is meant all the same."""
    program = tmp_path / "part.mpf"
    program.write_text("N10 M30\n")
    (own_machines.parent / "settings.toml").write_text('port = "/dev/of-the-user"\nstart_timeout = 5\n')
    assert main.run_with(["send", str(program)]) == ExitCode.PORT
    assert capsys.readouterr().err.startswith("dnc: /dev/of-the-user: ")
    monkeypatch.setenv("DNC_PORT", "/dev/of-the-environment")
    assert main.run_with(["send", str(program)]) == ExitCode.PORT
    assert capsys.readouterr().err.startswith("dnc: /dev/of-the-environment: ")
    assert main.run_with(["send", "absent.mpf", "--dry-run"]) == ExitCode.REJECTED
    assert main.run_with(["send", str(program), "--dry-run", "--port", "/dev/x"]) == ExitCode.USAGE


def test_empty_settings_say_nothing(own_machines: Path) -> None:
    """(2.7)"""
    (own_machines.parent / "settings.toml").write_bytes(b"")
    assert main.run_with(["machines"]) == ExitCode.OK


def test_settings_come_in_their_order(
    own_machines: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(Interface, section 1) Option, environment, user's file, system's file, default; each key by itself."""
    monkeypatch.setenv("XDG_CONFIG_DIRS", f"{tmp_path / 'etc'}:/nowhere")
    monkeypatch.delenv("DNC_MACHINE", raising=False)
    system, user = tmp_path / "etc/dnc/settings.toml", own_machines.parent / "settings.toml"
    system.parent.mkdir(parents=True)

    def asked(*words: str) -> str:
        """The machine that a command looks for; none of these names is known."""
        assert main.run_with(["check", "part.mpf", *words]) == ExitCode.SETTINGS
        return capsys.readouterr().err.split("'")[1]

    system.write_text('machine = "of-the-system"\nbaud = 4800\n')
    assert asked() == "of-the-system"
    user.write_text('machine = "of-the-user"\n')
    assert asked() == "of-the-user"
    monkeypatch.setenv("DNC_MACHINE", "of-the-environment")
    assert asked() == "of-the-environment"
    assert asked("--machine", "of-the-option") == "of-the-option"
    user.write_text('machin = "mine"\n')
    assert main.run_with(["machines"]) == ExitCode.SETTINGS
    assert capsys.readouterr().err == f"dnc: {user}:1: unknown key machin; did you mean machine?\n"
    assert main.run_with(["--help"]) == ExitCode.OK


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("baud = -5", "baud: is out of range; write a whole number >= 50"),
        ('format = "9N1"', "format: has another form; "),
    ],
)
def test_a_setting_that_cannot_be_meant_is_told_where_it_stands(
    line: str, words: str, own_machines: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """(Interface, section 6) The file is wrong, not the command line."""
    user = own_machines.parent / "settings.toml"
    user.write_text(f"# ours\n{line}\n")
    assert main.run_with(["send", "part.mpf", "--port", "/dev/ttyUSB0"]) == ExitCode.SETTINGS
    assert capsys.readouterr().err.startswith(f"dnc: {user}:2: {words}")


@pytest.mark.parametrize("value", ["abc", "0"])
def test_a_wrong_variable_is_called_by_its_name(
    value: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(Interface, section 6)"""
    monkeypatch.setenv("DNC_BAUD", value)
    assert main.run_with(["send", "part.mpf", "--port", "/dev/ttyUSB0"]) == ExitCode.SETTINGS
    said = capsys.readouterr().err
    assert said.startswith("dnc: DNC_BAUD: ")
    assert said.endswith("; mend or unset it\n")
    assert main.run_with(["send", "part.mpf", "--port", "/dev/ttyUSB0", "--baud", "0"]) == ExitCode.USAGE


def test_a_broken_profile_hides_no_other(own_machines: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """(2.7)"""
    (own_machines / "worn.toml").write_text("[link\n")
    assert main.run_with(["machines"]) == ExitCode.SETTINGS
    said = capsys.readouterr()
    assert "mine" in said.out
    assert "sinumerik-840d" in said.out
    assert said.err.startswith(f"dnc: {own_machines}/worn.toml:1:")
    assert said.err.count("\n") == 1


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


def test_nobody_reads_the_output_any_more() -> None:
    """(2.7) `dnc machines | head -1`: ended as by the signal that other programs die of, without a word."""
    child = subprocess.Popen([sys.executable, "-m", "dnc", "machines"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert child.stdout is not None
    assert child.stderr is not None
    child.stdout.close()
    assert child.stderr.read() == b""
    assert child.wait() == 128 + signal.SIGPIPE
    child.stderr.close()


def test_a_full_disk_behind_the_output_is_a_sentence() -> None:
    """(2.7) `dnc machines > file` on a full disk."""
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [sys.executable, "-m", "dnc", "machines"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == ExitCode.REJECTED
    assert done.stderr == (
        "dnc: the output cannot be written: No space left on device; free some space and run it again\n"
    )


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("poly_degree = 4", "control.poly_degree: '4' is no choice; write one of 3, 5"),
        (
            "knot_rule_verified = true",
            "control.knot_rule_verified: true is no choice; write one of false, a date such as 2026-11-26",
        ),
        ('knot_rule_verified = "yes"', "control.knot_rule_verified: is no date; write one such as 2026-11-26"),
    ],
)
def test_a_wrong_choice_lists_the_choices(
    line: str, sentence: str, own_machines: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """(2.7) Choices that are no words: numbers, false, a date."""
    profile = own_machines / "mine.toml"
    kept = [old for old in profile.read_text().splitlines() if old.split(" ")[0] != line.split(" ", maxsplit=1)[0]]
    kept.insert(kept.index("[control]") + 1, line)
    profile.write_text("\n".join(kept))
    assert main.run_with(["check", "part.mpf", "--machine", "mine"]) == ExitCode.SETTINGS
    assert sentence in capsys.readouterr().err


def test_a_mistyped_machine_is_asked_back(own_machines: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """(2.7)"""
    assert main.run_with(["check", "part.mpf", "--machine", "mime"]) == ExitCode.SETTINGS
    assert "did you mean mine? known: five-axis-840d, mine, " in capsys.readouterr().err


def test_unknown_machine_lists_the_known(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SettingsRejected, match=r"known: .*sinumerik-840d"):
        shipped_path("machines", "sinumerik-840")
    assert "thesis" in shipped_names("jobs")
