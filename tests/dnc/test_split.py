"""Parts of a program: size, completeness, the same cuts in the same order."""

from __future__ import annotations

from pathlib import Path

import click
import msgspec
import pytest
from click.testing import CliRunner

from dnc.check.limits import Limits
from dnc.check.run import Check
from dnc.cli.split import command
from dnc.errors import InputRejected, SettingsRejected
from dnc.preamble import Heights
from dnc.profile import load_profile
from dnc.shipped import shipped_path
from dnc.split import split_program
from planner.post.base import write_program
from planner.post.stamp import read_stamp
from planner.post.written import ControlLimits
from sim.interpreter import canon
from sim.interpreter.run import interpret
from tests.planner.post.paths import THESIS, job, polyline, spline, tool_path

HEIGHTS = Heights(safe_z_mm=50.0, clearance_z_mm=10.0, plunge_mm_min=100.0, dwell_s=2.0, retract_z_mm=400.0)


def program(blocks: str = "poly", count: int = 12) -> bytes:
    made = job(blocks=blocks)
    shapes = [spline(number, inner=2) for number in range(count)]
    return write_program(made, made.operation[0], tool_path(shapes), ControlLimits(retract_z_mm=400.0)).data


def cuts(data: bytes) -> list[canon.Command]:
    found = list(interpret(data))
    assert isinstance(found[-1], canon.End)
    kinds = (canon.Line, canon.Polynomial)
    return [msgspec.structs.replace(one, line=0, block=None) for one in found if isinstance(one, kinds)]


@pytest.mark.parametrize("blocks", ["poly", "bspline"])
@pytest.mark.parametrize("most_bytes", [900, 1100])
def test_parts_cut_what_the_whole_cuts(blocks: str, most_bytes: int) -> None:
    """Cut at pass ends to the control's memory, each part complete (6.8)."""
    data = program(blocks)
    parts = split_program(data, most_bytes, HEIGHTS)
    assert len(parts) > 2
    assert all(len(part.data) <= most_bytes for part in parts)
    assert [cut for part in parts for cut in cuts(part.data)] == cuts(data)
    assert [part.first_line for part in parts[1:]] == [part.last_line + 1 for part in parts[:-1]]


@pytest.mark.parametrize(
    ("before", "behind", "told"),
    [
        ("AGAIN:", "R1=R1+1\nIF R1<2 GOTOB AGAIN", r"part 2, lines \d+ to \d+ of the program, would stop .* AGAIN"),
        ("AGAIN:", "REPEAT AGAIN P=1", r"part 2, lines \d+ to \d+ of the program, would stop .* AGAIN"),
        ("AGAIN:", "R1=R1+1\nIF R1<2 GOTOC AGAIN", "the program makes 63 moves at feed, its parts 31: a jump crosses"),
    ],
)
def test_a_jump_back_over_a_cut_is_refused(before: str, behind: str, told: str) -> None:
    """(6.8) The control would find no label, in the middle of the work; parts that hold both are allowed."""
    passes = "".join(f"G0 Z20\nG0 X{x}\nG1 Z-1 F100\nY{x}\n" for x in range(16)) + "G0 Z20\n"
    data = f"T1 D1 M6\nG54\nS1000 M3\nG0 Z20\n{before}\n{passes}{behind}\nM30\n".encode()
    with pytest.raises(InputRejected, match=told):
        split_program(data, 420, HEIGHTS)
    apart = f"T1 D1 M6\nG54\nS1000 M3\nG0 Z20\n{passes}{before}\nG0 Z20\nX5\n{behind}\nM30\n".encode()
    assert len(split_program(apart, 420, HEIGHTS)) > 1


def test_every_part_is_clean_stamped_and_named() -> None:
    """A part passes the check by itself and keeps the stamp (6.8, 6.10)."""
    for number, part in enumerate(split_program(program(), 1200, HEIGHTS), 1):
        assert part.data.startswith(b"%%_N_5000_%d_MPF\n" % number)
        stamp = read_stamp(part.data)
        assert stamp is not None
        assert stamp.reference == "tip"
        check = Check(Limits(load_profile(shipped_path("machines", "sinumerik-840d")), clearance_z_mm=10.0))
        for line, raw in enumerate(part.data.splitlines(keepends=True), 1):
            check.line(raw, line)
        assert check.finish().findings == []


def test_parts_of_an_inch_program_cut_the_same() -> None:
    """(6.8) Heights of preamble and end are in millimetres whatever the program's unit."""
    made = job(blocks="linear")
    shapes = [polyline(number) for number in range(9)]
    limits = ControlLimits(retract_z_mm=400.0, is_inch=True)
    data = write_program(made, made.operation[0], tool_path(shapes), limits).data
    parts = split_program(data, 1200, HEIGHTS)
    assert len(parts) > 2
    assert [cut for part in parts for cut in cuts(part.data)] == cuts(data)
    for part in parts:
        heights = [one.end[2] for one in interpret(part.data) if isinstance(one, canon.Rapid)]
        assert max(heights) == pytest.approx(400.0, abs=1e-3)
        assert any(50.0 <= height < 50.001 for height in heights)


def test_what_fits_stays_whole() -> None:
    data = program(count=2)
    assert [part.data for part in split_program(data, len(data), HEIGHTS)] == [data]
    assert [part.data for part in split_program(b"M30\n", 200, HEIGHTS)] == [b"M30\n"]  # it was told to have no LF


def test_a_part_ends_as_high_as_the_job_says_under_a_frame_that_lowers_z() -> None:
    """(6.8) Z50 of a frame that lies 40 mm lower is no safe height to go away at."""
    passes = "".join(f"G0 Z50\nG0 X{x} Y0\nG1 Z-1 F100\nX{x + 1}\n" for x in range(12))
    data = f"G54\nT2 M6\nD1\nS1000 M3\nG0 Z60\nX0 Y0\nTRANS Z-40\n{passes}G0 Z90\nM30\n".encode()
    parts = split_program(data, 400, HEIGHTS)
    assert len(parts) > 1
    assert b"\nG0 Z90\nM9\nM5\n" in parts[0].data


def test_why_no_place_is_one_to_cut_at_is_told() -> None:
    """(6.8)"""
    data = program().replace(b"G54", b"R2=R1+1\nG54")
    with pytest.raises(InputRejected, match=r"next clear place; line \d+: the program reads R1 before"):
        split_program(data, 900, HEIGHTS)


def test_a_pass_too_long_is_refused() -> None:
    with pytest.raises(InputRejected, match="do not fit into 300 bytes"):
        split_program(program(), 300, HEIGHTS)


def test_a_program_without_line_feeds_is_refused() -> None:
    """(2.7) Blocks that end by CR alone raised a ValueError behind a header."""
    with pytest.raises(InputRejected, match="has no LF between its blocks"):
        split_program(program().replace(b"\n", b"\r"), 1000, HEIGHTS)


def test_command_writes_the_parts(tmp_path: Path) -> None:
    path = tmp_path / "part.mpf"
    path.write_bytes(program())
    arguments = [str(path), "-o", str(tmp_path), "--job", str(THESIS), "--bytes", "1000"]
    shown = CliRunner().invoke(command, arguments, standalone_mode=False)
    assert shown.return_value == 0, shown.output
    assert len(list(tmp_path.glob("part-*.mpf"))) == len(shown.output.splitlines()) > 2


@pytest.mark.parametrize(("at", "is_told"), [(3, True), (-2, False)])
def test_blocks_that_the_panel_may_skip_are_told(at: int, tmp_path: Path, *, is_told: bool) -> None:
    """(6.8) A frame behind a / stood in all preambles; at a control that skips it the first part was cut without."""
    lines = program().splitlines(keepends=True)
    lines.insert(at, b"/M8\n")
    path = tmp_path / "part.mpf"
    path.write_bytes(b"".join(lines))
    arguments = [str(path), "-o", str(tmp_path), "--job", str(THESIS), "--bytes", "1000"]
    said = CliRunner().invoke(command, arguments, standalone_mode=False).stderr
    assert (f"line {at + 1} begins with /" in said) == is_told
    assert (said == "") != is_told


def test_no_byte_of_a_long_line_is_lost(tmp_path: Path) -> None:
    """A line beyond what the check holds in memory reaches its part whole (6.8)."""
    data = b";" + 400_000 * b"A" + b"\n" + program()
    path = tmp_path / "part.mpf"
    path.write_bytes(data)
    arguments = [str(path), "-o", str(tmp_path), "--job", str(THESIS), "--bytes", "1000000"]
    assert CliRunner().invoke(command, arguments, standalone_mode=False).return_value == 0
    assert (tmp_path / "part-1.mpf").read_bytes() == data


def test_parts_of_an_earlier_split_are_told(tmp_path: Path) -> None:
    """(2.7) They have the names of parts of this one, and are of another program or other cuts."""
    source, parts = tmp_path / "p.mpf", tmp_path / "parts"
    source.write_bytes(program())
    job_words = ["--job", str(THESIS)]

    def said(most_bytes: int) -> str:
        arguments = [str(source), "-o", str(parts), "--bytes", str(most_bytes), *job_words]
        return CliRunner().invoke(command, arguments, standalone_mode=False).stderr

    assert said(600) == ""
    before = sorted(path.name for path in parts.iterdir())
    assert len(before) > 2
    assert said(1 << 20) == (
        f"dnc: warning: {parts} still holds parts of an earlier split, p-2.mpf to p-{len(before)}.mpf; remove them\n"
    )
    assert sorted(path.name for path in parts.iterdir()) == before


def test_what_is_no_program_is_not_cut(tmp_path: Path) -> None:
    """(2.7, 5.6) Parts go to a control as they are: what `dnc send` refuses is refused here."""
    source, parts = tmp_path / "p.mpf", tmp_path / "parts"
    source.write_bytes(b"\x7fELF\0\x13" + bytes(range(256)))
    arguments = [str(source), "-o", str(parts), "--job", str(THESIS)]
    with pytest.raises(InputRejected, match=r"p\.mpf:1:1: "):
        CliRunner().invoke(command, arguments, standalone_mode=False, catch_exceptions=False)
    assert not parts.exists()


def test_a_retract_beyond_the_travel_is_refused(tmp_path: Path) -> None:
    """(2.7)"""
    source = tmp_path / "p.mpf"
    source.write_bytes(program())
    arguments = [str(source), "-o", str(tmp_path), "--job", str(THESIS), "--retract-z", "501"]
    with pytest.raises(click.UsageError, match="--retract-z 501 is beyond the travel of Z, -500 to 500 mm"):
        CliRunner().invoke(command, arguments, standalone_mode=False, catch_exceptions=False)


@pytest.mark.parametrize(("most_bytes", "code"), [(400, 8), (60_000, 0)])
def test_no_preamble_goes_to_a_control_of_another_language(most_bytes: int, code: int, tmp_path: Path) -> None:
    """(6.8) A FANUC got parts that begin with G60 G710 and TRANS; a program that fits needs no preamble."""
    machine, whole = tmp_path / "fanuc.toml", tmp_path / "part.nc"
    text = shipped_path("machines", "sinumerik-840d").read_text()
    machine.write_text(text.replace('dialect = "sinumerik"', 'dialect = "fanuc"'))
    whole.write_text("G17 G40 G90 G94\nG54\nT2 M6\nG0 Z50\n" + "G0 X1 Y0\nG1 Z-1 F100\nG0 Z10\n" * 40 + "M30\n")
    words = [str(whole), "-o", str(tmp_path / "parts"), "--job", str(THESIS), "--machine", str(machine)]
    ran = CliRunner().invoke(command, [*words, "--bytes", str(most_bytes)])
    if code:
        assert isinstance(ran.exception, SettingsRejected)
        assert "reads fanuc" in str(ran.exception)
        assert not (tmp_path / "parts").exists() or not list((tmp_path / "parts").iterdir())
    else:
        assert ran.exit_code == 0, ran.output
