"""The same passes as splines, arcs and straight moves at the same total error: segments and bytes of cutting blocks.

Prints the tables of docs/planner.md. Every way keeps the tolerance as written, rounding included; words are modal,
without N and blanks, and every pass takes the fewest digits that keep its budget.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np

from benchmarks.planner_speed import fixed
from dnc.shipped import shipped_path
from planner.job import Job, load_job
from planner.path.model import Method, Pass, Polyline, ToolPath
from planner.path.moves import in_order
from planner.path.strategy.parallel import Wishes, prepare
from planner.path.trace import TracedCurve
from planner.post.base import write_program
from planner.post.written import ControlLimits
from planner.report import segments
from planner.shapes import FIT_SHARE, Kind, shape_passes
from planner.surface.load import load_surface

R_MM = 4.0
WAYS: tuple[tuple[str, Kind | None, str], ...] = (
    ("degree 5, POLY", "poly", "poly"),
    ("cubics, BSPLINE", "free", "bspline"),
    ("cubics, POLY", "free", "poly"),
    ("arcs", "arcs", "arcs"),
    ("G1, vertices off the curve", "linear", "linear"),
    ("G1, vertices on the curve", None, "linear"),
)


def main() -> int:
    """One table a case."""
    cases = (
        ("thesis", np.linspace(1.7418, 49.681, 8), (1.0, 50.0), (0.010, 0.001, 0.00025, 0.0001)),
        ("thesis", np.array([1.2249]), (1.0, 50.0), (0.00025,)),
        ("wave", np.linspace(10.0, 290.0, 8), (1.2, 298.8), (0.010, 0.001, 0.00025, 0.0001)),
    )
    for surface, planes, ends, tolerances in cases:
        print(
            f"\n{surface}: {len(planes)} pass{'es' if len(planes) > 1 else ''} "
            f"from x = {ends[0]} to {ends[1]}, y = {planes[0]:g} ... {planes[-1]:g}\n"
        )
        print(f"| way | {' | '.join(f'{1e3 * path_mm:g} um' for path_mm in tolerances)} |")
        print(f"|---|{'---|' * len(tolerances)}")
        for name, kind, blocks in WAYS:
            cells = (_cell(surface, planes, ends, kind, blocks, path_mm) for path_mm in tolerances)
            print(f"| {name} | {' | '.join(cells)} |", flush=True)
    return 0


def _cell(
    surface: str, planes: np.ndarray, ends: tuple[float, float], kind: Kind | None, blocks: str, path_mm: float
) -> str:
    """Segments and bytes, both a pass."""
    (patch,) = load_surface(shipped_path("surfaces", surface))
    curves = fixed(prepare(patch, Wishes(R_MM, 0.0, None, 1.0)), planes, *ends, path_mm)
    passes = [_on_curve(one, FIT_SHARE * path_mm) for one in curves]
    if kind is not None:
        passes = shape_passes(curves, kind, path_mm, R_MM)
    job = _job(blocks, path_mm)
    ordered = in_order(passes, "zigzag")
    path = ToolPath(ordered, R_MM, np.zeros(0), np.zeros(0), Method.SAMPLED)
    written = write_program(job, job.operation[0], path, ControlLimits())
    count = len(passes)
    return f"{sum(segments(one.shape) for one in ordered) / count:.1f} / {written.cutting_bytes / count:.0f}"


def _job(blocks: str, path_mm: float) -> Job:
    """The thesis job with these blocks and this tolerance."""
    job = load_job(Path(shipped_path("jobs", "thesis")))
    operation = msgspec.structs.replace(job.operation[0], path_mm=path_mm)
    return msgspec.structs.replace(job, operation=[operation], post=msgspec.structs.replace(job.post, blocks=blocks))


def _on_curve(curve: TracedCurve, tolerance_mm: float) -> Pass:
    """The fewest chords from point to point of the curve, each as long as its sag allows."""
    count = max(2000, int(20 * curve.length_mm / np.sqrt(tolerance_mm)) // 100)
    points = curve.refine(np.linspace(0.0, curve.length_mm, count)).points
    corners = [0]
    while corners[-1] < count - 1:
        near, far = corners[-1] + 1, count
        while far - near > 1:
            middle = (near + far) // 2
            near, far = (middle, far) if _sag_mm(points[corners[-1] : middle + 1]) <= tolerance_mm else (near, middle)
        corners.append(near)
    worst = max(_sag_mm(points[a : b + 1]) for a, b in pairwise(corners))
    return Pass(curve.plane, Polyline(points[corners]), worst, Method.SAMPLED, np.zeros((0, 2)), curve.length_mm)


def _sag_mm(points: np.ndarray) -> float:
    """The largest distance of points from the chord between the first and the last."""
    chord = points[-1] - points[0]
    gap = points - points[0]
    return float(np.abs(gap[:, 0] * chord[1] - gap[:, 1] * chord[0]).max() / np.hypot(*chord))


if __name__ == "__main__":
    sys.exit(main())
