"""The check as a whole: clean programs, what follows an alarm, profile and job, bounded memory, the command."""

from __future__ import annotations

import json
import tracemalloc
from pathlib import Path

import msgspec
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from dnc.check.limits import Limits
from dnc.check.run import Check, check_program
from dnc.cli.check import command
from dnc.cli.main import run_with
from dnc.errors import InputRejected
from planner.post.base import write_program
from planner.post.written import ControlLimits
from sim.interpreter import canon
from tests.dnc.check.programs import HEAD, PROFILE, TAIL, ids
from tests.planner.post.paths import THESIS, job, polyline, spline, tool_path


@pytest.mark.parametrize("blocks", ["poly", "bspline", "linear"])
@pytest.mark.parametrize("retract_z_mm", [None, 400.0])
def test_our_own_programs_are_clean(tmp_path: Path, blocks: str, retract_z_mm: float | None) -> None:
    """Nothing to find in what the post writes, with the job's heights and stock known (6.8, 6.10)."""
    made = job(blocks=blocks)
    shapes = [polyline(1), polyline(2)] if blocks == "linear" else [spline(1), spline(2)]
    path = tmp_path / "part.mpf"
    limits = ControlLimits(retract_z_mm=retract_z_mm)
    path.write_bytes(write_program(made, made.operation[0], tool_path(shapes), limits).data)
    setup = made.setup
    done = check_program(path, Limits(PROFILE, setup.clearance_z_mm, setup.stock_box_mm))
    assert done.found.findings == []


def test_after_an_alarm_the_rest_is_checked_in_the_same_state() -> None:
    """One refused block does not hide the next fault, and the state carries over (6.10)."""
    found = ids("TRANS X5\nG1 X10 F250\nX20 Q1\nX40\nX22\nX60\n")
    assert found == [("unknown-word", 3), ("reversal", 5)]


def test_variables_and_open_structures_outlive_an_alarm() -> None:
    """(6.10) One refused block brings no findings about what was defined or opened before it."""
    found = ids("DEF REAL WIDTH=5\nIF WIDTH>1\nG1 X10 Q1 F250\nX=WIDTH*4 F250\nENDIF\n")
    assert found == [("unknown-word", 3)]


def test_memory_stays_bounded(tmp_path: Path) -> None:
    """Four times the program, the same memory (6.10)."""
    peaks = []
    for count in (20_000, 80_000):
        path = tmp_path / f"{count}.mpf"
        with path.open("w") as file:
            file.write(HEAD)
            for number in range(count):
                file.write(f"N{number + 1} G1 X{number % 50 + 1}.{number % 7} Y{number % 3} F{250 + number % 2}\n")
        tracemalloc.start()
        done = check_program(path, Limits(PROFILE))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert done.track.blocks > count
    assert peaks[1] < 1.2 * peaks[0] + 100_000


def test_a_file_of_rubbish_ends_soon() -> None:
    """After a hundred refused blocks motions are no longer followed, and that is said (6.10)."""
    found = ids("G1 X10 Q1 F250\n" * 500)
    assert ("not-checked", 100) in found
    assert sum(name == "unknown-word" for name, _ in found) == 20


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_mutated_programs_never_crash_the_check(data: st.DataObject) -> None:
    """Cut, doubled and overwritten bytes: findings, never an exception (2.7, 6.6)."""
    program = bytearray((HEAD + 'POLY PO[X]=(10,1,.5)PO[Z]=(2,.3)F250\nG2 X20 CR=9\nMSG("A")\n' + TAIL).encode())
    for _ in range(data.draw(st.integers(1, 8))):
        at = data.draw(st.integers(0, len(program) - 1))
        piece = data.draw(st.binary(max_size=3))
        program[at : at + data.draw(st.integers(0, 3))] = piece
        if not program:
            program = bytearray(b"\n")
    check = Check(Limits(PROFILE))
    for number, raw in enumerate(bytes(program).splitlines(keepends=True), 1):
        check.line(raw, number)
    check.finish()
    for finding in check.found.findings:
        assert "\n" not in finding.sentence("x")


def test_command_exits_3_on_errors_and_0_without(tmp_path: Path) -> None:
    """(6.10, interface 6)"""
    good, bad = tmp_path / "good.mpf", tmp_path / "bad.mpf"
    good.write_text(HEAD + "G1 X10 F250\n" + TAIL)
    bad.write_text(HEAD + "G1 X10 Q5 F250\n" + TAIL)
    assert CliRunner().invoke(command, [str(good)], standalone_mode=False).return_value == 0
    shown = CliRunner().invoke(command, [str(bad), "--json", "--job", str(THESIS)], standalone_mode=False)
    assert shown.return_value == 3
    assert json.loads(shown.stdout)["errors"] == 1


@pytest.mark.parametrize("make", ["absent", "folder", "empty"])
def test_bad_files_are_one_sentence(tmp_path: Path, make: str, capsys: pytest.CaptureFixture[str]) -> None:
    """(2.7)"""
    path = tmp_path / "part.mpf"
    if make == "folder":
        path.mkdir()
    elif make == "empty":
        path.write_bytes(b"")
    assert run_with(["check", str(path)]) == 3
    assert capsys.readouterr().err.count("\n") == 1


def test_subprograms_are_looked_for_beside_the_program(tmp_path: Path) -> None:
    """(6.10)"""
    program = tmp_path / "main.mpf"
    program.write_text(HEAD + "G1 X10 F250\nSIDE\nX20\n" + TAIL)
    assert "unknown-word" in {finding.id for finding in check_program(program, Limits(PROFILE)).found.findings}
    (tmp_path / "SIDE.SPF").write_text("G1 X15\nM17\n")
    assert check_program(program, Limits(PROFILE)).found.findings == []


def test_what_the_manuals_leave_open_comes_from_the_profile() -> None:
    """Knot rule, G28 and the alarm of a jump back (6.4, 6.10)."""
    spline = "G1 X10 F250\nBSPLINE X20 PL={0}\nX30 PL={1}\nX40 PL={1}\nX50 PL={1}\nX60 PL={1}\nX70 PL={0}\nG1 X80\n"

    def check(middle: str, **keys: object) -> list[int]:
        heard: list[canon.Command] = []
        control = msgspec.structs.replace(PROFILE.control, **keys)
        checked = Check(Limits(msgspec.structs.replace(PROFILE, control=control)), watch=heard.append)
        checked.chunk((HEAD + middle + TAIL).encode(), 1)
        checked.finish()
        return [command.number for command in heard if isinstance(command, canon.Alarm)]

    nx, genua = spline.format(0, 5), spline.format(5, 5).replace("X60 PL=5\nX70 PL=5", "X60 PL=0\nX70 PL=0")
    assert check(nx) == [] == check(genua, knot_rule="genua")
    assert 14290 in check(nx, knot_rule="genua")
    assert check("AGAIN: G1 X10 F250\nGOTOB AGAIN\n", backward_jump_alarm=14013) == [14013]
    assert check("G28 X0\n") == []
    assert check("G28 X0\n", g28="alarm") == [12470]


def test_the_job_gives_the_radii_that_compensation_needs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a job G41 is noted, with one the tool runs beside the contour, checked and simulated (6.2, 6.10)."""
    path, motion = tmp_path / "part.mpf", tmp_path / "motion.csv"
    path.write_text(HEAD.replace("G54\n", "G54\nTRANS Z20\n") + "G1 G41 X10 Y0 F250\nX20\nG40 X30 Y9\n" + TAIL)
    assert run_with(["check", str(path)]) == 0
    assert "note radius-unknown: the radius of tool T2" in capsys.readouterr().out
    assert run_with(["check", str(path), "--job", str(THESIS)]) == 0
    assert capsys.readouterr().out == "17 blocks: 0 errors, 0 warnings, 0 notes\n"
    assert run_with(["simulate", str(path), "--job", str(THESIS), "--pitch", "5", "--motion", str(motion)]) == 0
    assert "4.000000" in {row.split(",")[2] for row in motion.read_text().splitlines()}


def test_other_dialects_are_not_checked_as_if_they_were_this_one(tmp_path: Path) -> None:
    """(6.10)"""
    program = tmp_path / "part.nc"
    program.write_text("%\nO1\nM30\n%\n")
    control = msgspec.structs.replace(PROFILE.control, dialect="fanuc")
    with pytest.raises(InputRejected, match="not built yet"):
        check_program(program, Limits(msgspec.structs.replace(PROFILE, control=control)))
