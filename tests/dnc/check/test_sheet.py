"""The setup sheet of a bare program."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from dnc.check.finding import Collection, Finding, Severity
from dnc.check.limits import Limits
from dnc.check.sheet import SheetWatch, program_sheet
from dnc.cli.check import command
from dnc.cli.main import run_with
from dnc.profile import load_profile
from dnc.shipped import shipped_path
from sim.interpreter import canon
from sim.interpreter.run import interpret

THESIS = Path(__file__).parents[2] / "golden/thesis-5000.mpf"


def test_sheet_of_the_thesis_program(tmp_path: Path) -> None:
    """(2.6): extents, tool, times; findings come first."""
    sheet = tmp_path / "sheet.html"
    done = CliRunner().invoke(command, [str(THESIS), "--sheet", str(sheet)], standalone_mode=False)
    assert done.return_value == 3
    page = sheet.read_text()
    assert "1.260 to 50.000 mm" in page
    assert "<td>T2</td>" in page
    assert "13.29 mm backwards" in page
    assert page.count("<polyline") >= 25
    assert re.search(r"Cutting time</th><td>0:0[45]:", page)


def test_nothing_cut_nothing_written(tmp_path: Path) -> None:
    program, sheet = tmp_path / "p.mpf", tmp_path / "sheet.html"
    program.write_text("G0 Z50\nM30\n")
    assert run_with(["check", str(program), "--sheet", str(sheet)]) == 3
    assert not sheet.exists()


def test_extents_and_picture_follow_arcs() -> None:
    """(2.6) Their ends alone were looked at: a full circle was a point, and a bow in XZ had no lowest Z."""
    watch = SheetWatch(Limits(load_profile(shipped_path("machines", "sinumerik-840d"))))
    program = b"G17 G54 G0 Z50\nZ5\nG1 Z0 F100\nX20\nG3 I-20\nG18 G3 X0 I-10 K0\nG0 Z50\nM30\n"
    for one in interpret(program):
        watch(one)
    assert [*watch.low, *watch.high] == pytest.approx([-20.0, -20.0, -10.0, 20.0, 20.0, 0.0], abs=1e-9)
    drawn = np.vstack(watch.lines)
    assert [drawn[:, 0].min(), drawn[:, 1].max(), drawn[:, 2].min()] == pytest.approx([-20.0, 20.0, -10.0], abs=0.2)


TWO_STROKES = b"""G17 G54 G90
T3 M6
S1200 M4
G4 F2
G0 Z50
X0 Y0
Z5
G1 Z-1 F100
X30 F600
Y20 F300
G0 Z50
G1 Z10 F900
X60
G0 Z5
T4 M6
S800 M3
T3 M6
G1 Z-1 F100
X70 F500
M30
"""


def watched(program: bytes) -> SheetWatch:
    watch = SheetWatch(Limits(load_profile(shipped_path("machines", "sinumerik-840d"))))
    for one in interpret(program):
        watch(one)
    return watch


def test_what_the_sheet_gathers() -> None:
    """(2.6) Largest spindle speed and feed of the cuts, each tool once, cuts apart from ways in air, dwells."""
    watch = watched(TWO_STROKES)
    assert (watch.tools, watch.spindle_rpm, watch.feed_mm_min) == ([3, 4], 1200.0, 600.0)
    assert (watch.cut_mm, watch.cutting_s) == (60.0, pytest.approx(30 / 10 + 20 / 5 + 10 * 60 / 500))
    assert watch.air_s - watched(TWO_STROKES.replace(b"G4 F2\n", b"")).air_s == pytest.approx(2.0)
    assert [*watch.low, *watch.high] == [0.0, 0.0, -1.0, 70.0, 20.0, -1.0]
    assert [line.tolist() for line in watch.lines] == [
        [[0.0, 0.0, -1.0], [30.0, 0.0, -1.0], [30.0, 20.0, -1.0]],
        [[60.0, 20.0, -1.0], [70.0, 20.0, -1.0]],
    ]


def test_the_picture_follows_a_spline_to_its_end_and_no_rapid() -> None:
    """(2.6)"""
    rows = ((-10.0, 0.0, 0.0), (10.0, 0.0, 0.0), (0.0, 10.0, 0.0))
    watch = watched(b"")
    watch(canon.Polynomial(2, None, (-10.0, 0.0, 0.0), (0.0, 10.0, 0.0), rows, (1.0,), 1.0, 1200.0))
    watch(canon.Rapid(3, None, (0.0, 10.0, 0.0), (50.0, 0.0, 5.0)))
    watch(canon.Line(4, None, (50.0, 0.0, 0.0), (60.0, 0.0, 0.0), 600.0))
    line, behind = watch.lines
    assert behind.tolist() == [[50.0, 0.0, 0.0], [60.0, 0.0, 0.0]]
    assert [line[0].tolist(), line[-1].tolist()] == [[-10.0, 0.0, 0.0], [0.0, 10.0, 0.0]]
    assert np.allclose(line[4], (-5.0, 2.5, 0.0))


def test_the_sheet_tells_errors_first_each_kind_once_and_what_the_line_must_carry(tmp_path: Path) -> None:
    """(2.6) Notes are for `dnc check` alone."""
    program, found = tmp_path / "part.mpf", Collection()
    program.write_bytes(TWO_STROKES)
    kinds = [("w", Severity.WARNING, 1), ("n", Severity.NOTE, 2), *(("e", Severity.ERROR, line) for line in (3, 4, 5))]
    found.add(Finding(name, severity, line, 1, f"text {name}", "", "") for name, severity, line in kinds)
    page = program_sheet(program, watched(TWO_STROKES), found, 20, need_bytes_s=123.0, machining_s=None)
    assert page is not None
    assert 0 < page.index("line 3: text e (and 2 more of this kind)") < page.index("line 1: text w<")
    assert "text n" not in page
    assert f"at least {len(TWO_STROKES) / 960:.0f} s at 9600 baud" in page
    assert "worst 2 s at 120 % override: 123 of 960 bytes/s" in page


def test_picture_stays_bounded() -> None:
    """(6.10)"""
    watch = SheetWatch(Limits(load_profile(shipped_path("machines", "sinumerik-840d"))))
    for number in range(60_000):
        start, end = ((number + step) % 500 * 0.1 for step in (0, 1))
        watch(canon.Line(1, None, (start, 0.0, 0.0), (end, 0.0, 0.0), 250.0))
    assert sum(map(len, watch.lines)) < 20_000


def test_both_sheets_of_one_program_tell_the_same_time(tmp_path: Path) -> None:
    """(2.6, 7.8) The sheet of the plan and that of the check know the machine's own time."""
    program, planned, checked = (tmp_path / name for name in ("part.mpf", "plan.html", "check.html"))
    job = str(shipped_path("jobs", "thesis"))
    assert run_with(["plan", job, "-o", str(program), "--sheet", str(planned)]) == 0
    assert run_with(["check", str(program), "--sheet", str(checked)]) == 0
    times = [re.findall(r"(?:Cutting|Air) time</th><td>([0-9:]+)", page.read_text()) for page in (planned, checked)]
    assert len(times[0]) == 2
    assert times[0] == times[1]


@pytest.mark.parametrize(("calls", "said"), [("G54\nG55\nG54\n", "G54, G55"), ("", "none is called in the program")])
def test_the_sheet_names_the_work_offsets(calls: str, said: str, tmp_path: Path) -> None:
    """(2.6) "As in the program" does not help who has to set it."""
    program, sheet = tmp_path / "part.mpf", tmp_path / "sheet.html"
    program.write_text(f"{calls}G0 G90 G17 Z50\nT1 D1 M6\nS1000 M3\nG1 X1 Z-1 F100\nG0 Z50\nM30\n")
    run_with(["check", str(program), "--sheet", str(sheet)])
    assert f"Work offset</th><td>{said}</td>" in sheet.read_text()


def test_the_job_tells_the_sheet_zero_point_and_tools(tmp_path: Path) -> None:
    """(2.6) Without it they are not given."""
    bare, told = tmp_path / "bare.html", tmp_path / "told.html"
    assert run_with(["check", str(THESIS), "--sheet", str(bare)]) == 3
    assert run_with(["check", str(THESIS), "--sheet", str(told), "--job", str(shipped_path("jobs", "thesis"))]) == 3
    assert "ball, diameter 8 mm, 2 flutes, edge D1</td><td>at least 60 mm" in told.read_text()
    assert "corner of the billet" in told.read_text()
    assert bare.read_text().count("not given") == 3
    assert "not given" not in told.read_text()
