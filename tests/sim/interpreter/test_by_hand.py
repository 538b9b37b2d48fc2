"""Words in odd company, each program with the result that the manual's rules give by hand (6.2, 6.4, 6.5)."""

from __future__ import annotations

import itertools
import math
from dataclasses import fields
from pathlib import Path

import pytest

from sim.interpreter import canon
from sim.interpreter.run import Interpreter, interpret
from sim.interpreter.settings import Settings, Tool

Place = tuple[float, float, float]


def run(text: str, **keys: object) -> list[canon.Command]:
    return list(interpret(text.encode("latin-1"), Settings(start_mm=(0.0, 0.0, 0.0), **keys)))  # type: ignore[arg-type]


def last_motion(text: str) -> canon.Motion:
    found = run(text)
    assert not any(isinstance(one, canon.Alarm) for one in found), found[-1]
    return next(one for one in reversed(found) if isinstance(one, canon.Motion))


@pytest.mark.parametrize(
    ("text", "end"),
    [
        ("TRANS X10 Y5\nAROT RPL=90\nASCALE X2 Y2 Z2\nAMIRROR X0\nG0 X1 Y3", (4, 3, 0)),
        ("G18\nROT RPL=30\nG0 X10", (10 * math.cos(math.pi / 6), 0, -5)),
        ("G19\nROT RPL=30\nG0 Z10", (0, -5, 10 * math.cos(math.pi / 6))),
        ("ROT X90 Z90\nG0 X1 Y2 Z3", (3, 1, 2)),
        ("MIRROR X0\nTRANS X10\nG0 X5", (15, 0, 0)),
        ("SCALE X2\nATRANS X3\nG0 X1", (8, 0, 0)),
        ("TRANS X10\nG58 X2\nG59 X1\nG0 X1", (4, 0, 0)),
        ("TRANS X10\nROT RPL=90\nG0 X1 Y2\nG53 X0 Y0\nG91 X1", (0, 1, 0)),
        ("G91\nG0 X5\nTRANS X100\nX1", (6, 0, 0)),
        ("G91\nG0 X5\nTRANS X100\nX=AC(1)", (101, 0, 0)),
        ("G70\nG0 X1\nG71 X=IC(1)", (26.4, 0, 0)),
        ("GOTOF :20\nN20 G0 X1\n:20 G0 Y1", (0, 1, 0)),
        ("GOTOF N20\n:20 G0 X1\nN20 G0 Y1", (0, 1, 0)),
        ("R1=2 R2=R1*3\nG0 X=R2-R1 Y=-R[1] Z=R[R1]", (4, -2, 6)),
    ],
)
def test_places(text: str, end: Place) -> None:
    """(6.2) Frames, suppressed frames, dimensions and units one upon the other."""
    assert last_motion(text).end == pytest.approx(end, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "end", "centre", "axis", "degrees"),
    [
        ("G3 X10 AR=90", (10, 0, 0), (5, 5, 0), (0, 0, 1), 90),
        ("G2 X-10 AR=270", (-10, 0, 0), (-5, -5, 0), (0, 0, -1), 270),
        ("G3 I5 AR=90", (5, -5, 0), (5, 0, 0), (0, 0, 1), 90),
        ("G18 G2 X10 I5 K0 TURN=2 Y-3", (10, -3, 0), (5, 0, 0), (0, -1, 0), 900),
        ("G19 G3 Y10 J5 K0 TURN=1 X4", (4, 10, 0), (0, 5, 0), (1, 0, 0), 540),
        ("G3 Y80 J40.02", (0, 80, 0), (0, 40, 0), (0, 0, 1), 180),
        ("G18 G3 Z10 CR=5", (0, 0, 10), (0, 0, 5), (0, 1, 0), 180),
        ("G19 G2 Y10 Z10 CR=-10", (0, 10, 10), (0, 0, 10), (-1, 0, 0), 270),
        ("SCALE X2 Y2\nG3 X2 I1 Z2", (4, 0, 2), (2, 0, 0), (0, 0, 1), 180),
        ("MIRROR X0\nG2 X10 CR=5", (-10, 0, 0), (-5, 0, 0), (0, 0, 1), 180),
        ("G91 G1 X5\nG2 I=AC(5) J=AC(5) X5 Y5", (10, 5, 0), (5, 5, 0), (0, 0, -1), 270),
        ("G1 Y5\nCT X10 Y5", (10, 5, 0), (5, 5, 0), (0, 0, -1), 180),
        ("G91 G1 X10\nCIP X10 I1=5 J1=5", (20, 0, 0), (15, 0, 0), (0, 0, -1), 180),
        (
            "POLY PO[X]=(10) PO[Y]=(10,10)\nCT X10 Y20",
            (10, 20, 0),
            None,
            (0, 0, 1),
            2 * (90 - math.degrees(math.atan(2))),
        ),
    ],
)
def test_arcs(text: str, end: Place, centre: Place | None, axis: Place, degrees: float) -> None:
    """(6.2)"""
    arc = last_motion(f"F100\n{text}")
    assert isinstance(arc, canon.Arc)
    assert arc.end == pytest.approx(end, abs=1e-12)
    assert centre is None or arc.centre == pytest.approx(centre, abs=1e-12)
    assert arc.axis == pytest.approx(axis, abs=1e-12)
    assert math.degrees(arc.sweep_rad) == pytest.approx(degrees)


@pytest.mark.parametrize(
    ("text", "feed_mm_min"),
    [
        ("G95 F0.1 S5000 M3\nG26 S2000\nG1 X10", 200.0),
        ("G26 S2000\nS5000 M3 G95 F0.1 G1 X10", 200.0),
        ("G95 F0.1 S1000 M3\nG1 X10 S500", 50.0),
        ("FGROUP(X,Y) F100\nG2 X20 I10 Z10", 100 * math.hypot(10 * math.pi, 10) / (10 * math.pi)),
        ("FGROUP(X,Y) F100\nPOLY PO[X]=(10) PO[Z]=(10)", 100 * math.sqrt(2)),
        ("FGROUP(X) F100\nBSPLINE X3 Z4\nX6 Z8\nX9 Z12\nG1 Z12", 500 / 3),
        ("FGROUP(Y) F100\nG1 X10", 100.0),
        ("FGROUP(X) G93 F2 G1 X3 Y4", 10.0),
    ],
)
def test_feeds(text: str, feed_mm_min: float) -> None:
    """(6.2) G95 by the speed the spindle turns at, FGROUP over curves too."""
    assert last_motion(text).feed_mm_min == pytest.approx(feed_mm_min, rel=1e-4)  # type: ignore[union-attr]


def test_a_new_limit_holds_for_the_spindle_that_turns() -> None:
    """(6.2)"""
    speeds = [one.speed_rpm for one in run("S5000 M4\nG26 S2000\nG26 S3000\nG25 S10") if isinstance(one, canon.Spindle)]
    assert speeds == [-5000, -2000, -3000]


@pytest.mark.parametrize(
    ("text", "x_mm"),
    [
        ("R1=0.1+0.2\nIF R1==0.3\nG0 X1\nENDIF", 1),
        ("R1=0.1+0.2\nIF R1>0.3\nG0 X1\nELSE\nG0 X2\nENDIF", 2),
        ("R1=0.3-0.1\nIF R1>=0.2\nG0 X1\nENDIF", 1),
        ("WHILE R1<1\nR1=R1+0.1\nG0 X=R1\nENDWHILE", 1),
        ("REPEAT\nR1=R1+0.1\nG0 X=R1\nUNTIL R1>=0.8", 0.8),
        ("R1=0.1*3\nCASE R1 OF 0.3 GOTOF THERE\nG0 X1\nM30\nTHERE: G0 X2", 2),
        ("FOR R1=0.1+0.2 TO 0.3\nG0 X1\nENDFOR\nG0 Y1", 1),
        ("R1=61.01 R2=61.02\nIF ABS(R2-R1)>0.01 GOTOF WRONG\nG0 X1\nWRONG: M30", 1),
        ("IF 1.00000000001==1\nG0 X1\nELSE\nG0 X2\nENDIF", 2),
    ],
)
def test_numbers_that_differ_by_rounding_compare_equal(text: str, x_mm: float) -> None:
    """(6.4) The manual's relative equality of 1e-12: no pass more than a machinist counts."""
    assert last_motion(text).end[0] == pytest.approx(x_mm)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("F100\nCIP X0 Y0 I1=5 J1=5", "CIP ends where it starts"),
        ("F100\nG3 X.005 I5", "centre is 90.0 degrees aside"),
        ("F100\nG3 X-.04 Y80 J40.1", "radius 40.1000 at its start, 39.9000 at its end"),
        ("G641 ADIS=-1", "0 or more is expected"),
        ("G0 X1E3", "expected EX before an exponent"),
        ("M2=3", "another spindle"),
        ("S2=100", "another spindle"),
        ("TRANS X7\nG4 F1 TRANS", "G4 and TRANS stand in one block"),
        ("G28 X5 TRANS", "G28 and TRANS stand in one block"),
        ("F100\nG3 X10 AR=-90", "AR needs an angle above 0"),
        ("F100\nG3 X10 AR=360", "AR needs an angle above 0"),
        ("F100\nG18 G2 X10 I5 J1", "J is not of the working plane G18"),
    ],
)
def test_refused(text: str, words: str) -> None:
    """(6.2, 6.5)"""
    last = run(text)[-1]
    assert isinstance(last, canon.Alarm)
    assert words in last.text


WORDS = [
    *("G0", "G2", "BSPLINE", "POLY", "CT", "G4 F1", "G74 X1=0", "G28 Y0", "TRANS X1", "TRANS", "ATRANS X1"),
    *("ROT RPL=30", "MIRROR X0", "SCALE X2", "G58 X1", "G25 X-900", "G26 X900", "G26 S500", "G25 S50", "G18", "G41"),
    *(
        "G55",
        "SUPA",
        "G60",
        "G641 ADIS=0.5",
        "G642",
        "G70",
        "G710",
        "G91",
        "G93",
        "G95",
        "CFTCP",
        "G451",
        "BNAT",
        "ENAT",
    ),
    *("SOFT", "WALIMOF", "M3", "M4", "M8", "M7", "M9", "M5", "M0", "M1", "T1", "T1 M6", "D2", "S100", "F123"),
    *("FGROUP(X,Y)", 'MSG("a")', "STOPRE", "R1=5", "CTOL=0.1", "ADIS=0.2", "H1", "SD=2", "L5", "M17", "M30", "FLIN"),
]
OF_THE_BLOCK = {"G28 Y0 SUPA", "G25 X-900 S100", "G26 X900 S100"}
"""SUPA suppresses in its own block only; S beside G25 and G26 is the limit."""


def test_no_word_is_lost_beside_another(tmp_path: Path) -> None:
    """(6.5) Two words in one block leave the state that they leave in two blocks of one order or the other."""
    (tmp_path / "L5.SPF").write_text("R9=R9+1\nM17\n")
    settings = Settings(
        start_mm=(0.0, 0.0, 0.0), tools={0: Tool(2.0), 1: Tool(2.0)}, subprogram_folder=tmp_path, max_repeats=100
    )
    lost = []
    for first, second in itertools.combinations(WORDS, 2):
        together = _left_by([f"{first} {second}"], settings)
        apart = [_left_by(order, settings) for order in ([first, second], [second, first])]
        known = [state for state in apart if state is not None]
        if together is not None and known and together not in known:
            lost.append(f"{first} {second}")
    assert set(lost) == OF_THE_BLOCK


def _left_by(blocks: list[str], settings: Settings) -> dict[str, object] | None:
    """State, R parameters and whether something moved or waited after these blocks; None after an alarm."""
    interpreter = Interpreter(settings)
    found: list[canon.Command] = []
    for line, text in enumerate(["S700 F50 M4", "TRANS Y7", *blocks], start=1):
        found += interpreter.block(text.encode(), line)
    found += interpreter.finish()
    if any(isinstance(one, canon.Alarm) for one in found):
        return None
    state = interpreter.state
    kinds = {type(one) for one in found}
    values = {one.name: getattr(state, one.name) for one in fields(state) if one.name != "last_motion"}
    return {**values, "r": dict(interpreter.variables.r), "kinds": kinds}
