"""The check rule by rule: what is found, and in which line."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnc.check.limits import Limits
from dnc.check.numbering import NumberSet
from dnc.check.run import Check
from sim.interpreter.vocabulary import IGNORED_CODES, IGNORED_M, REFUSED_CODES
from tests.dnc.check.programs import HEAD, PROFILE, TAIL, ids


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
        ("G1 X10 F250\nY2000\n", [("axis-limit", 2)]),
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
        (
            "G1 X9 F250\nMCALL CYCLE81(10,0,2,-9)\n",
            "unknown-word",
            "MCALL (a modal call) is not modelled; what it does is not checked",
        ),
        ("G1 X9 F250\nCYCLE81(10,0,2,-9)\n", "unknown-word", "write out the moves that it makes"),
        ("G1 X9 F250\nX20 RND=2\nY9\n", "unknown-word", "write out the moves that it makes"),
        ("G1 X9 A90 F250\n", "unknown-word", "leave it out"),
        ("M5\nG95 G1 X9 F.1\n", "no-spindle", "a spindle that stands"),
        ("G1 X9 F250\nG0 Z50\nM5\nT3 M6\nG0 Z10\nG1 Z1 F100\nX20 F250\n", "no-spindle", "with the spindle stopped"),
        ("G1 X9 F250\nG0 SUPA Z0 D0\nG0 X9\nZ10\nG1 Z1 F100\nX20 F250\n", "no-edge", "D0 is in force"),
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


def test_a_branch_that_is_passed_over_moves_nothing() -> None:
    """(6.10) Its moves have no length of their own, and its codes are not in force behind it."""
    branches = "R1=1\nIF R1==2\nG1 X10 F250\nG0 Z10\nELSE\nX20 F250\nENDIF\nX30\n"
    assert ids(branches) == []
    assert ids(branches.replace("R1=1", "R1=2").replace("Z10", "Z9").replace("X30", "G0 X30")) == []


@pytest.mark.parametrize("word", ["UPATH", "SPATH"])
def test_the_path_parameter_of_cam_headers_is_no_unknown_word(word: str) -> None:
    """(6.5) Heads of five-axis posts name it for three axes too; there all axes follow the path."""
    assert ids(f"X9 F250\n{word}\nX20\n") == []


@pytest.mark.parametrize("arc", ["G2 X10 Y0 I900 J0 F250\n", "G2 X10 Y10 CR=-900 F250\n"])
def test_an_arc_that_bulges_beyond_the_travel_is_told(arc: str) -> None:
    """(6.10) Both its ends may lie within."""
    assert ("axis-limit", 2) in ids(f"G1 X10 F250\n{arc}")
    assert ids(f"G1 X10 F250\n{arc.replace('900', '90')}") == []


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
    assert ("axis-limit", 2) in ids("G1 X1 F10\nX70\n", inch, head, "G0 Z2\nM5\nM30\n")


@pytest.mark.parametrize(
    ("offset", "middle", "found"),
    [
        ("G54", "G1 X10 F250\nX-600\n", []),
        ("G54", "G1 X10 F250\nX-1501\n", [("axis-limit", 2)]),
        ("G500", "G1 X10 F250\nX-501\n", [("axis-limit", 2)]),
        ("G54", "G1 X10 F250\nG0 Z10\nSUPA X-501 D0\n", [("axis-limit", 3)]),
        ("G500", "G1 X10 F250\nG54 X-501\nG500 X-502 Y1\n", [("axis-limit", 3)]),
    ],
)
def test_travel_leaves_room_for_a_zero_point(offset: str, middle: str, found: list[tuple[str, int]]) -> None:
    """(6.10) X travels from -500 to 1000: under G54 a zero point at 1000 leaves -1500; G500 and SUPA leave nothing."""
    got = ids(middle, head=HEAD.replace("G54", offset))
    assert [each for each in got if each[0] == "axis-limit"] == found


@given(st.lists(st.integers(0, 10**7), max_size=30), st.integers(0, 10**7))
@settings(max_examples=30, deadline=None)
def test_number_set(numbers: list[int], asked: int) -> None:
    seen = NumberSet()
    for number in numbers:
        seen.add(number)
    assert (asked in seen) == (asked in numbers)
    assert all(number in seen for number in numbers)


def test_words_are_checked_as_the_page_of_the_language_says() -> None:
    """(6.5, 6.10) Column `checked` of docs/dialects.md."""
    plain = ids("")
    for code in (*IGNORED_CODES, *(f"M{number}" for number in IGNORED_M)):
        assert ids(f"{code}\n") == plain, code
    for word in (*REFUSED_CODES, "M77", "G777", "NOSUCH=1"):
        assert ("unknown-word", 1) in ids(f"{word}\n"), word


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_an_axis_may_go_to_the_very_end_of_its_travel(axis: str) -> None:
    """(6.10) And no step of the control's resolution further."""
    limits = Limits(PROFILE)
    most_mm = limits.reach_mm(axis, True)[1]
    found = [ids(f"G1 X10 F250\nG1 {axis}{at_mm:.3f}\n") for at_mm in (most_mm, most_mm + 0.001)]
    assert [("axis-limit", 2) in one for one in found] == [False, True]


def test_a_unit_switched_there_and_back_is_told_twice() -> None:
    """(6.10) What comes behind it is read in the other unit each time."""
    assert [found for found in ids("G1 X1 F250\nG70\nG71\n") if found[0] == "unit-switch"] == [
        ("unit-switch", 2),
        ("unit-switch", 3),
    ]
