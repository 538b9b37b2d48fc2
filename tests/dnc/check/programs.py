"""A program without fault but for its middle, and what the check finds in it."""

from __future__ import annotations

from dnc.check.limits import Limits
from dnc.check.run import Check
from dnc.profile import load_profile
from dnc.shipped import shipped_path

PROFILE = load_profile(shipped_path("machines", "sinumerik-840d"))
HEAD = "%_N_T_MPF\nG17 G40 G64 G71 G90 G94\nG54\nG0 Z50\nT2 M6\nD1\nS1000 M3\nG4 F2\nG0 X0 Y0\nZ10\nG1 Z1 F100\n"
TAIL = "G0 Z50\nM5\nM30\n"


def ids(middle: str, limits: Limits | None = None, head: str = HEAD, tail: str = TAIL) -> list[tuple[str, int]]:
    """Every finding with its line, counted from the middle on."""
    check = Check(limits or Limits(PROFILE))
    for number, raw in enumerate((head + middle + tail).encode("latin-1").splitlines(keepends=True), 1):
        check.line(raw, number)
    check.finish()
    first = head.count("\n")
    return [(finding.id, finding.line - first) for finding in check.found.findings]
