"""Whether spindle, tool, edge and height are as a cut needs them, for programs and for subprograms."""

from __future__ import annotations

from pathlib import Path

import pytest

from dnc.check.limits import Limits
from dnc.check.run import Check, check_program
from tests.dnc.check.programs import HEAD, PROFILE, TAIL, ids


@pytest.mark.parametrize(
    "middle",
    [
        "G1 X9 F250\nM5\nG1 Z50 F2000\nX20\nZ60\nM3\nG0 Z10\nG1 Z1 F100\nX30 F250\n",
        "G1 X9 F250\nG0 SUPA Z0 D0\nG0 X9 D1\nZ10\nG1 Z1 F100\nX20 F250\n",
        "G1 X9 F250\nG0 SUPA Z0 D0\nT3 M6\nG0 X9\nZ10\nG1 Z1 F100\nX20 F250\n",
    ],
    ids=["leaving by feed", "the edge comes back", "a change of tool brings its edge"],
)
def test_what_is_ready_again_before_it_cuts_is_no_finding(middle: str) -> None:
    """(6.10) Retracts by feed with the spindle stopped, and D0 for the way to the tool change, are usual."""
    assert not {"no-spindle", "no-edge"} & {name for name, _ in ids(middle)}


def test_a_spindle_that_stands_is_told_in_bulk_as_block_by_block() -> None:
    """(6.10) Once for a stop, in the first block that cuts."""
    cuts = "".join(f"X{place} Y{place % 2}\n" for place in range(10, 60))
    middle = f"G1 X9 F250\nM5\n{cuts}"
    check = Check(Limits(PROFILE))
    check.chunk((HEAD + middle + TAIL).encode(), 1)
    found = [(one.id, one.line - HEAD.count("\n")) for one in check.finish().findings]
    assert found == ids(middle)
    assert found == [("no-spindle", 3)]


def test_a_subprogram_need_not_ready_the_machine(tmp_path: Path) -> None:
    """(6.10) Tool, spindle and offset are its caller's."""
    text = "G1 Z-1 F100\nX10 F250\nG0 Z5\nM17\n"
    for name, head in (("side.spf", ""), ("side.mpf", "%_N_SIDE_SPF\n")):
        path = tmp_path / name
        path.write_text(head + text)
        names = {one.id for one in check_program(path, Limits(PROFILE)).found.findings}
        assert not names & {"no-tool", "no-spindle", "no-offset"}, name


@pytest.mark.parametrize(
    "text",
    [
        "G1 Z-1 F100\nX10 F250\nG0 Z5\nX0\nM17\n",
        "PROC SIDE\nG91 G1 Z-1 F100\nG90 X10 F250\nG0 Z5\nX0\nRET\n",
        "G1 X10 F250\nG0 Z5\nX0\nM17\n",
    ],
    ids=["a plunge", "a step down", "no height at all"],
)
def test_where_a_subprogram_begins_is_not_known(text: str, tmp_path: Path) -> None:
    """(6.10) Its first plunge was taken to begin 500 mm up, and every rapid after it to run below the cut."""
    path = tmp_path / "side.spf"
    path.write_text(text)
    assert {one.id for one in check_program(path, Limits(PROFILE)).found.findings} <= {"no-header"}


def test_an_arc_that_dips_below_the_heights_of_rapids_cuts() -> None:
    """(6.10) Both its ends may be up there; so may those of one whose top is above the part be down there."""
    dip = "X9 F250\nG0 Z10\nM5\nG18 G3 X0 I-4.5 K0 F250\nG17\nM3\n"
    assert ("no-spindle", 4) in ids(dip)
    assert ids(dip.replace("G18 G3", "G18 G2").replace("G17", "G17\nG0 Z20")) == [("feed-in-air", 0)]
    assert ("rapid-below-clearance", 4) in ids("X9 F250\nG18 G2 X0 I-4.5 K0\nG17 G1 Z4\nG0 X30\n")


def test_a_tool_that_is_called_by_name_is_a_tool() -> None:
    """(6.10) A name without a digit was taken for T0, an empty spindle."""
    assert ids("X9 F250\n", head=HEAD.replace("T2", 'T="FINISHER"')) == []
    assert ("no-tool", 0) in ids("X9 F250\n", head=HEAD.replace("T2", "T0"))


def test_no_end_no_header_no_spindle_no_tool_no_feed() -> None:
    """(6.10)"""
    names = {name for name, _ in ids("", head="G0 Z50\nG1 X5\nG1 X5 F100\n", tail="")}
    assert {"no-end", "no-header", "no-spindle", "no-tool", "no-feed"} <= names


def test_dwell_is_missed_only_between_spindle_and_cut() -> None:
    """(2.4)"""
    assert ("no-spindle-dwell", 7 - 11) in ids("", head=HEAD.replace("G4 F2\n", "M8\n"))
