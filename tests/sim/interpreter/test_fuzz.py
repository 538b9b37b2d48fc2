"""Whatever the bytes, the answer is commands or an alarm: no crash, no hang, nothing after an alarm (6.6)."""

from __future__ import annotations

import math
import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.post.base import write_program
from planner.post.written import ControlLimits
from sim.interpreter import canon
from sim.interpreter.run import Interpreter, interpret
from sim.interpreter.settings import Settings, Tool
from tests.planner.post.paths import job, spline, tool_path

GOLDEN = Path(__file__).parents[2] / "golden"
CONTROL = Settings(tools={1: Tool(2.0)}, max_repeats=200)
SEEDS = [path.read_bytes() for path in sorted(GOLDEN.rglob("*.mpf")) if path.stat().st_size < 3000]
SEEDS += [
    write_program(
        job(blocks=blocks), job().operation[0], tool_path([spline(1, inner=3), spline(2)]), ControlLimits()
    ).data
    for blocks in ("poly", "bspline")
]

_PIECES = st.sampled_from(
    [
        "G0", "G1", "G2", "G3", "CIP", "CT", "POLY", "BSPLINE", "ASPLINE", "CSPLINE", "G41", "G42", "G40", "G17", "G18",
        "G91", "G90", "G93", "G95", "G4", "TRANS", "AROT", "SCALE", "MIRROR", "ROT", "SUPA", "G54", "G28", "G74", "G25",
        "X1", "X-2", "Y3", "Z=R1", "I2", "J-1", "K.5", "I1=3", "J1=2", "CR=4", "CR=-4", "AR=90", "TURN=2", "PL=1",
        "PL=0", "PW=2", "SD=2", "PO[X]=(1,2,3)", "PO[]=(2,1)", "F100", "F0", "S500", "M3", "T1", "M6", "D0", "M30",
        "R1=R1+1", "R1=1/R2", "IF R1>2", "ELSE", "ENDIF", "WHILE R1<9", "ENDWHILE", "FOR R3=1 TO 4", "ENDFOR", "LOOP",
        "ENDLOOP", "REPEAT", "UNTIL R1>3", "AA:", "GOTOB AA", "GOTOF AA", "GOTO AA", "GOTOC BB", "REPEAT AA P=2",
        "DEF REAL VV=1", "VV=2", "X=VV", "CASE R1 OF 1 GOTOF AA DEFAULT GOTOB AA", "RPL=45", "X2", "MSG(\"t\")", "RET",
        "FGROUP(X)", "G451", "G64", "G641 ADIS=1", "X=AC(1)", "X=IC(2)", "X1EX9", "/", "N7", ":8", ";", "%",
        "(", "$P_EP[X]",
    ]
)  # fmt: skip


def check(data: bytes, control: Settings = CONTROL) -> None:
    found = list(interpret(data, control))
    alarms = [place for place, one in enumerate(found) if isinstance(one, canon.Alarm)]
    assert alarms in ([], [len(found) - 1])
    ends = [place for place, one in enumerate(found) if isinstance(one, canon.End)]
    assert ends in ([], [len(found) - 1])
    place = control.start_mm
    for one in found:
        if isinstance(one, canon.Motion):
            assert all(map(math.isfinite, (*one.start, *one.end)))
            assert math.dist(one.start, place) < 1e-6 * (1 + max(map(abs, place))), one
            place = one.end
        if isinstance(one, canon.Arc):
            assert one.sweep_rad > 0
            assert math.hypot(*one.axis) == pytest.approx(1)
        if isinstance(one, canon.Polynomial):
            assert one.coefficients[0] == one.start
            assert one.length > 0
            assert one.denominator[0] == 1.0
        if not isinstance(one, canon.Alarm | canon.Command):
            raise AssertionError(one)


@settings(max_examples=400, deadline=None)
@given(st.lists(st.lists(_PIECES, max_size=5).map(" ".join), max_size=14))
def test_programs_of_odd_pieces(lines: list[str]) -> None:
    """(6.6)"""
    check("\n".join(["G1 X0 Y0 Z0 F100", *lines]).encode())


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=300))
def test_bytes(data: bytes) -> None:
    """(6.6)"""
    check(data)


def mutated(rng: random.Random) -> bytes:
    """A golden or a program of the post with bytes flipped, dropped, doubled, or its lines shuffled."""
    data = bytearray(rng.choice(SEEDS))
    for _ in range(rng.randint(1, 6)):
        place = rng.randrange(len(data) or 1)
        match rng.randrange(4):
            case 0:
                data[place : place + 1] = bytes([rng.choice(b"XYZGMFRIJK=()[]0123456789.-+;:/ \n\"'")])
            case 1:
                del data[place : place + rng.randint(1, 4)]
            case 2:
                data[place:place] = data[place : place + rng.randint(1, 12)]
            case _:
                lines = bytes(data).split(b"\n")
                rng.shuffle(lines)
                data = bytearray(b"\n".join(lines))
    return bytes(data)


@pytest.mark.parametrize("seed", range(4))
def test_mutated_programs(seed: int) -> None:
    """(6.6) 500 programs."""
    rng = random.Random(seed)
    for _ in range(125):
        check(mutated(rng))


@pytest.mark.soak
def test_mutated_programs_by_the_thousand() -> None:
    """(6.6) 100,000 programs."""
    rng = random.Random(2026)
    for _ in range(100_000):
        check(mutated(rng))


@settings(max_examples=100, deadline=None)
@given(st.lists(st.lists(_PIECES, max_size=4).map(" ".join), max_size=10))
def test_drip_fed_and_whole_differ_only_where_the_program_goes_back(lines: list[str]) -> None:
    """(6.4)"""
    data = "\n".join(["G1 X0 Y0 Z0 F100", *lines])
    dripped = Interpreter(Settings(tools={1: Tool(2.0)}, max_repeats=200, is_drip_fed=True))
    found: list[canon.Command] = []
    for line, raw in enumerate(data.encode().split(b"\n"), start=1):
        found += dripped.block(raw, line)
    found += dripped.finish()
    whole = list(interpret(data.encode(), CONTROL))
    if found and isinstance(found[-1], canon.Alarm) and found[-1].number == CONTROL.backward_jump_alarm:
        return
    assert found == whole


def test_deep_brackets_and_long_chains_are_refused_not_a_crash() -> None:
    """(6.6)"""
    deep = [("(", 200, ")"), ("-", 400, ""), ("1+", 240, ""), ("R[", 100, "]"), ("SIN(", 100, ")"), ("AC(", 100, "")]
    for text in (f"X={opening * count}1{closing * count}" for opening, count, closing in deep):
        check(text.encode())
    check(b"G1 X" + b"1" * 10_000_000)
