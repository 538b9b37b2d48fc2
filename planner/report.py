"""The plan report: what was planned, as plain JSON data (docs/schemas/plan.schema.json)."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.feed_limit import feed_limit_mm_min
from planner.job import Job, Operation
from planner.path.model import ArcChain, Method, PlaneSpline, Polyline, Shape, ToolPath
from planner.path.moves import AirMoves, air_moves
from planner.path.spans import bezier_points, joints_of
from planner.path.strategy.parallel import Layout
from planner.post.bspline import with_blocks
from planner.post.written import Written

Array = NDArray[np.float64]

BAUD_RATES = (1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200)
OVERRIDES_PERCENT = (100, 120)


def plan_report(
    job: Job,
    operation: Operation,
    tool_path: ToolPath,
    layout: Layout,
    written: Written,
    *,
    rapid_mm_min: float,
    line: tuple[int, float],
    planning_time_s: float,
) -> dict[str, Any]:
    """The report of one planned operation; `line` is (baud, bits a character) of the machine's own line."""
    to_centre_mm = tool_path.radius_mm if job.post.reference == "tip" else 0.0
    air = air_moves(tool_path.passes, job.setup.clearance_z_mm + to_centre_mm, job.setup.safe_z_mm + to_centre_mm)
    cut_mm = sum(one.length_mm for one in tool_path.passes)
    return {
        "schema": "dripmill.plan",
        "version": 1,
        "control": job.post.control,
        "blocks_kind": _kinds(tool_path),
        **_distances(operation, tool_path, layout),
        **_errors(tool_path, layout, written),
        "break_points": sum(len(one.break_points) for one in tool_path.passes),
        "spans": sum(segments(one.shape) for one in tool_path.passes),
        "blocks": written.blocks,
        "cutting_blocks": written.cutting_blocks,
        "bytes": len(written.data),
        "cutting_bytes": written.cutting_bytes,
        "rivals": [],
        "cut_length_mm": cut_mm,
        "air_length_mm": air.rapid_mm + air.plunge_mm,
        "machining_time_s": _machining_time_s(operation, cut_mm, air, rapid_mm_min),
        "planning_time_s": planning_time_s,
        "feed_limit_mm_min": feed_limits(job, operation, tool_path, written, line),
    }


def _distances(operation: Operation, tool_path: ToolPath, layout: Layout) -> dict[str, Any]:
    """How the passes lie, and what they leave between them."""
    peaks = layout.peaks
    return {
        "passes": len(tool_path.passes),
        "angle_deg": float(np.degrees(tool_path.passes[0].plane.angle_rad)),
        "planes": len(tool_path.pick_feeds_mm) + 1,
        "pick_feed_mm": tool_path.pick_feeds_mm.tolist(),
        "scallop_asked_mm": operation.scallop_mm,
        "scallop_mm": max(float(peaks.height_mm.max(initial=0.0)), peaks.first_mm, peaks.last_mm),
        "scallop_gaps_mm": peaks.height_mm.tolist(),
        "scallop_first_mm": peaks.first_mm,
        "scallop_last_mm": peaks.last_mm,
    }


def _errors(tool_path: ToolPath, layout: Layout, written: Written) -> dict[str, Any]:
    """How far the program as written may stand from the exact passes and cut into the part, and how that is known."""
    deviation_mm = max(one.deviation_mm for one in tool_path.passes)
    worst = max((one.method for one in tool_path.passes), key=lambda method: method.value)
    return {
        "gouge_mm": layout.gouge_mm + deviation_mm + written.rounding_mm,
        "path_deviation_mm": deviation_mm + written.rounding_mm,
        "fit_deviation_mm": deviation_mm,
        "rounding_mm": written.rounding_mm,
        "method": {
            "scallop_mm": tool_path.scallop_method.value,
            "gouge_mm": Method.SAMPLED.value,
            "path_deviation_mm": worst.value,
        },
    }


def segments(shape: Shape) -> int:
    """Polynomial spans, straight moves or arcs of a shape."""
    if isinstance(shape, PlaneSpline):
        return len(joints_of(shape)) - 1
    if isinstance(shape, Polyline):
        return len(shape.points) - 1
    assert isinstance(shape, ArcChain)
    return len(shape.turns)


def feed_limits(
    job: Job, operation: Operation, tool_path: ToolPath, written: Written, line: tuple[int, float]
) -> dict[str, dict[str, float | None]]:
    """The feed limit per baud rate and override in per cent; None where no feed starves the line."""
    sizes, cut_mm, plunge_mm = _tape_blocks(job, tool_path, written)
    bits = dict.fromkeys(BAUD_RATES, 10.0) | {line[0]: line[1]}
    limits: dict[str, dict[str, float | None]] = {}
    for baud, per_character in sorted(bits.items()):
        limits[str(baud)] = {}
        for percent in OVERRIDES_PERCENT:
            other_s = 60 * plunge_mm / (operation.plunge_mm_min * percent / 100)
            limit = feed_limit_mm_min(sizes, cut_mm, other_s, bytes_per_s=baud / per_character, override=percent / 100)
            limits[str(baud)][str(percent)] = None if np.isinf(limit) else limit
    return limits


def _tape_blocks(job: Job, tool_path: ToolPath, written: Written) -> tuple[Array, Array, Array]:
    """Bytes, cutting length and plunge length of every line of the program.

    The restart points say where each pass begins; inside a pass the last line is the retract and the lines before the
    first cutting one are the approach. A pass's length is shared by its cutting blocks as its segments share it.
    """
    lines = written.data.split(b"\n")
    sizes = np.array([len(text) + 1.0 for text in lines])
    cut_mm, plunge_mm = np.zeros(len(lines)), np.zeros(len(lines))
    to_centre_mm = tool_path.radius_mm if job.post.reference == "tip" else 0.0
    starts = [int(point["line"]) - 1 for point in written.sidecar["restart_points"]]
    extra = int(job.setup.safe_z_mm != job.setup.clearance_z_mm)
    counts = _cutting_counts(starts, written, extra)
    for start, count, one in zip(starts, counts, tool_path.passes, strict=False):
        first = start + 2 + (extra if start == starts[0] else 0)
        cut_mm[first : first + count] = _shares(one.shape, count) * one.length_mm
        plunge_mm[first - 1] = max(job.setup.clearance_z_mm + to_centre_mm - _first_z(one.shape), 0.0)
    return sizes, cut_mm, plunge_mm


def _cutting_counts(starts: list[int], written: Written, extra: int) -> list[int]:
    """Cutting blocks of every pass: what its lines leave beside approach (2, the first `extra` more) and retract."""
    inner = [after - before - 3 for before, after in pairwise(starts)]
    inner[:1] = [count - extra for count in inner[:1]]
    return [*inner, written.cutting_blocks - sum(inner)]


def _shares(shape: Shape, count: int) -> Array:
    """How the blocks of a pass share its length (count,): a block has the segment that begins when it falls due.

    Where no rule fits, the blocks share evenly.
    """
    if not isinstance(shape, PlaneSpline):
        runs = np.hypot(*np.diff(shape.points, axis=0).T)
    else:
        runs = _run_mm(shape)
        runs = (
            runs if len(runs) == count or shape.degree != 3 else _runs_of_points(with_blocks(shape, count + 1), count)
        )
    if len(runs) != count:
        runs = np.ones(count)
    return np.asarray(runs / runs.sum())


def _runs_of_points(spline: PlaneSpline, count: int) -> Array:
    """Lengths of the blocks of a BSPLINE: the span up to the knot behind point i wants the points up to i.

    The first three points come before the first span, with or without the very first.
    """
    points = len(spline.control_points)
    spans = np.diff(spline.knots[3 : points + 1])
    runs = np.zeros(len(spans))
    runs[spans > 0] = _run_mm(spline)
    return np.append(np.zeros(max(count - len(runs), 0)), runs)


def _run_mm(spline: PlaneSpline) -> Array:
    """About the lengths of the spans that are not empty."""
    return np.asarray(np.hypot(*np.diff(bezier_points([spline]), axis=1).transpose(2, 0, 1)).sum(axis=1))


def _first_z(shape: Shape) -> float:
    """Z of the ball's centre where the pass begins, mm."""
    points = shape.control_points if isinstance(shape, PlaneSpline) else shape.points
    return float(points[0, 1])


def _kinds(tool_path: ToolPath) -> str:
    names = {PlaneSpline: "spline", Polyline: "linear", ArcChain: "arcs"}
    return "+".join(sorted({names[type(one.shape)] for one in tool_path.passes}))


def _machining_time_s(operation: Operation, cut_mm: float, air: AirMoves, rapid_mm_min: float) -> float:
    """Time at programmed speeds; acceleration is the simulation's business."""
    minutes = cut_mm / operation.cut_mm_min + air.plunge_mm / operation.plunge_mm_min + air.rapid_mm / rapid_mm_min
    return 60 * minutes + operation.spindle_dwell_s
