"""The SINUMERIK post: shape of the program, digits, restart points, refusals."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import re
from pathlib import Path

import jsonschema
import pytest

from planner.errors import InputRejected
from planner.post.base import write_program
from planner.post.sinumerik import work_offset
from planner.post.stamp import read_stamp
from planner.post.written import ControlLimits
from tests.planner.post.paths import job, polyline, spline, tool_path

LIMITS = ControlLimits(retract_z_mm=400.0)
SCHEMA = Path(__file__).parents[3] / "docs/schemas/sidecar.schema.json"


def written(shapes, limits=LIMITS, angle_rad=0.0, deviation_mm=0.0009, lift_mm=0.0, **post):
    made = job(**post)
    path = tool_path(shapes, angle_rad=angle_rad, deviation_mm=deviation_mm)
    return write_program(made, made.operation[0], path, limits, lift_mm=lift_mm)


@pytest.mark.parametrize(
    "words", ["R=4 T=2 D=1 TOLERANCE=0.00.001", "R=4..5 T=2 D=1 TOLERANCE=1", "R=4 T=2 D=1 TOLERANCE=e"]
)
def test_a_damaged_stamp_is_none(words: str) -> None:
    """(6.6) Bytes that fell over in the head are no fault of ours."""
    assert read_stamp(f";DRIPMILL CONTROL=sinumerik-840d REFERENCE=tip {words}".encode()) is None


def test_no_number_has_more_decimals_than_the_control_reads() -> None:
    """Feeds and heights of head and tail too; heights are never rounded down into the clearance (6.8)."""
    limits = dataclasses.replace(LIMITS, decimals=2, is_inch=True)
    for blocks in ("linear", "poly", "bspline"):
        shape = polyline(1, 4) if blocks == "linear" else spline(1)
        program = written([shape], limits, blocks=blocks).data.decode()
        body = program.split("G94\n", 1)[1]
        assert re.findall(r"\.\d{3,}", body) == []
        heights = [float(text) for text in re.findall(r"G0 ?Z([.\d]+)", body)]
        assert heights == [1.97, 0.4]  # 50 and 10 mm


def test_a_profile_without_a_height_for_the_tool_change_is_warned_of() -> None:
    """The height is the machine's, nobody can guess it; the warning names the key (6.8)."""
    assert not any("retract_z_mm" in one for one in written([polyline(1, 3)], blocks="linear").warnings)
    result = written([polyline(1, 3)], ControlLimits(), blocks="linear")
    assert b"SUPA" not in result.data
    assert any("no retract_z_mm" in one for one in result.warnings)


def test_whole_program_of_two_passes() -> None:
    """Head, numbered pass starts, exact stops at the ends of plunge and pass, tail as the control wants it (6.8)."""
    program = written([polyline(1, 3), polyline(2, 3)], blocks="linear").data.decode().splitlines()
    assert program == [
        "%_N_5000_MPF",
        ";$PATH=/_N_MPF_DIR",
        ";DRIPMILL CONTROL=sinumerik-840d REFERENCE=tip R=4 T=2 D=1 TOLERANCE=0.001",
        "G17 G40 G64 G710 G90 G94",
        "TRANS",
        "G54",
        "G0 SUPA Z400 D0",
        "T2 M6",
        "D1",
        "G0 Z50",
        "S1000 M3",
        "G4 F2",
        "M8",
        "N1G0X0Y1.7418",
        "Z10",
        "G1G9Z2.5355F100",
        "X25Z3.8514F250",
        "X50Z1.4325G9",
        "G0Z10",
        "N2G0X0Y3.2418",
        "G1G9Z1.7848F100",
        "X25Z1.8955F250",
        "X50Z3.4427G9",
        "G0Z10",
        "Z50",
        "M9",
        "M5",
        "G0 SUPA Z400 D0",
        "M30",
    ]


def test_rapids_move_z_alone_or_xy_alone() -> None:
    """(1.2)"""
    for line in written([spline(1), spline(2)], angle_rad=0.7).data.decode().splitlines():
        if "G0" in line:
            assert not ("Z" in line and re.search("[XY]", line)), line


def test_counts() -> None:
    result = written([spline(1), spline(2, inner=3)])
    lines = result.data.decode().splitlines()
    cutting = [line for line in lines if "PO[" in line]
    assert result.cutting_blocks == len(cutting) == 2 + 4
    assert result.cutting_bytes == sum(len(line) + 1 for line in cutting)
    assert result.blocks == len(lines) - 3


def test_rounding_takes_at_most_what_the_fit_left() -> None:
    """Fewest digits within path_mm (6.8): a fit with slack gets shorter numbers."""
    tight = written([spline(1)], deviation_mm=0.0009)
    loose = written([spline(1)], deviation_mm=0.0002)
    assert tight.rounding_mm <= 0.0001 < loose.rounding_mm <= 0.0008
    assert loose.cutting_bytes < tight.cutting_bytes


@pytest.mark.parametrize("angle_deg", [90.0, 30.0, 135.0])
def test_oblique_plane_carries_x_and_y(angle_deg: float) -> None:
    """(6.8)"""
    text = written([spline(3)], angle_rad=math.radians(angle_deg)).data.decode()
    assert ("PO[X]" in text) == (angle_deg != 90.0)
    assert "PO[Y]" in text
    assert "PO[Z]" in text


def test_sidecar_names_each_pass_start() -> None:
    """Block, line, byte, position and hash of every restart point (6.8)."""
    result = written([spline(1), spline(2), spline(3)])
    assert result.sidecar["sha256"] == hashlib.sha256(result.data).hexdigest()
    lines = result.data.decode().splitlines()
    for point in result.sidecar["restart_points"]:
        text = lines[point["line"] - 1]
        assert text.startswith(f"N{point['block']}G0X")
        assert result.data[point["offset_bytes"] :].startswith(text.encode())
        assert float(re.search(r"Y([0-9.]+)", text)[1]) == point["position_mm"][1]
    assert json.loads(json.dumps(result.sidecar)) == result.sidecar
    jsonschema.validate(result.sidecar, json.loads(SCHEMA.read_text()))


def test_stamp_says_control_reference_radius_tool_and_tolerance() -> None:
    """(6.8)"""
    stamp = read_stamp(written([spline(1)], reference="centre", lift_mm=20.0).data)
    assert stamp is not None
    assert (stamp.control, stamp.reference, stamp.radius_mm, stamp.tool) == ("sinumerik-840d", "centre", 4.0, 2)
    assert (stamp.tolerance_mm, stamp.lift_mm) == (0.001, 20.0)


def test_lift_shifts_the_frame_and_nothing_else() -> None:
    """An air cut differs in TRANS and the stamp only (6.8)."""
    low, high = written([spline(1)]), written([spline(1)], lift_mm=20.0)
    changed = [pair for pair in zip(low.data.splitlines(), high.data.splitlines(), strict=True) if pair[0] != pair[1]]
    assert [pair[1] for pair in changed[1:]] == [b"TRANS Z20"]
    assert changed[0][1].endswith(b"LIFT=20")


def test_no_tool_changer_stops_with_a_message() -> None:
    """(6.8)"""
    text = written([spline(1)], ControlLimits(has_tool_changer=False)).data.decode()
    assert 'MSG("TOOL 2: BALL D8")\nT2\nM0\nMSG()\nD1\n' in text
    assert "M6" not in text
    assert "SUPA" not in text


@pytest.mark.parametrize(("numbers", "count"), [("none", 0), ("pass", 2), ("all", 25)])
def test_block_numbers(numbers: str, count: int) -> None:
    lines = written([polyline(1, 3), polyline(2, 3)], numbers=numbers).data.decode().splitlines()
    found = [int(match[1]) for line in lines if (match := re.match(r"N(\d+)", line))]
    assert found == list(range(1, len(found) + 1))
    assert len(found) == count or numbers == "all"
    if numbers == "all":
        assert len(found) == len(lines) - 3


def test_control_with_few_decimals_is_said() -> None:
    """path_mm of 1 um on 3 decimals is warned of (4.7)."""
    result = written([spline(1)], ControlLimits(decimals=3))
    assert any("3 decimals" in warning for warning in result.warnings)
    assert not re.search(r"\.\d{4}", result.data.decode().replace("TOLERANCE=0.001", ""))


@pytest.mark.parametrize(
    ("post", "sentence"),
    [
        ({"control": "fanuc-30i"}, "not built yet"),
        ({"name": "no good"}, "no SINUMERIK program name"),
        ({"blocks": "spl"}, "cannot be written"),
    ],
)
def test_refusals_are_one_sentence(post: dict[str, str], sentence: str) -> None:
    with pytest.raises(InputRejected, match=sentence):
        written([spline(1)], **post)


@pytest.mark.parametrize("code", ["G53", "G58", "G99", "G504", "G5050", "G54 M30"])
def test_only_a_settable_offset_is_written(code: str) -> None:
    """(2.7) Any other code would do something else at the machine."""
    with pytest.raises(InputRejected, match="no offset of a SINUMERIK"):
        work_offset(code)


@pytest.mark.parametrize("code", ["G54", "G57", "G505", "G510", "G599"])
def test_a_settable_offset_is_written_as_it_stands(code: str) -> None:
    assert work_offset(code) == code


def test_no_pass_is_refused() -> None:
    with pytest.raises(InputRejected, match="no pass"):
        written([])


def test_every_pass_uses_what_its_own_fit_left() -> None:
    """The worst pass decides rounding_mm; another with slack has shorter numbers (6.8)."""
    made = job()
    both = tool_path([spline(1), spline(1)])
    easy = dataclasses.replace(both.passes[1], deviation_mm=0.0001)
    path = dataclasses.replace(both, passes=(both.passes[0], easy))
    result = write_program(made, made.operation[0], path, LIMITS)
    first, second = result.data.decode().split("N2G0")
    assert len(second.split("G0Z10")[0]) < len(first.split("N1G0")[1].split("G0Z10")[0]) - 4
    assert 0.0009 + result.rounding_mm <= 0.001
