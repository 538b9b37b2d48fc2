import csv
import json
from pathlib import Path

import jsonschema
import pytest

from dnc.check.limits import Limits
from dnc.check.run import check_program
from dnc.cli.main import run_with
from dnc.profile import load_profile, profile_path

ROOT = Path(__file__).parents[2]
JOB = ROOT / "configs/jobs/thesis.toml"
SCHEMA = json.loads((ROOT / "docs/schemas/simulate.schema.json").read_text())
PROGRAM = b"""\
N10 G17 G90 G54 G71
N20 T2 M6
N30 G0 Z50
N40 G0 X10 Y10
N50 G1 Z3 F500
N60 G1 X40 F250
N70 G0 Z50
N80 M30
"""


def simulate(tmp_path: Path, data: bytes, *options: str) -> tuple[int, dict[str, object]]:
    program = tmp_path / "part.mpf"
    program.write_bytes(data)
    report = tmp_path / "report.json"
    code = run_with(["simulate", str(program), "--report", str(report), *options])
    return code, json.loads(report.read_text())


def test_report_has_the_promised_keys(tmp_path: Path) -> None:
    """(1.5) The report of a cut part follows its schema; one pass covers only a strip."""
    code, report = simulate(tmp_path, PROGRAM, "--job", str(JOB), "--pitch", "0.5")
    jsonschema.validate(report, SCHEMA)
    assert code == 0
    assert report["is_completed"]
    assert report["blocks"] == 8
    assert 0.0 < report["coverage"] < 0.2


@pytest.mark.parametrize("z_mm", ["3", "30"])
def test_a_scallop_beside_places_that_were_not_cut_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], z_mm: str
) -> None:
    """(1.5) A good scallop stood in the first line of a part that was cut on a strip, 0 um on one that was not cut."""
    data = PROGRAM.replace(b"G1 Z3", b"G1 Z" + z_mm.encode())
    _, report = simulate(tmp_path, data, "--job", str(JOB), "--pitch", "0.5")
    text = capsys.readouterr().out
    scallop, coverage = (next(line for line in text.splitlines() if line.startswith(at)) for at in ("scall", "cover"))
    assert coverage.endswith("; on all else stands more than 1 mm of material")
    assert ("only" in scallop) == (z_mm == "3")
    assert ("none measured" in scallop) == (z_mm == "30")
    assert report["coverage"] < 1


def test_without_a_job_nothing_is_measured(tmp_path: Path) -> None:
    """(1.5) Time is measured, the surface is not invented."""
    code, report = simulate(tmp_path, PROGRAM)
    jsonschema.validate(report, SCHEMA)
    assert code == 0
    assert "scallop_mm" not in report
    assert report["machining_time_s"] > 30 / 250 * 60


def test_subprograms_lie_beside_the_program(tmp_path: Path) -> None:
    """(6.4) As `dnc check` has it."""
    (tmp_path / "SUB.spf").write_bytes(b"G1 X30 F250\nRET\n")
    code, report = simulate(tmp_path, PROGRAM.replace(b"N60 G1 X40 F250", b'N60 EXTCALL("SUB")'))
    assert (code, report["alarms"]) == (0, [])
    limits = Limits(load_profile(profile_path("sinumerik-840d")))
    assert not [
        one for one in check_program(tmp_path / "part.mpf", limits).found.findings if one.id == "missing-subprogram"
    ]


def test_an_alarm_is_told_and_exits_6(tmp_path: Path) -> None:
    """(interface, section 6) A block the control refuses: its line in the report, exit code 6."""
    code, report = simulate(tmp_path, PROGRAM.replace(b"G1 X40", b"G777 X40"))
    jsonschema.validate(report, SCHEMA)
    assert code == 6
    assert report["alarms"][0]["line"] == 6
    assert not report["is_completed"]


def test_motion_log_and_picture(tmp_path: Path) -> None:
    """(1.6) The log has the tool tip in the named columns, corner rounded by 0.01 mm at most; the picture is a PNG."""
    motion, plot = tmp_path / "motion.csv", tmp_path / "map.png"
    simulate(tmp_path, PROGRAM, "--job", str(JOB), "--pitch", "0.5", "--motion", str(motion), "--plot", str(plot))
    with motion.open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["t_s", "x_mm", "y_mm", "z_mm", "feed_mm_min", "line", "block"]
    cutting = [row for row in rows if row["line"] == "6"]
    assert float(cutting[-1]["x_mm"]) == pytest.approx(40.0, abs=0.5)
    assert all(min(float(row["z_mm"]) - 3.0, float(row["x_mm"]) - 10.0) <= 0.01 for row in cutting)
    assert {row["z_mm"] for row in cutting if float(row["x_mm"]) > 10.1} == {"3.000000"}
    assert plot.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("name", "words"), [("absent.mpf", "is not there"), (".", "is a directory"), ("empty.mpf", "is empty")]
)
def test_a_program_that_cannot_be_read_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, words: str
) -> None:
    """(2.7) Exit 3 and one sentence, nothing written."""
    report = tmp_path / "report.json"
    (tmp_path / "empty.mpf").touch()
    assert run_with(["simulate", str(tmp_path / name), "--report", str(report)]) == 3
    assert words in capsys.readouterr().err
    assert not report.exists()


def test_a_profile_that_the_sender_refuses_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """(2.7) A mistyped key was passed over in silence, and the default taken."""
    profile, program = tmp_path / "mine.toml", tmp_path / "part.mpf"
    text = profile_path("virtual-mill").read_text()
    profile.write_text(text.replace("lookahead_blocks", "look_ahead_blocks"))
    program.write_bytes(PROGRAM)
    assert run_with(["simulate", str(program), "--machine", str(profile)]) == 8
    assert "look_ahead_blocks" in capsys.readouterr().err


def test_a_picture_needs_the_design(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """(2.7) --plot without --job is refused before anything is simulated."""
    assert run_with(["simulate", str(tmp_path / "part.mpf"), "--plot", "map.png"]) == 2
    assert "--job" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["simulate", "part.mpf", "--report", "part.mpf"], "part.mpf: is read by this command and would be lost"),
        (["simulate", "part.mpf", "--motion", "a.csv", "--report", "a.csv"], "a.csv: would be written twice"),
        (["check", "part.mpf", "--sheet", "none/sheet.html"], "none/sheet.html: its folder does not exist"),
    ],
)
def test_what_cannot_be_written_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    """(2.7) A report that turns out unwritable after an hour of cutting is lost work; one over the program is worse."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.mpf").write_bytes(PROGRAM)
    assert run_with(words) == 3
    assert said in capsys.readouterr().err
    assert (tmp_path / "part.mpf").read_bytes() == PROGRAM
