"""Every finding of docs/findings.md fires on a program with just that fault, and no other does (6.10)."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from dnc.check.finding import Severity
from dnc.check.limits import Limits
from dnc.check.motion_rules import ALARM_IDS
from dnc.check.run import Check
from dnc.profile import load_profile
from dnc.shipped import shipped_path

ROOT = Path(__file__).parents[3]
Row = tuple[str, str]
ROWS = re.findall(r"^\| `([a-z-]+)` \| (error|warning|note) \|", (ROOT / "docs/findings.md").read_text(), re.MULTILINE)
LIMITS = Limits(load_profile(shipped_path("machines", "sinumerik-840d")), 10.0, ((0.0, 0.0, -20.0), (50.0, 50.0, 4.0)))
NAME = "%_N_T_MPF\n"
START = "G17 G40 G64 G71 G90 G94\nG54\nG0 Z50\nT2 M6\nD1\nS1000 M3\nG4 F2\nG0 X0 Y0\nZ10\nG1 Z1 F100\n"
END = "G0 Z50\nM5\nM30\n"


def part(middle: str) -> str:
    """A program without fault but for its middle."""
    return NAME + START + middle + END


def stamped(words: str) -> str:
    """A program without fault but for its stamp."""
    return part("X9 F250\n").replace(NAME, f"{NAME};DRIPMILL {words}\n")


EXAMPLES: dict[Row, str] = {
    ("encoding", "error"): "\xef\xbb\xbf" + part("X9 F250\n"),
    ("control-byte", "error"): part("X9 F250 ; \x13\n"),
    ("character", "error"): part("X9 F250 ; \xe4\n"),
    ("long-line", "error"): part("X9 F250 ;" + "A" * 600 + "\n"),
    ("syntax", "error"): part("X9 F250\nX20 Y\n"),
    ("unknown-word", "error"): part("X9 F250\nX20 Q1\n"),
    ("wrong-dialect", "error"): part("X9 F250\nG43 H1\n"),
    ("group-twice", "error"): part("X9 F250\nG1 G2 X20\n"),
    ("number-duplicate", "warning"): part("N5 X9 F250\nN5 X20\n"),
    ("number-descending", "warning"): part("N5 X9 F250\nN4 X20\n"),
    ("number-round", "note"): part("N9999 X9 F250\nN1 X20\n"),
    ("number-too-large", "error"): part("N123456789 X9 F250\n"),
    ("no-header", "note"): START + "X9 F250\n" + END,
    ("stray-percent", "note"): part("X9 F250\n%\n"),
    ("no-end", "error"): NAME + START + "X9 F250\nG0 Z50\nM5\n",
    ("no-last-end", "warning"): part("X9 F250\n").rstrip("\n"),
    ("after-end", "warning"): part("X9 F250\n") + "X9\n",
    ("no-feed", "error"): NAME + START.replace(" F100", "") + "X9 F250\n" + END,
    ("no-spindle", "error"): NAME + START.replace("S1000 M3\n", "") + "X9 F250\n" + END,
    ("no-edge", "warning"): NAME + START.replace("D1", "D0") + "X9 F250\n" + END,
    ("line-end", "error"): part("X9 F250\rX20\n"),
    ("no-offset", "warning"): NAME + START.replace("G54\n", "") + "X9 F250\n" + END,
    ("odd-feed", "warning"): part("X9 F250\nX20 F25000\n"),
    ("feed-in-rapid", "warning"): part("X9 F250\nG0 Z10\nX40 F250\n"),
    ("no-spindle-dwell", "note"): NAME + START.replace("G4 F2\n", "") + "X9 F250\n" + END,
    ("no-tool", "warning"): NAME + START.replace("T2 M6\n", "") + "X9 F250\n" + END,
    ("radius-unknown", "note"): part("G41 X9 F250\nX20\nG40 X30 Y9\n"),
    ("rapid-below-clearance", "error"): part("X9 F250\nG0 Z10\nZ9\nG1 X20\n"),
    ("rapid-through-stock", "error"): part("X9 F250\nG0 Z10\nX-5\nZ3\nY-5\nX60 Y60\n"),
    ("rapid-z-and-xy", "warning"): part("X9 F250\nG0 Z10\nX20 Z12\n"),
    ("arc-open", "error"): part("X9 F250\nG2 X20 Y0 I4 J0\n"),
    ("zero-length", "warning"): part("X9 F250\nX9\n"),
    ("empty-motion", "warning"): part("X9 F250\nG1\n"),
    ("reversal", "error"): part("X9 F250\nX4\nX20\n"),
    ("steep-plunge", "warning"): part("X9 F150\n"),
    ("feed-in-air", "note"): part("X9 F250\nG0 Z50\nG1 X40\n"),
    ("axis-limit", "error"): part("X9 F250\nX2000\n"),
    ("unit-switch", "warning"): part("X9 F250\nG70\nX.8\n"),
    ("missing-subprogram", "error"): part('X9 F250\nEXTCALL("POCKET")\n'),
    ("line-too-slow", "warning"): part("F5000\n" + "".join(f"X{0.1 * step:.4f}Y.0001\n" for step in range(1, 5000))),
    ("spline", "error"): part("BSPLINE X9 Z2 PL=-1 F250\n"),
    ("spline-blocks", "error"): part("BSPLINE X9 Z2 PL=0 F250\n" + "X20\nX21\nX22\nX23\nX24\nG1 X30\n"),
    ("spline-blocks", "warning"): part("BSPLINE X9 Z2 PL=0 F250\nX20 PL=1\nX21 PL=0\nG1 X30\n"),
    ("jump", "error"): part("X9 F250\nGOTOF AHEAD\nAHEAD: X20\n"),
    ("alarm", "error"): part("X9 F250\nX=1/0\n"),
    ("stamp-control", "error"): stamped("CONTROL=fanuc-30i REFERENCE=tip R=4 T=2 D=1 TOLERANCE=0.001"),
    ("stamp-reference", "error"): stamped("CONTROL=sinumerik-840d REFERENCE=centre R=4 T=2 D=1 TOLERANCE=0.001"),
    ("not-checked", "warning"): part("X9 F250\n" + 101 * "X20 Q1\n"),
}
COMPANIONS = {
    "no-feed": {"feed-in-air"},
    "rapid-below-clearance": {"feed-in-air"},
    "rapid-through-stock": {"rapid-below-clearance"},
    "unit-switch": {"axis-limit"},
    "spline": {"spline-blocks"},
    "spline-blocks": {"spline"},
    "not-checked": {"unknown-word"},
}
"""What else the fault brings with it."""


def found(program: str) -> list[Row]:
    check = Check(LIMITS)
    check.chunk(program.encode("latin-1"), 1)
    return [(one.id, one.severity.value) for one in check.finish().findings]


def test_the_page_lists_what_the_rules_can_say() -> None:
    """(6.10)"""
    told: set[Row] = {(name, "error") for name in (*ALARM_IDS.values(), "jump", "alarm")}
    for path in (ROOT / "dnc/check").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Finding":
                name, severity = node.args[:2]
                if isinstance(name, ast.Constant) and isinstance(severity, ast.Attribute):
                    told.add((str(name.value), Severity[severity.attr].value))
    assert sorted(told) == sorted(ROWS) == sorted(EXAMPLES)


@pytest.mark.parametrize("row", ROWS, ids="-".join)
def test_each_fires_where_its_fault_is_and_nothing_else_does(row: Row) -> None:
    """(6.10)"""
    names = {name for name, _ in found(EXAMPLES[row])}
    assert row in found(EXAMPLES[row])
    assert names <= {row[0], *COMPANIONS.get(row[0], ())}


def test_the_program_without_fault_is_clean() -> None:
    """(6.10) What the examples are made of has no finding."""
    assert found(part("X9 F250\n")) == []
