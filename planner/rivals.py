"""The other ways to write the same passes, measured: Lartigue's rule, arcs, straight moves, at several tolerances."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from planner.errors import InputRejected
from planner.job import Job, Operation
from planner.path.model import ToolPath
from planner.path.moves import in_order
from planner.path.spline import HEIGHTS_DEGREE
from planner.path.strategy.parallel import Layout
from planner.post.base import write_program
from planner.post.written import ControlLimits
from planner.report import segments
from planner.shapes import Kind, shape_layout

TOLERANCES_MM = (0.010, 0.001, 0.00025, 0.0001)
KINDS: tuple[tuple[Kind, str], ...] = (
    ("poly", "poly"),
    ("free", "auto"),
    ("paper", "auto"),
    ("arcs", "arcs"),
    ("linear", "linear"),
)
MOST_PASSES = 4


def compare_rivals(job: Job, operation: Operation, layout: Layout, control: ControlLimits) -> list[dict[str, Any]]:
    """Segments, blocks and bytes of every way at every tolerance, over at most 4 evenly chosen passes.

    A way that this control or this tolerance cannot be written in says so in `note` and has no numbers.
    """
    chosen = np.unique(np.linspace(0, int(layout.pass_of[-1]), MOST_PASSES).astype(np.intp)).tolist()
    return [
        _measure(job, operation, layout, chosen, kind, blocks, path_mm, control)
        for path_mm in TOLERANCES_MM
        for kind, blocks in KINDS
    ]


def _measure(
    job: Job,
    operation: Operation,
    layout: Layout,
    chosen: list[int],
    kind: Kind,
    blocks: str,
    path_mm: float,
    control: ControlLimits,
) -> dict[str, Any]:
    radius_mm = job.tool_of(operation).radius_mm
    row: dict[str, Any] = {"way": kind, "path_mm": path_mm, "passes": len(chosen)}
    if kind == "poly" and control.poly_degree < HEIGHTS_DEGREE:
        return row | {"note": f"the control is known to read POLY of degree {control.poly_degree} only"}
    try:
        wanted = msgspec.structs.replace(operation, path_mm=path_mm)
        passes = in_order(shape_layout(layout, kind, path_mm, chosen), operation.pattern)
        path = ToolPath(passes, radius_mm, np.zeros(0), np.zeros(0), passes[0].method)
        written = write_program(
            msgspec.structs.replace(job, post=msgspec.structs.replace(job.post, blocks=blocks)), wanted, path, control
        )
    except InputRejected as problem:
        return row | {"note": problem.what}
    return row | {
        "segments": sum(segments(one.shape) for one in passes),
        "blocks": written.cutting_blocks,
        "bytes": written.cutting_bytes,
        "deviation_mm": max(one.deviation_mm for one in passes) + written.rounding_mm,
        "method": passes[0].method.value,
    }
