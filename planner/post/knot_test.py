"""An air program that tells at a real control which knot rule its BSPLINE follows.

One curve is written twice, by rule `nx` and by rule `genua`, in X and Y at a safe height, with no tool and no spindle.
In single block the control stops at the joints of the spans: the part whose stops agree with the table in its comments
names the rule. The knots are so uneven that the other rule misses them by millimetres, or raises an alarm.
"""

from __future__ import annotations

import numpy as np

from planner.path.model import Array, PlaneSpline
from planner.path.spans import bezier_points
from planner.post.numbers import plain

_POINTS = np.array([[0, 0], [10, 20], [20, -10], [35, 25], [50, -5], [60, 15], [70, 0]], dtype=np.float64)
_INTERVALS = (5, 40, 10, 25)


def probe_curve() -> PlaneSpline:
    """The curve in (X, Y): seven control points, four spans of very different length."""
    inner = np.cumsum(_INTERVALS)
    return PlaneSpline(3, np.concatenate([np.zeros(4), inner[:-1], np.full(4, inner[-1])]), _POINTS)


def joints(curve: PlaneSpline) -> Array:
    """Where the spans of a curve end, shape (spans, 2), mm."""
    return np.asarray(bezier_points([curve])[:, -1])


def knot_test_program(safe_z_mm: float, feed_mm_min: float = 500.0) -> bytes:
    """The program; every move is at `safe_z_mm` of the active work offset, X 0 to 70 and Y -10 to 25."""
    lines = [
        "%_N_KNOTTEST_MPF",
        ";$PATH=/_N_MPF_DIR",
        "; WHICH KNOT RULE DOES THIS CONTROL FOLLOW? RUN IN SINGLE BLOCK, FEED LOW, NOTHING ON THE TABLE.",
        "; IN THE PART OF THE RIGHT RULE THE AXES STOP AT EXACTLY THESE POINTS, IN THIS ORDER:",
        *(f"; X{x:.4f} Y{y:.4f}" for x, y in joints(probe_curve()).tolist()),
        "; NX: SET knot_rule = nx AND knot_rule_verified = TODAY. GENUA: SET knot_rule = genua LIKEWISE.",
        "; NEITHER: KEEP knot_rule_verified = false; PROGRAMS ARE THEN WRITTEN WITH POLY.",
        "G17 G40 G64 G710 G90 G94",
        "TRANS",
        "D0 M5",
        f"G0 Z{plain(safe_z_mm)}",
    ]
    for rule, first, offset in (("NX", 1, 1), ("GENUA", 0, 2)):
        lines += [f'MSG("RULE {rule}")', "G0 X0 Y0", "M0", *_blocks(first, offset, feed_mm_min), "G1 X80"]
    return "".join(f"{line}\n" for line in [*lines, "MSG()", "M30"]).encode("ascii")


def _blocks(first: int, offset: int, feed_mm_min: float) -> list[str]:
    intervals = np.diff(probe_curve().knots)
    words = [
        f"X{plain(x)} Y{plain(y)} PL={plain(intervals[number + offset])}"
        for number, (x, y) in enumerate(_POINTS.tolist())
        if number >= first
    ]
    return [f"G1 F{plain(feed_mm_min)}", f"BSPLINE SD=3 {words[0]}", *words[1:]]
