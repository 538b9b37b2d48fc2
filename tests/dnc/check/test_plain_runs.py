"""Checking in bulk and checking block by block find the same (6.10)."""

from __future__ import annotations

import math
import random
import re
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnc.check import run
from dnc.check.limits import Limits
from dnc.check.numbering import NumberSet
from dnc.check.rate import RateWindow
from dnc.check.run import Check, check_program
from dnc.profile import load_profile
from dnc.shipped import shipped_path
from planner import files
from sim.interpreter import canon

LIMITS = Limits(load_profile(shipped_path("machines", "sinumerik-840d")), 10.0, ((0, 0, -20), (50, 50, 4)))
GOLDEN = Path(__file__).parents[2] / "golden"
HEAD = (
    "%_N_T_MPF\n; a\n; b\nG17 G40 G64 G71 G90 G94\nG54\nG0 Z50\nT2 M6\nD1\nS1000 M3\nG4 F2\nG0 X0 Y0\nZ10\n"
    "G1 Z1 F100\nG1 X1 F250\n"
)
TAIL = "G0 Z50\nM5\nM30\n"


def told(check: Check, heard: list[canon.Command]) -> dict[str, Any]:
    """Everything that a check leaves behind; sums rounded, as their order differs."""
    track = check.track
    return {
        "report": check.finish().report(),
        "need": check.need_bytes_s,
        "blocks": (track.blocks, track.lines, track.last_number, track.air_moves, track.idle_moves, track.air_line),
        "way": (round(track.air_mm, 6), round(track.cut_mm, 6), track.cut_top_mm, track.direction, track.plunge),
        "hole": (track.hole, track.told_feed_mm_min),
        "heard": heard,
    }


def agree(data: bytes, limits: Limits = LIMITS) -> int:
    """Both ways tell the same; returns how many lines went the fast way."""
    ways, slow = [], 0
    for is_bulk in (False, True):
        heard: list[canon.Command] = []
        check = Check(limits, watch=heard.append)
        if is_bulk:
            seen = check.line
            count = 0

            def line(raw: bytes, number: int, seen: Any = seen) -> None:
                nonlocal count
                count += 1
                seen(raw, number)

            check.line = line  # type: ignore[method-assign]
            half = data.rfind(b"\n", 0, len(data) // 2) + 1
            check.chunk(data[half:], check.chunk(data[:half], 1) if half else 1)
            slow = count
        else:
            for number, raw in enumerate(data.split(b"\n"), 1):
                if number <= data.count(b"\n") or raw:
                    check.line(raw + b"\n" * (number <= data.count(b"\n")), number)
        ways.append(told(check, heard))
    assert ways[0] == ways[1]
    return data.count(b"\n") - slow


@pytest.mark.parametrize("path", sorted(GOLDEN.rglob("*.mpf")), ids=lambda path: path.name)
def test_every_golden(path: Path) -> None:
    agree(path.read_bytes())


SPLINES = """N1 BSPLINE X2 Z1.5 PL=0 F250
N2 X3Z2PL=4
X4 Z1 PL=3
F300
N3 X5 PL=0
N3 G1 X9
BSPLINE X10
X11 PL=2
X12 PO[Z]=(3,1)
G1 X12
POLY PO[X]=(13,1,2)PO[Z]=(2,-.5)F200
N8 PO[X]=(14,.5)
PO[X]=(14.5,1) PL=2
POLY X14.5
G0 Z50
POLY PO[X]=(20,1)
"""


@pytest.mark.parametrize(
    "path", [*sorted(GOLDEN.rglob("*.mpf")), None], ids=lambda path: path.name if path else "splines"
)
def test_plain_blocks_need_no_rules_for_blocks(path: Path | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """(6.10) Blocks that are known to be plain by their looks are passed over by rules that would find nothing."""
    data = (HEAD + SPLINES + TAIL).encode() if path is None else path.read_bytes()
    ways = []
    for pattern in (run._PLAIN, re.compile(rb"(?!)")):
        monkeypatch.setattr(run, "_PLAIN", pattern)
        heard: list[canon.Command] = []
        check = Check(LIMITS, watch=heard.append)
        for number, raw in enumerate(data.splitlines(keepends=True), 1):
            check.line(raw, number)
        ways.append((told(check, heard), check.track.spline, check.track.motion_code))
    assert ways[0] == ways[1]


@pytest.mark.parametrize("step", [1, 10])
def test_numbers_that_start_over(step: int) -> None:
    """(6.10) Four digits of a CAM system: one note a round, and the rest still goes the fast way."""
    most = 9999 // step
    lines = [f"N{step * (1 + place % most)} X{place * 0.02:.3f} Y5" for place in range(4 * most)]
    text = f"{HEAD}" + "\n".join(lines) + f"\n{TAIL}"
    assert agree(text.encode()) > 0.9 * len(lines)
    check = Check(LIMITS)
    check.chunk(text.encode(), 1)
    ids = [finding.id for finding in check.finish().findings]
    assert ids.count("number-round") == 3
    assert "number-duplicate" not in ids
    assert "number-descending" not in ids


def test_a_number_twice_in_one_round_is_told_in_the_next_round_too() -> None:
    """(6.10)"""
    text = HEAD + "N9998 X2\nN9999 X3\nN1 X4\nN2 X5\nN2 X6\nN3 X7\n" + TAIL
    check = Check(LIMITS)
    check.chunk(text.encode(), 1)
    found = [(finding.id, finding.block) for finding in check.finish().findings if finding.id.startswith("number")]
    assert found == [("number-round", 1), ("number-duplicate", 2)]


def cam(blocks: int, feed: int = 1000) -> list[str]:
    lines = []
    for step in range(blocks):
        angle = 0.002 * step
        x, y, z = 50 * math.cos(angle) - 49, 50 * math.sin(angle), 1 + math.sin(7 * angle)
        lines.append(f"N{step + 100} G1 X{x:.3f} Y{y:.3f} Z{z:.3f}" + f" F{feed}" * (step == 0))
    return lines


def test_cam_output_goes_the_fast_way() -> None:
    assert agree((HEAD + "\n".join(cam(5_000)) + "\n" + TAIL).encode()) > 4_990


def test_a_spindle_that_starts_again_and_characters_of_a_narrow_set() -> None:
    """What stands before a run, or its very characters, can make its blocks special."""
    lines = [*cam(100), "M5", "S500 M3", *cam(300)[100:200], *map(str.lower, cam(400)[200:300]), *cam(400)[300:]]
    tape = msgspec.structs.replace(LIMITS.profile.tape, character_set="iso")
    narrow = Limits(msgspec.structs.replace(LIMITS.profile, tape=tape))
    text = HEAD + "\n".join(lines) + "\n" + TAIL
    assert 290 < agree(text.encode(), narrow) < 310
    check = Check(narrow)
    check.chunk(text.encode(), 1)
    assert {"no-spindle-dwell", "character"} <= {finding.id for finding in check.finish().findings}


@pytest.mark.parametrize("feed", ["F60000", "X20 F60000", "F0.5"])
@pytest.mark.parametrize("at", [250, 251, 252])
def test_a_feed_in_a_block_of_its_own(feed: str, at: int) -> None:
    """(6.10) It acts on the moves behind it, and so does the F that ends it; told again where it comes again."""
    lines = HEAD.splitlines() + cam(400, 3000) + TAIL.splitlines()
    lines[at:at] = [feed]
    lines[at + 40 : at + 40] = ["F300"]
    lines[at + 80 : at + 80] = [feed]
    agree("\n".join(lines).encode())


@pytest.mark.parametrize(
    ("before", "head", "count"),
    [("F60000", "F300", 2), ("F300", "F60000", 1), ("F60000", "F0.5", 3), ("F60000", "", 1), ("F300", "", 1)],
)
def test_the_first_feed_of_a_run_is_held_against_what_was_told_before(before: str, head: str, count: int) -> None:
    """(6.10) An odd feed at its head is told, and a usual one there ends the odd one: told again where that comes."""
    run = [f"X{3 + place * 0.1:.1f}" for place in range(60)]
    run[0] += head
    run[30] += "F60000"
    text = "\n".join([HEAD + "X2" + before, "M8", *run]) + "\n" + TAIL
    assert agree(text.encode()) > 40
    check = Check(LIMITS)
    check.chunk(text.encode(), 1)
    assert [finding.id for finding in check.finish().findings].count("odd-feed") == count


_ODD = [
    "N5 G1 X3", "N104 X4", "N999999999 X4", "X30 Y30", "X-30", "G1", "", "N7", "F300", "F0", "X1 Q5", "X5000", "Z-5",
    "G0 Z20", "G0 X9 Z2", "G91", "G90", "G2 X9 Y9 I4 J0", "M30", "M8", "MSG(\"A\")", "g1 x5", "X5 G1", "X7\tY8",
    "X\xe95", "; COMMENT", "G70", "G71", "S500 M3", "M5", "G4 F2", "BSPLINE X5 Z2 PL=0", "X20000 F60000", "(A)",
    "GOTOB A", "X+5", "N", "X1.2.3", "T3 M6", "%", "/X5", "X3 F9000",
]  # fmt: skip


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from(["\n", "\r\n"]), st.sampled_from([100, 3000, 20_000]))
def test_odd_blocks_among_plain_ones(seed: int, end: str, feed: int) -> None:
    chance = random.Random(seed)
    lines = HEAD.splitlines() + cam(400, feed) + TAIL.splitlines()
    for _ in range(chance.randint(0, 12)):
        at = chance.randrange(len(lines))
        piece = [chance.choice(_ODD)] if chance.random() < 0.7 else [lines[chance.randrange(len(lines))]]
        lines[at : at + chance.randint(0, 1)] = piece
    agree((end.join(lines) + end * chance.randint(0, 1)).encode("latin-1"))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32))
def test_wild_coordinates(seed: int) -> None:
    """Reversals, plunges, moves of no length and moves in air, many of them."""
    chance = random.Random(seed)
    words = [("X", 3), ("Y", 3), ("Z", 12), ("F", 2)]
    lines = []
    for _ in range(300):
        chosen = [f"{letter}{chance.randint(1, most)}" for letter, most in words if chance.random() < 0.5]
        lines.append(" ".join(chosen) or "X2")
    agree((HEAD + "\n".join(lines) + "\n" + TAIL).encode())


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(1, 10**9), st.integers(0, 60)), min_size=1, max_size=900), st.integers(0, 900))
def test_the_window_by_one_and_by_many(blocks: list[tuple[int, int]], cut: int) -> None:
    one, many = RateWindow(1.2), RateWindow(1.2)
    rows = [(time_ns, size, line) for line, (time_ns, size) in enumerate(blocks * 2, 1)]
    for row in rows:
        one.add(*row)
    for part in (rows[:cut], rows[cut:]):
        if part:
            many.add_many(*np.array(part).T)
    one.add(0, 7, 0)
    many.add(0, 7, 0)
    assert one == many


def test_numbers_by_one_and_by_many() -> None:
    one, many = NumberSet(), NumberSet()
    numbers = np.array([3, 8, 9, 250, 64_000])
    many.add_many(numbers)
    for number in numbers.tolist():
        one.add(number)
    asked = np.arange(70_000)
    assert np.flatnonzero(many.holds(asked)).tolist() == numbers.tolist()
    assert [number for number in asked.tolist() if number in one] == numbers.tolist()


def test_lines_across_chunks_and_one_without_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Chunks end at line ends; a line of any length costs no memory."""
    text = HEAD + "\n".join(cam(300)) + "\n" + TAIL.rstrip("\n")
    path = tmp_path / "part.mpf"
    path.write_text(text)
    whole = check_program(path, LIMITS).found.report()
    monkeypatch.setattr(files, "_CHUNK_BYTES", 97)
    assert check_program(path, LIMITS).found.report() == whole
    path.write_bytes(b"X1" * 200_000)
    assert max(map(len, files.program_chunks(path))) <= 65_536 + 97
