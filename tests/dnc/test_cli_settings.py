"""Settings and machine profiles at the command line: which goes first, and what is wrong with them is told."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dnc.cli import main
from dnc.shipped import shipped_names, shipped_path
from planner.errors import ExitCode, SettingsRejected


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


def test_the_check_reckons_with_the_baud_rate_that_send_would_take(
    own_machines: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(Interface, section 1) DNC_BAUD=300 was sent at, and a program far too fast for it was found to be fine."""
    program = tmp_path / "part.mpf"
    blocks = "".join(f"G1 X{n % 2}.001 Y0.{n:04d} F1200\n" for n in range(300))
    program.write_text(f"G0 G90 G17 G54 Z50\nT1 D1 M6\nS1000 M3\n{blocks}M30\n")
    main.run_with(["check", str(program)])
    assert "line-too-slow" not in capsys.readouterr().out
    monkeypatch.setenv("DNC_BAUD", "300")
    main.run_with(["check", str(program)])
    assert "line-too-slow" in capsys.readouterr().out
    monkeypatch.delenv("DNC_BAUD")
    (own_machines.parent / "settings.toml").write_text("baud = 300\n")
    main.run_with(["check", str(program)])
    assert "line-too-slow" in capsys.readouterr().out


@pytest.mark.parametrize("origin", ["option", "variable", "file"])
def test_the_plan_reckons_with_the_line_that_send_would_take(
    origin: str,
    own_machines: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """(Interface, section 1) Who sends at DNC_BAUD=300 was told of no pass that starves: the profile says 9600."""
    words = ["plan", str(shipped_path("jobs", "thesis")), "-o", str(tmp_path / "part.mpf")]
    assert main.run_with(words) == ExitCode.OK
    assert "starve" not in capsys.readouterr().err
    if origin == "variable":
        monkeypatch.setenv("DNC_BAUD", "300")
    elif origin == "file":
        (own_machines.parent / "settings.toml").write_text("baud = 300\n")
    assert main.run_with([*words, *(["--baud", "300"] if origin == "option" else [])]) == ExitCode.OK
    assert "at 300 baud and 100 % override the line feeds" in capsys.readouterr().err


def test_the_plan_reckons_with_a_second_stop_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """(Interface, section 1) With DNC_FORMAT=8N2 a line carries a tenth fewer characters than the profile's 8N1."""
    report = tmp_path / "plan.json"
    words = ["plan", str(shipped_path("jobs", "thesis")), "-o", str(tmp_path / "part.mpf"), "--report", str(report)]
    limits = []
    for form in ("8N1", "8N2"):
        monkeypatch.setenv("DNC_FORMAT", form)
        assert main.run_with([*words, "--baud", "500"]) == ExitCode.OK
        limits.append(json.loads(report.read_text())["feed_limit_mm_min"]["500"]["100"])
    assert limits[1] < 0.95 * limits[0]


def test_the_check_reckons_with_a_second_stop_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """(Interface, section 1) Eleven bits a character, not ten."""
    program = tmp_path / "part.mpf"
    blocks = "".join(f"G1 X{n % 2}.001 Y0.{n:04d} F1200\n" for n in range(300))
    program.write_text(f"G0 G90 G17 G54 Z50\nT1 D1 M6\nS1000 M3\n{blocks}M30\n")
    monkeypatch.setenv("DNC_FORMAT", "8N2")
    main.run_with(["check", str(program), "--baud", "330"])
    assert "the line at 330 baud carries 30" in capsys.readouterr().out


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


def test_a_mistyped_machine_is_asked_back(own_machines: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """(2.7)"""
    assert main.run_with(["check", "part.mpf", "--machine", "mime"]) == ExitCode.SETTINGS
    assert "did you mean mine? known: five-axis-840d, mine, " in capsys.readouterr().err
    assert main.run_with(["doctor", "--machine", "mime"]) == ExitCode.SETTINGS  # which passed it over without --port


def test_unknown_machine_lists_the_known(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SettingsRejected, match=r"known: .*sinumerik-840d"):
        shipped_path("machines", "sinumerik-840")
    assert "thesis" in shipped_names("jobs")


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
