"""The check as a whole and rule by rule: clean programs, places, heights from a job, bounded memory, the command."""

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
from dnc.check.numbering import NumberSet
from dnc.check.run import Check, check_program
from dnc.cli.check import command
from dnc.cli.main import run_with
from dnc.errors import InputRejected
from dnc.profile import load_profile
from dnc.shipped import shipped_path
from planner.post.base import write_program
from planner.post.written import ControlLimits
from sim.interpreter import canon
from sim.interpreter.vocabulary import IGNORED_CODES, IGNORED_M, REFUSED_CODES
from tests.planner.post.paths import THESIS, job, polyline, spline, tool_path

PROFILE = load_profile(shipped_path("machines", "sinumerik-840d"))
HEAD = "%_N_T_MPF\nG17 G40 G64 G71 G90 G94\nG54\nG0 Z50\nT2 M6\nD1\nS1000 M3\nG4 F2\nG0 X0 Y0\nZ10\nG1 Z1 F100\n"
TAIL = "G0 Z50\nM5\nM30\n"


def ids(middle: str, limits: Limits | None = None, head: str = HEAD, tail: str = TAIL) -> list[tuple[str, int]]:
    check = Check(limits or Limits(PROFILE))
    for number, raw in enumerate((head + middle + tail).encode("latin-1").splitlines(keepends=True), 1):
        check.line(raw, number)
    check.finish()
    first = head.count("\n")
    return [(finding.id, finding.line - first) for finding in check.found.findings]


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


def test_a_clean_program_has_no_findings() -> None:
    assert ids("G1 X10 F250\nX20 Y5\nN99999999 X30\n") == []


@pytest.mark.parametrize(
    ("middle", "found"),
    [
        ("G1 X10 F250\nX40\nX18\nX50\n", [("reversal", 3)]),
        ("G1 X10 F250\nX10\n", [("zero-length", 2)]),
        ("G1 X10 F250\nG1 X20 Q1\nX30\n", [("unknown-word", 2)]),
        ("G1 X10 F250\nX20 Y\n", [("syntax", 2)]),
        ("G1 X10 F250\nG2 X20 Y0 I4 J0\n", [("arc-open", 2)]),
        ("G1 X10 F250\nG0 X20\n", [("rapid-below-clearance", 2)]),
        ("G1 X10 F250\nG1 Z3\nG0 X20\n", []),
        ("G1 X10 Z2 F250\nG0 X20 Z1.5\n", [("rapid-z-and-xy", 2), ("rapid-below-clearance", 2)]),
        ("G1 X10 F250\nG0 Z10\nG0 X20 Z12\n", [("rapid-z-and-xy", 3)]),
        ("G1 X10 F250\nG71\nG70\n", [("unit-switch", 3), ("axis-limit", 4)]),
        ("G1 X10 F150\n", [("steep-plunge", 0)]),
        ("G1 X10 F250\nX2000\n", [("axis-limit", 2)]),
        ("N5 G1 X10 F250\nN5 X20\n", [("number-duplicate", 2)]),
        ("N5 G1 X10 F250\nN4 X20\n", [("number-descending", 2)]),
        ("G1 X10 F250\nG43 H1\n", [("wrong-dialect", 2)]),
        ("G1 X10 F250 ; \x13\n", [("control-byte", 1)]),
        ("G1 X10 F250\nG1\n", [("empty-motion", 2)]),
        ("G1 X10 F250\nGOTOB AGAIN\n", [("jump", 2)]),
        ("G1 X10 F250\n%\n", [("stray-percent", 2)]),
        ("G1 X10 F250\nM30\nX20\n", [("after-end", 3), ("after-end", 3)]),
    ],
    ids=lambda value: value.replace("\n", "|") if isinstance(value, str) else "",
)
def test_each_rule(middle: str, found: list[tuple[str, int]]) -> None:
    """(6.10)"""
    got = ids(middle)
    assert list(dict.fromkeys(got)) == list(dict.fromkeys(found))


@pytest.mark.parametrize(
    ("middle", "name", "words"),
    [
        ("G1 X1O F250\n", "syntax", "the letter O stands in a number"),
        ("G1 X1 F250\nX2O.5\n", "syntax", "the letter O stands in a number"),
        ("G1 X10,5 F250\n", "syntax", "a comma stands in a number"),
        ("G1 X1.0.5 F250\n", "syntax", "a number has two points"),
        ("G1 X9 F250\nG2 X20 R10\n", "unknown-word", "CR=10 the radius"),
        ("G18 G2 X20 I5 J0 F250\n", "arc-open", "J is not of the working plane G18"),
        ("G1 X9 F250\nN20 X12 (second)\n", "wrong-dialect", "a comment in brackets"),
        ("G1 X9 F250\nG49\n", "wrong-dialect", "D0 takes the length off"),
        ("M5\nG95 G1 X9 F.1\n", "no-spindle", "a spindle that stands"),
        ("G1 X9 F250\rX20\n", "line-end", "CR stands without LF"),
        ("G1 X9 F.2\n", "odd-feed", "for each turn"),
        ("G0 Z5\nX9 F250\n", "feed-in-rapid", "G1 may have been lost"),
        ("G1 X9 F250\nG0 X0\n", "rapid-below-clearance", "no higher than the highest cut"),
        ("G0 Z10\nG1 Z-3 F100\nG0 Z-6\n", "rapid-below-clearance", "no higher than the highest cut"),
    ],
    ids=lambda value: value.replace("\n", "|") if isinstance(value, str) else "",
)
def test_slips_of_the_shop_are_told_in_its_words(middle: str, name: str, words: str) -> None:
    """(6.10)"""
    check = Check(Limits(PROFILE))
    check.chunk((HEAD + middle + TAIL).encode(), 1)
    (told,) = [one.sentence("") for one in check.finish().findings if one.id == name]
    assert words in told


def test_a_heidenhain_program_is_told_in_its_first_line() -> None:
    """(6.10)"""
    assert ("wrong-dialect", 1) in ids("", head="", tail="0 BEGIN PGM 7 MM\n1 L X+0 Y+0 R0 FMAX\n2 END PGM 7 MM\n")


def test_an_odd_feed_is_told_once_for_each_value() -> None:
    """(6.10) In bulk as block by block."""
    cuts = "".join(
        f"X{10 + 0.5 * step:.1f} F{250 if step < 30 else 90000 if step < 60 else 250}\n" for step in range(90)
    )
    text = HEAD + "G1\n" + cuts + cuts.replace("X", "Y") + TAIL
    check = Check(Limits(PROFILE))
    check.chunk(text.encode(), 1)
    in_bulk = [one.line for one in check.finish().findings if one.id == "odd-feed"]
    assert in_bulk == [line for name, line in ids(text, head="", tail="") if name == "odd-feed"]
    assert len(in_bulk) == 2


def test_a_hole_may_be_entered_again_in_rapid() -> None:
    """(6.10) Pecking written out: down to just above the bottom that the drill has made, and no deeper."""
    pecks = "G0 Z10\nX20\nG1 Z-3 F100\nG0 Z10\nZ{}\nG1 Z-6\n"
    assert ids(pecks.format("-2.5")) == []
    assert ("rapid-below-clearance", 5) in ids(pecks.format("-3.5"))
    assert ("rapid-below-clearance", 6) in ids(pecks.replace("Z{}", "X25\nZ-3.2"))


def test_machine_coordinates_say_nothing_about_heights() -> None:
    """(6.10) A part that stands on Z0: the retract to the machine's Z0 is no rapid into it, nor the height to clear."""
    found = ids(
        "G1 X10 F250\nX20\nX10\nG0 SUPA Z0 D0\nG0 X0 Y0\n", head=HEAD.replace("Z1 ", "Z30 ").replace("Z10", "Z40")
    )
    assert found == [("reversal", 3)]


def test_a_refused_block_leaves_no_cascade() -> None:
    """(6.10) What it would have set is not missed afterwards."""
    head = HEAD.replace("S1000 M3\n", "S1000 M3 Q1\n").replace("G0 Z50\n", "G43 G0 Z50\n")
    assert {name for name, _ in ids("G1 X10 F250\n", head=head)} == {"unknown-word", "wrong-dialect"}


def test_a_subprogram_need_not_ready_the_machine(tmp_path: Path) -> None:
    """(6.10) Tool, spindle and offset are its caller's."""
    text = "G1 Z-1 F100\nX10 F250\nG0 Z5\nM17\n"
    for name, head in (("side.spf", ""), ("side.mpf", "%_N_SIDE_SPF\n")):
        path = tmp_path / name
        path.write_text(head + text)
        names = {one.id for one in check_program(path, Limits(PROFILE)).found.findings}
        assert not names & {"no-tool", "no-spindle", "no-offset"}, name


def test_no_end_no_header_no_spindle_no_tool_no_feed() -> None:
    """(6.10)"""
    names = {name for name, _ in ids("", head="G0 Z50\nG1 X5\nG1 X5 F100\n", tail="")}
    assert {"no-end", "no-header", "no-spindle", "no-tool", "no-feed"} <= names


def test_dwell_is_missed_only_between_spindle_and_cut() -> None:
    """(2.4)"""
    assert ("no-spindle-dwell", 7 - 11) in ids("", head=HEAD.replace("G4 F2\n", "M8\n"))


def test_heights_and_stock_of_the_job() -> None:
    """A rapid below the clearance, and one whose axis box meets the stock though its line does not (6.10)."""
    with_job = Limits(PROFILE, clearance_z_mm=10.0, stock_box_mm=((0, 0, -20), (50, 50, 4)))
    assert ("rapid-below-clearance", 2) in ids("G0 Z10\nG0 Z5\n", with_job)
    crossing = ids("G0 Z10\nG0 X-5 Y-5\nG0 Z3\nG0 Y60\nG0 X60 Y-5\n", with_job)
    assert ("rapid-through-stock", 5) in crossing
    assert ("rapid-through-stock", 4) not in crossing


def test_the_line_rate_at_100_and_120_percent() -> None:
    """The worst 2 s window against what the line carries (6.10)."""
    dense = "".join(f"X{0.1 * number:.4f}Z{1 + 0.001 * (number % 3):.4f}\n" for number in range(1, 2000))
    assert ("line-too-slow", 1) in [(name, 1) for name, _ in ids("G1 F6000\n" + dense)]
    assert not [name for name, _ in ids("G1 F200\n" + dense) if name == "line-too-slow"]


def test_spline_blocks() -> None:
    """Too few, and PL in some of them only (6.10)."""
    short = ids("BSPLINE X5 Z2 PL=0 F250\nX10 PL=1\nX15 PL=0\nG1 X20\n")
    assert ("spline-blocks", 1) in short
    odd = ids("BSPLINE X5 Z2 PL=0 F250\n" + "".join(f"X{number}\n" for number in range(6, 12)) + "G1 X20\n")
    assert ("spline-blocks", 1) in odd


def test_after_an_alarm_the_rest_is_checked_in_the_same_state() -> None:
    """One refused block does not hide the next fault, and the state carries over (6.10)."""
    found = ids("TRANS X5\nG1 X10 F250\nX20 Q1\nX40\nX22\nX60\n")
    assert found == [("unknown-word", 3), ("reversal", 5)]


def test_variables_and_open_structures_outlive_an_alarm() -> None:
    """(6.10) One refused block brings no findings about what was defined or opened before it."""
    found = ids("DEF REAL WIDTH=5\nIF WIDTH>1\nG1 X10 Q1 F250\nX=WIDTH*4 F250\nENDIF\n")
    assert found == [("unknown-word", 3)]


def test_jumps_are_named_as_they_are_written() -> None:
    """(6.10)"""
    check = Check(Limits(PROFILE))
    check.chunk((HEAD + "LOOP\nREPEAT\nREPEATB HERE\nREPEAT HERE\nFOR R1=1 TO 2\n").encode(), 1)
    told = [one.text.split()[0] for one in check.finish().findings if "cannot be run" in one.text]
    assert told == ["LOOP", "REPEAT", "REPEATB", "REPEAT", "FOR"]


def test_an_end_that_a_jump_passes_over_is_an_end() -> None:
    """(6.10)"""
    assert {name for name, _ in ids("G1 X10 F250\nGOTOF NOWHERE\n")} == {"jump", "alarm"}


def test_an_inch_machine_has_inches_from_the_start() -> None:
    """(6.2, 6.10) There G71, not G70, is the switch; travel is checked in millimetres all the same."""
    control = msgspec.structs.replace(PROFILE.control, units="inch")
    inch = Limits(msgspec.structs.replace(PROFILE, control=control))
    head = (
        HEAD.replace(" G71", "").replace("F100", "F4").replace("Z50", "Z2").replace("Z10", "Z.5").replace("Z1 ", "Z.1 ")
    )
    body = "G1 X1 F10\n{}\nX3\n"
    assert ids(body.format("G70"), inch, head, "G0 Z2\nM5\nM30\n") == []
    assert ("unit-switch", 2) in ids(body.format("G71"), inch, head, "G0 Z2\nM5\nM30\n")
    assert ("axis-limit", 2) in ids("G1 X1 F10\nX50\n", inch, head, "G0 Z2\nM5\nM30\n")


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


@given(st.lists(st.integers(0, 10**7), max_size=30), st.integers(0, 10**7))
@settings(max_examples=30, deadline=None)
def test_number_set(numbers: list[int], asked: int) -> None:
    seen = NumberSet()
    for number in numbers:
        seen.add(number)
    assert (asked in seen) == (asked in numbers)
    assert all(number in seen for number in numbers)


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
    """Without a job G41 is an alarm, with one the tool runs beside the contour, checked and simulated (6.2, 6.10)."""
    path, motion = tmp_path / "part.mpf", tmp_path / "motion.csv"
    path.write_text(HEAD.replace("G54\n", "G54\nTRANS Z20\n") + "G1 G41 X10 Y0 F250\nX20\nG40 X30 Y9\n" + TAIL)
    assert run_with(["check", str(path)]) == 3
    capsys.readouterr()
    assert run_with(["check", str(path), "--job", str(THESIS)]) == 0
    assert capsys.readouterr().out == "17 blocks: 0 errors, 0 warnings, 0 notes\n"
    assert run_with(["simulate", str(path), "--job", str(THESIS), "--pitch", "5", "--motion", str(motion)]) == 0
    assert "4.000000" in {row.split(",")[2] for row in motion.read_text().splitlines()}


def test_words_are_checked_as_the_page_of_the_language_says() -> None:
    """(6.5, 6.10) Column `checked` of docs/dialects.md."""
    plain = ids("")
    for code in (*IGNORED_CODES, *(f"M{number}" for number in IGNORED_M)):
        assert ids(f"{code}\n") == plain, code
    for word in (*REFUSED_CODES, "M77", "G777", "NOSUCH=1"):
        assert ("unknown-word", 1) in ids(f"{word}\n"), word


def test_other_dialects_are_not_checked_as_if_they_were_this_one(tmp_path: Path) -> None:
    """(6.10)"""
    program = tmp_path / "part.nc"
    program.write_text("%\nO1\nM30\n%\n")
    control = msgspec.structs.replace(PROFILE.control, dialect="fanuc")
    with pytest.raises(InputRejected, match="not built yet"):
        check_program(program, Limits(msgspec.structs.replace(PROFILE, control=control)))
