"""Every word stands in one of three lists, and behaves as its list says (6.5)."""

from __future__ import annotations

import string
from pathlib import Path

import pytest

from planner.gcode import GROUP_OF
from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import Settings, Tool
from sim.interpreter.vocabulary import (
    ACTED_ADDRESSES,
    ACTED_CODES,
    ACTED_M,
    IGNORED_ADDRESSES,
    IGNORED_CODES,
    IGNORED_M,
    REFUSED_CODES,
    REFUSED_WORDS,
)
from sim.interpreter.word_table import table, table_without_effect

ROOT = Path(__file__).parents[3]
CONTROL = Settings(start_mm=(0.0, 0.0, 0.0), tools={1: Tool(1.0)})
HEAD = "T1 M6\nG1 X1 F100 S100 M3\n"


def after(text: str, head: str = HEAD) -> list[canon.Command]:
    """What a block gives behind the usual head."""
    count = len(list(interpret(head.encode(), CONTROL)))
    return list(interpret((head + text).encode(), CONTROL))[count:]


def test_every_code_of_the_language_stands_in_exactly_one_list() -> None:
    """(6.5)"""
    lists = [set(ACTED_CODES), set(IGNORED_CODES), set(REFUSED_CODES)]
    for code in GROUP_OF:
        assert sum(code in one for one in lists) == 1, code
    assert set().union(*lists) == set(GROUP_OF)
    assert not ACTED_M & set(IGNORED_M)
    assert not ACTED_ADDRESSES & set(IGNORED_ADDRESSES)


@pytest.mark.parametrize("code", sorted(IGNORED_CODES))
def test_accepted_without_effect(code: str) -> None:
    """(6.5)"""
    assert after(code) == []
    moved = after(f"{code} X5\nX7")
    assert [type(command) for command in moved] == [canon.Line, canon.Line]


@pytest.mark.parametrize("code", sorted(REFUSED_CODES))
def test_refused_by_name(code: str) -> None:
    """(6.5)"""
    (found,) = after(f"N7 {code} X5")
    assert isinstance(found, canon.Alarm)
    assert (found.number, found.block, found.column) == (12470, 7, 4)
    assert code in found.text
    assert REFUSED_CODES[code] in found.text


# A block in which the code does something, and what must differ: the commands of the block or of a block after it.
EFFECTS = {
    "G0": ("G0 X5", ""), "G1": ("G1 X5", ""), "G2": ("G2 X5 CR=4", ""), "G3": ("G3 X5 CR=4", ""),
    "CIP": ("CIP X5 I1=3 J1=1", ""), "CT": ("CT X5 Y5", ""), "POLY": ("POLY PO[X]=(5,1)", ""),
    "ASPLINE": ("ASPLINE X5 Y1\nX7", ""), "CSPLINE": ("CSPLINE X5 Y1\nX7", ""), "BSPLINE": ("BSPLINE X5\nX7\nX9", ""),
    "G4": ("G4 F1", ""), "G28": ("G28 X5", ""), "G74": ("G74 X1=0", ""), "G75": ("G75 X1=0", ""),
    "TRANS": ("TRANS X5", "X1"), "ATRANS": ("ATRANS X5", "X1"), "ROT": ("ROT RPL=30", "X5"),
    "AROT": ("AROT RPL=30", "X5"), "SCALE": ("SCALE X2", "X5"), "ASCALE": ("ASCALE X2", "X5"),
    "MIRROR": ("MIRROR X0", "X5"), "AMIRROR": ("AMIRROR X0", "X5"), "G25": ("G25 X9", "X5"), "G26": ("G26 X3", "X5"),
    "G58": ("G58 X2", "X5"), "G59": ("G59 X2", "X5"),
    "G17": ("G18\nG17", "G2 X5 CR=4"), "G18": ("G18", "G2 X5 CR=4"), "G19": ("G19", "G2 Y5 CR=4"),
    "G40": ("G41\nY5\nG40 X9", "X20"), "G41": ("G41", "X5\nX9"), "G42": ("G42", "X5\nX9"),
    "G450": ("G451 G41 X0\nG450", "Y9\nX9"), "G451": ("G451 G41 X0", "Y9\nX9"),
    "G60": ("G60", ""), "G64": ("G60\nG64", ""), "G641": ("G641", ""), "G642": ("G642", ""), "G643": ("G643", ""),
    "G644": ("G644", ""), "G645": ("G645", ""), "G9": ("G9 X5", ""),
    "G70": ("G70", "X5"), "G71": ("G70\nG71", "X5"), "G700": ("G700", "X5"), "G710": ("G700\nG710", "X5"),
    "G90": ("G91\nG90", "X5"), "G91": ("G91", "X5"),
    "G93": ("G93", "X5 F2"), "G94": ("G93\nG94", "F5 X5"), "G95": ("G95", "X5 F2"),
    "CFC": ("CFTCP\nCFC G41 X0", "G2 X9 CR=5"), "CFTCP": ("CFTCP G41 X0", "G2 X9 CR=5"),
    "CFIN": ("CFIN G41 X0", "G2 X9 CR=5"),
    "BNAT": ("BNAT CSPLINE X5 Y1\nX7", ""), "BTAN": ("BTAN CSPLINE X5 Y1\nX7", ""),
    "BAUTO": ("BAUTO CSPLINE X5 Y1\nX7\nX9", ""), "ENAT": ("ENAT CSPLINE X5 Y1\nX7\nG1 Y9", ""),
    "ETAN": ("ETAN CSPLINE X5 Y1\nX7\nG1 Y9", ""), "EAUTO": ("EAUTO CSPLINE X5 Y1\nX7\nX8\nG1 Y9", ""),
    "BRISK": ("SOFT\nBRISK", ""), "SOFT": ("SOFT", ""), "DRIVE": ("DRIVE", ""),
    "WALIMON": ("G26 X3\nWALIMOF\nWALIMON", "X5"), "WALIMOF": ("G26 X3\nWALIMOF", "X5"),
    "G53": ("TRANS X3\nG53 X5", ""), "G153": ("TRANS X3\nG153 X5", ""), "SUPA": ("TRANS X3\nSUPA X5", ""),
    "G500": ("G54\nG500", "X5"),
}  # fmt: skip
OFFSETS = {f"G{number}" for number in [54, 55, 56, 57, *range(505, 600)]}


@pytest.mark.parametrize("code", sorted(ACTED_CODES - OFFSETS))
def test_acted_on(code: str) -> None:
    """(6.5) The block gives no alarm for being unknown, and without the code its effect is another."""
    control = Settings(start_mm=(0.0, 0.0, 0.0), tools={1: Tool(1.0)}, work_offsets_mm={"G54": (1.5, 2.0, 3.0)})
    block, later = EFFECTS[code]
    text = f"{HEAD}{block}\n{later}\nG0 Z50\n"
    without = "\n".join(" ".join(word for word in line.split() if word != code) for line in block.split("\n"))
    with_code = list(interpret(text.encode(), control))
    plain = list(interpret(f"{HEAD}{without}\n{later}\nG0 Z50\n".encode(), control))
    assert not [one for one in with_code if isinstance(one, canon.Alarm) and one.number in (12470, 12550, 12080)]
    # these are the state already
    if code not in ("G1", "BTAN", "ETAN"):
        assert with_code != plain, code


@pytest.mark.parametrize("code", sorted(OFFSETS))
def test_settable_offsets(code: str) -> None:
    """(6.2)"""
    control = Settings(start_mm=(0.0, 0.0, 0.0), work_offsets_mm={code: (1.0, 2.0, 3.0)}, reference_offset="G500")
    (move,) = interpret(f"G0 {code} X0 Y0 Z0".encode(), control)
    assert isinstance(move, canon.Rapid)
    assert move.end == (1.0, 2.0, 3.0)


@pytest.mark.parametrize("number", range(100))
def test_every_m_function(number: int) -> None:
    """(6.5)"""
    found = after(f"N7 M{number}", head="T1\nS100 M4 M8\n")
    if number in IGNORED_M:
        assert found == []
    elif number in ACTED_M:
        assert found
        assert not isinstance(found[-1], canon.Alarm)
    else:
        assert [type(one) for one in found] == [canon.Alarm]
        accepted = Settings(start_mm=(0.0, 0.0, 0.0), accepted_m_codes=frozenset({number}))
        assert list(interpret(f"M{number}".encode(), accepted)) == []


def test_every_single_letter() -> None:
    """(6.5) A letter is an address that is acted on or accepted, G or M, or an alarm (N too, but at the head)."""
    for letter in string.ascii_uppercase:
        found = after(f"G1 {letter}1" if letter != "G" else "G1")
        is_alarm = bool(found) and isinstance(found[-1], canon.Alarm) and found[-1].number == 12550
        known = letter in ACTED_ADDRESSES or letter in IGNORED_ADDRESSES or letter in "GM"
        assert is_alarm != known, letter


@pytest.mark.parametrize("word", sorted(IGNORED_ADDRESSES))
def test_addresses_without_effect(word: str) -> None:
    """(6.5)"""
    calls = {"STOPRE", "DISPLOF", "DISPLON", "TRAFOOF", "SETMS", "SPATH", "UPATH"}
    lists = {"SPLINEPATH", "POLYPATH", "CYCLE832", "WORKPIECE", "GROUP_BEGIN", "GROUP_END"}
    text = word if word in calls else f'{word}(1,,"X",Y)' if word in lists else f"{word}=1"
    assert after(text) == []


@pytest.mark.parametrize("word", sorted(REFUSED_WORDS))
def test_words_refused_by_name(word: str) -> None:
    """(6.5) As an address, as a function, as a call, whichever the language knows: an alarm that says what it is."""
    is_call = REFUSED_WORDS[word] in ("a transformation", "a modal call", "a machining cycle")
    text = word if is_call else "F=FPO(100,200)" if word == "FPO" else f"{word}=1"
    (found,) = after(f"N7 {text}")
    assert isinstance(found, canon.Alarm)
    assert (found.number, found.block, found.column) == (12550, 7, 4)
    assert f"{word} ({REFUSED_WORDS[word]})" in found.text


def test_a_number_inside_a_block_is_told() -> None:
    """(6.1)"""
    (found,) = after("G1 N7 X5")
    assert isinstance(found, canon.Alarm)
    assert "expected at its head" in found.text


def test_what_a_block_does_not_use_is_an_alarm() -> None:
    """(6.5) Nothing is skipped in silence."""
    for text in (
        "G1 X5 I3",
        "G0 X5 CR=3",
        "G1 X5 PL=2",
        "TRANS X1 CR=2",
        "G1 X5 TURN=2",
        "G4 F1 X5",
        "G1 X5 FP=1",
        "P3",
    ):
        found = after(text)
        assert isinstance(found[-1], canon.Alarm), text
        assert found[-1].number == 12110, text


def test_the_pages_show_the_lists() -> None:
    """(6.5) docs/dialects.md and sim/MODEL.md; `python -m sim.interpreter.word_table` prints both."""
    assert table() in (ROOT / "docs/dialects.md").read_text()
    shown = table_without_effect()
    assert (ROOT / "sim/MODEL.md").read_text().endswith(f"\n\n{shown}")
    words = {word for row in shown.splitlines()[2:] for word in row.split(" | ")[0].split()}
    assert words - {"|"} == {*IGNORED_CODES, *IGNORED_ADDRESSES, *(f"M{number}" for number in IGNORED_M)}
