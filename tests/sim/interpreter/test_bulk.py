"""The fast route and the full parser give the same commands (6.7)."""

from __future__ import annotations

import mmap
import random
import re
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.interpreter import canon
from sim.interpreter.run import Interpreter, interpret, interpret_bulk
from sim.interpreter.settings import Settings

GOLDEN = Path(__file__).parents[2] / "golden"
ORIGIN = Settings(start_mm=(0.0, 0.0, 0.0))


def by_blocks(data: bytes, control: Settings = ORIGIN) -> tuple[list[canon.Command], object]:
    """Only the full parser, as a live control reads."""
    interpreter = Interpreter(control)
    found: list[canon.Command] = []
    lines = data.split(b"\n")
    for line, raw in enumerate(lines[:-1] if lines[-1] == b"" else lines, start=1):
        found += interpreter.block(raw, line)
    found += interpreter.finish()
    return found, interpreter.state


def agree(data: bytes, control: Settings = ORIGIN) -> int:
    """Both routes give the same; returns how many cuts came in runs."""
    assert list(interpret(data, control)) == by_blocks(data, control)[0]
    return sum(len(run) for run in interpret_bulk(data, control) if isinstance(run, canon.LineRun))


@pytest.mark.parametrize(
    "path", sorted(path for path in GOLDEN.rglob("*.mpf") if path.stat().st_size < 100_000), ids=lambda path: path.name
)
def test_both_routes_agree_on_every_golden(path: Path) -> None:
    """(6.7)"""
    control = Settings(start_mm=(0.0, 0.0, 0.0), max_repeats=300)
    agree(path.read_bytes(), control)
    agree(path.read_bytes().replace(b"\n", b"\r\n"), control)


def cam_program(blocks: int, seed: int = 1) -> bytes:
    rng = random.Random(seed)
    lines = ["%_N_CAM_MPF", "G17 G90 G40 G54 G642", "G0 X0 Y0 Z10", "G1 Z0 F1000"]
    x, y, z = 0.0, 0.0, 0.0
    for number in range(blocks):
        x, y, z = x + rng.uniform(-1, 1), y + rng.uniform(-1, 1), z + rng.uniform(-0.1, 0.1)
        lines.append(f"N{number + 100} G1 X{x:.3f} Y{y:.3f} Z{z:.3f}")
    return ("\n".join([*lines, "G0 Z10", "M30"]) + "\n").encode()


def test_cam_output_goes_the_fast_route() -> None:
    """(6.7)"""
    assert agree(cam_program(10_000)) > 9_990


_ODD = (
    "G1 G01 G0 G2 G90 G91 G95 TRANS X1 Y2.5 Z-.5 X+3. x4 y05 F100 F0 f2.5 X X- X. X1.2.3 X1X2 M8 R1=2 X=R1 ; "
    "N5 N10 N1.5 N-1 N1234567890 /1 / G642 E5 X1EX1 X2EX-1 X1e5 I1 CT T1 X123456789012 X0.1234567890123456789 G54 "
    "TRANS\tX1 Y1\t G1X1Y1Z1 N7G1X9 X\x001 X1\x00 & X5& AA: GOTOF"
)
_WORDS = st.sampled_from(_ODD.split(" "))
_LINE = st.lists(_WORDS, max_size=6).flatmap(
    lambda words: st.sampled_from([" ", "", "  "]).map(lambda s: s.join(words))
)


@settings(max_examples=120, deadline=None)
@given(st.lists(_LINE, max_size=12), st.integers(0, 9), st.sampled_from(["\n", "\r\n"]))
def test_both_routes_agree_on_odd_blocks_among_plain_ones(lines: list[str], place: int, end: str) -> None:
    """(6.7)"""
    plain = [f"G1 X{k} Y{k / 8} F200" for k in range(20)]
    text = end.join([*plain[:place], *lines, *plain[place:], *lines[:2], *plain])
    agree(text.encode("latin-1"))


@pytest.mark.parametrize(
    "odd",
    ["G1 X5 N7", "N1.0 X5", "N1234567890 X5", "X1 X2", "X1.2.3", "X-", "X.", "X 5", "F0 X5", "X1EX1", "G1.5 X5",
     "G1 G1", "X1e1", "g1x5", "N7", "", " ", "F50", "X1E9", "X2000000000", "X+-1", "/X5", "X5;", "X5 Y",
     "\x0bX5", "N7 N8 X5"],
)  # fmt: skip
def test_one_odd_block_among_plain_ones(odd: str) -> None:
    """(6.7)"""
    plain = [f"G1 X{k} Y{k / 8} F200" for k in range(12)]
    agree("\n".join([*plain, odd, *plain]).encode("latin-1"))


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["", "G1", "g01", "N9 ", "N00012", " \t"]),
            st.lists(
                st.tuples(
                    st.sampled_from("XYZxyF"),
                    st.from_regex(r"[+-]?([0-9]{1,9}\.?[0-9]{0,9}|\.[0-9]{1,17})", fullmatch=True),
                ),
                max_size=4,
            ),
        ),
        max_size=30,
    )
)
def test_numbers_of_both_routes_are_the_same_floats(blocks: list[tuple[str, list[tuple[str, str]]]]) -> None:
    """(6.7)"""
    lines = [head + "".join(letter + number for letter, number in words) for head, words in blocks]
    agree("\n".join(["G1 F100 X1"] * 10 + lines).encode())


@pytest.mark.parametrize(
    "head",
    [
        "TRANS X1.1 Y2.2", "G91", "ROT RPL=30", "G95 S100 M3 F0.1", "G93 F2", "G70", "G700", "G41", "FGROUP(X,Y)", "G0",
        "G25 X-5\nG26 X5", "G90\nTRANS Z5\nATRANS X.1", "BSPLINE X1 Y1\nX2\nX3\nX4\nG1", "R1=3\nAA:", "G55",
    ],
)  # fmt: skip
def test_modes_that_change_the_meaning_of_plain_blocks(head: str) -> None:
    """(6.7)"""
    body = "\n".join(f"X{k / 10:.1f} Y{k % 3} Z.{k}" for k in range(60))
    control = Settings(start_mm=(0.0, 0.0, 0.0), work_offsets_mm={"G54": (0.1, 0.2, 0.3), "G55": (7.0, 8.0, 9.0)})
    agree(f"G1 X0 F500\n{head}\n{body}\nCT X9 Y9 Z1".encode(), control)


def test_loops_over_plain_blocks() -> None:
    """(6.7)"""
    body = "\n".join(f"G1 X{k} Y{k % 7}" for k in range(300))
    text = (
        f"G1 X0 F500\nFOR R1=1 TO 3\n{body}\nENDFOR\nAA: G0 X0\n{body}\nREPEAT AA P=2\nR2=R2+1\nIF R2<3 GOTOB AA\nM30"
    )
    assert agree(text.encode()) > 300


def test_the_state_after_a_run_is_that_of_the_blocks() -> None:
    """(6.7)"""
    data = cam_program(500).split(b"G0 Z10\nM30")[0]
    interpreter_state = by_blocks(data)[1]
    tail = b"G1 X=$P_EP[X]+1 Y=$P_EP[Y]+$P_F\n"
    assert list(interpret(data + tail, ORIGIN))[-1] == by_blocks(data + tail)[0][-1]
    assert interpreter_state is not None


def test_an_alarm_in_the_middle_ends_the_run() -> None:
    """(6.7)"""
    data = cam_program(200).replace(b"N150 G1", b"N150 G1 Q5", 1)
    found = list(interpret(data, ORIGIN))
    assert isinstance(found[-1], canon.Alarm)
    assert found[-1].block == 150
    agree(data)


def test_a_file_need_not_fit_in_memory(tmp_path: Path) -> None:
    """(6.7) A mapped file is read by chunks; that memory stays flat over 1 GB is in the soak test below."""
    path = tmp_path / "long.mpf"
    path.write_bytes(cam_program(20_000))
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        count = sum(len(one) for one in interpret_bulk(data, ORIGIN) if isinstance(one, canon.LineRun))
    assert count > 19_990


_SOAK = """
import mmap, resource, sys
from sim.interpreter.run import interpret_bulk
with open(sys.argv[1], "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
    import re
    count = 0
    base = None
    for run in interpret_bulk(data):
        count += 1
        if count == 50:
            base = anonymous = int(re.search(r"RssAnon:\\s+(\\d+)", open("/proc/self/status").read())[1])
    last = int(re.search(r"RssAnon:\\s+(\\d+)", open("/proc/self/status").read())[1])
print(count, base, last)
"""


@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_memory_stays_flat_over_a_gigabyte(tmp_path: Path) -> None:
    """(6.7)"""
    import sys

    path = tmp_path / "huge.mpf"
    body = b"".join(cam_program(30_000).splitlines(keepends=True)[4:-2])
    with path.open("wb") as file:
        file.write(b"G1 X0 Y0 Z0 F1000\n")
        for _ in range(2**30 // len(body)):
            file.write(body)
    done = subprocess.run([sys.executable, "-c", _SOAK, str(path)], capture_output=True, text=True, check=True)
    count, base, last = map(int, done.stdout.split())
    assert count > 3000
    assert last - base < 60_000  # kB: marks of lines for jumps, one in 1024


@pytest.mark.debian
@pytest.mark.skipif(shutil.which("rs274") is None, reason="linuxcnc-uspace is not installed")
def test_not_slower_than_the_reference_interpreter(tmp_path: Path) -> None:
    """(6.7) In the same minute, best of five, 100,000 blocks."""
    data = cam_program(100_000)
    reference = tmp_path / "cam.ngc"
    lines = [line for line in data.decode().splitlines() if not line.startswith("%")]
    reference.write_text("\n".join(line.replace("M30", "M2").replace(" G642", "") for line in lines) + "\n")
    ours, theirs = [], []
    for _ in range(5):
        began = time.perf_counter()
        assert sum(len(one) for one in interpret_bulk(data) if isinstance(one, canon.LineRun)) > 99_990
        ours.append(time.perf_counter() - began)
        began = time.perf_counter()
        subprocess.run(["rs274", "-g", str(reference), str(tmp_path / "out.txt")], check=True, capture_output=True)
        theirs.append(time.perf_counter() - began)
    assert (tmp_path / "out.txt").stat().st_size > 5_000_000
    assert min(ours) <= min(theirs)


@pytest.mark.debian
@pytest.mark.skipif(shutil.which("rs274") is None, reason="linuxcnc-uspace is not installed")
def test_positions_are_those_of_the_reference_interpreter(tmp_path: Path) -> None:
    """(6.6) Lines and arcs in two spellings of one program; the reference prints four decimals."""
    text = """G17 G21 G90 G94
F1000
G0 X0 Y0 Z5
G1 Z0
G1 X10.5 Y2
G2 X20.5 Y2 I5 J0
G3 X20.5 Y12 I0 J5
G91
G1 X1 Y-2 Z.5
G90
G18
G2 X31.5 Z.5 I5 K0
G19
G3 Y20 Z.5 J5 K0
M2
"""
    (tmp_path / "a.ngc").write_text(text)
    subprocess.run(["rs274", "-g", "a.ngc", "out.txt"], cwd=tmp_path, check=True, capture_output=True)
    theirs = []
    for line in (tmp_path / "out.txt").read_text().splitlines():
        name, _, rest = line.split("N.....")[-1].strip().partition("(")
        numbers = [float(number) for number in re.findall(r"-?\d+\.?\d*", rest)]
        if name in ("STRAIGHT_FEED", "STRAIGHT_TRAVERSE"):
            theirs.append(tuple(numbers[:3]))
        elif name == "ARC_FEED":
            theirs.append(tuple(numbers))
    mine = [move for move in interpret(text.replace(" G21", "").encode(), ORIGIN) if isinstance(move, canon.Motion)]
    assert len(theirs) == len(mine)
    for move, numbers in zip(mine, theirs, strict=True):
        if not isinstance(move, canon.Arc):
            assert move.end == pytest.approx(numbers, abs=6e-5)
            continue
        # ARC_FEED(first end, second end, first centre, second centre, turns, third end ...) in the arc's plane
        normal = max(range(3), key=lambda axis: abs(move.axis[axis]))
        first, second = [(1, 2), (2, 0), (0, 1)][normal]
        plane = (
            move.end[first],
            move.end[second],
            move.centre[first],
            move.centre[second],
            move.axis[normal],
            move.end[normal],
        )
        assert plane == pytest.approx(numbers[:6], abs=6e-5)
