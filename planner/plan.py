"""The pipeline: a job becomes a tool path, a program and a report.

Nothing here reads a clock but for the planning time, and nothing writes a file.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from planner.clearance import check_clearance, stock_warnings
from planner.errors import InputRejected
from planner.job import Job, Operation, load_job, located
from planner.path.gouge import tool_side
from planner.path.model import Method, Pass, PlaneSpline, ToolPath
from planner.path.moves import in_order
from planner.path.strategy.angle import best_angle_rad
from planner.path.strategy.parallel import Layout, Wishes, lay_parallel
from planner.post.base import write_program
from planner.post.units import INCH_MM
from planner.post.written import ControlLimits, Written
from planner.report import plan_report
from planner.shapes import FIT_SHARE, Kind, kind_of, link_count, shape_layout
from planner.surface.curvature import survey
from planner.surface.load import load_surface
from planner.surface.patch import NurbsPatch
from planner.travel import Travel, check_part, check_program

FINEST_PATH_MM = 1e-5
LEAST_BYTES: dict[Kind, int] = {"arcs": 24, "linear": 11}  # of a block


@dataclass(frozen=True, slots=True)
class Planned:
    """A planned operation: the program's bytes with the sidecar, the tool path, and the report as JSON data.

    `layout` keeps the traced curves and scallop peaks for pictures; `warnings` are sentences for the user.
    """

    program: bytes
    sidecar: dict[str, Any]
    tool_path: ToolPath
    report: dict[str, Any]
    warnings: tuple[str, ...]
    job: Job
    layout: Layout


# What is not finite the checks find, and say where; the library's own warnings are nothing for an operator.
@np.errstate(all="ignore")
def plan_job(
    job_path: Path,
    control: ControlLimits,
    *,
    post: dict[str, str] | None = None,
    rapid_mm_min: float = 10_000.0,
    line: tuple[int, float] = (9600, 10.0),
    with_rivals: bool = False,
    lift_mm: float = 0.0,
    time_of: Callable[[bytes], float] | None = None,
    travel_mm: Travel | None = None,
) -> Planned:
    """Plan the job in this file for a control.

    `post` overrides keys of the job's `[post]` table; `line` is (baud, bits a character) of the machine's own line;
    `lift_mm` raises the whole program for an air cut; `time_of` tells the machining time of a program in s, in place
    of programmed speeds alone; `travel_mm` is how far the machine's axes X, Y, Z go.
    Raises InputRejected with one sentence for whatever cannot be planned.
    """
    job = _job_with(job_path, post or {})
    with _naming_lines(job_path, post or {}):
        operation = _only_operation(job, job_path)
        _check_digits(operation, control)
        patch = _only_patch(job_path.parent / job.part.surface)
        begin = time.perf_counter()
        if travel_mm is not None:
            check_part(patch, job.tool_of(operation).radius_mm, travel_mm, job_path)
        layout = _laid(job, operation, patch, job_path, coarse_mm(control))
        tool_path, written = _smallest(job, operation, layout, control, lift_mm)
        if not np.isfinite(written.rounding_mm):
            what = f"the digits that the control reads do not hold path_mm {operation.path_mm:g} over this part"
            raise InputRejected(what, remedy="give a larger part or path_mm", key=("operation", 0, "path_mm"))
        planning_s = time.perf_counter() - begin
        if travel_mm is not None:
            check_program(job, tool_path, travel_mm, job_path)
    report = plan_report(
        job, operation, tool_path, layout, written, line=line, rapid_mm_min=rapid_mm_min, planning_time_s=planning_s
    )
    if time_of is not None:
        report["machining_time_s"] = time_of(written.data)
    if with_rivals:
        from planner.rivals import compare_rivals

        report["rivals"] = compare_rivals(job, operation, layout, control)
    warnings = (*written.warnings, *stock_warnings(job), *_warnings(operation, report, line))
    return Planned(written.data, written.sidecar, tool_path, report, warnings, job, layout)


def _job_with(job_path: Path, post: dict[str, str]) -> Job:
    """The job in this file, with these keys of its `[post]` table in place of its own."""
    job = load_job(job_path)
    return msgspec.structs.replace(job, post=msgspec.structs.replace(job.post, **post))


@contextlib.contextmanager
def _naming_lines(job_path: Path, post: dict[str, str]) -> Iterator[None]:
    """Complaints about a key of the job, raised where its file is not known, with file and line."""
    try:
        yield
    except InputRejected as problem:
        if problem.key in {("post", key) for key in post}:  # an option was to blame
            raise
        raise located(problem, job_path) from None


def _only_patch(path: Path) -> NurbsPatch:
    """The patch in this surface file; raises InputRejected where it holds several."""
    patches = load_surface(path)
    if len(patches) != 1:
        what = f"{len(patches)} patches in one surface are not built yet"
        raise InputRejected(what, path=path, remedy="plan each patch in its own file")
    return patches[0]


def coarse_mm(control: ControlLimits) -> float:
    """How far rounding to the digits that the control reads moves a point at most; 0 where it reads any number."""
    unit_mm = INCH_MM if control.is_inch else 1.0
    return 0.0 if control.decimals is None else 0.5 * 3**0.5 * unit_mm * 10.0**-control.decimals


def _check_digits(operation: Operation, control: ControlLimits) -> None:
    """Raises InputRejected where one step of the numbers that the control reads is more than path_mm."""
    if control.decimals is None:
        return
    step_mm = (INCH_MM if control.is_inch else 1.0) * 10.0**-control.decimals
    if operation.path_mm < step_mm * (1 - 1e-9):
        reads = f"{control.decimals} decimals" + (" of an inch" if control.is_inch else "")
        what = (
            f"path_mm {operation.path_mm:g} is less than {step_mm:g} mm, one step of the {reads} that the control reads"
        )
        raise InputRejected(what, remedy="give path_mm no less than that", key=("operation", 0, "path_mm"))


def fit_path_mm(operation: Operation, control: ControlLimits) -> float:
    """The path_mm to fit for, of which `FIT_SHARE` is used: less where the control's digits want more of the rest."""
    left_mm = operation.path_mm - coarse_mm(control)
    return min(operation.path_mm, left_mm / FIT_SHARE) if left_mm > 0 else operation.path_mm


def _laid(job: Job, operation: Operation, patch: NurbsPatch, path: Path, coarse: float) -> Layout:
    """Traced curves of the operation."""
    wishes = _wishes(job, operation, patch, coarse)
    accuracy_mm, reading_mm = 1e-4 * operation.path_mm, 1e-2 * operation.path_mm
    layout = lay_parallel(patch, wishes, accuracy_mm=accuracy_mm, reading_mm=reading_mm)
    check_clearance(job, layout, path)
    return layout


def _smallest(
    job: Job, operation: Operation, layout: Layout, control: ControlLimits, lift_mm: float
) -> tuple[ToolPath, Written]:
    """The tool path whose program is the smallest of all that the job allows."""

    def written(path: ToolPath) -> tuple[ToolPath, Written]:
        return path, write_program(job, operation, path, control, lift_mm=lift_mm)

    def size_bytes(made: tuple[ToolPath, Written]) -> float:
        return len(made[1].data) if np.isfinite(made[1].rounding_mm) else np.inf

    made = [written(path) for path in _tool_paths(job, operation, layout, control)]
    best = min(made, key=size_bytes)
    is_given = job.post.blocks != "auto" or operation.fit == "paper"
    if is_given or not isinstance(best[0].passes[0].shape, PlaneSpline):
        return best
    for kind in _smaller_kinds(layout, operation.path_mm, best[1].cutting_bytes / len(best[0].passes)):
        with contextlib.suppress(InputRejected):
            other = _tool_path(job, operation, layout, shape_layout(layout, kind, fit_path_mm(operation, control)))
            best = min(best, written(other), key=size_bytes)
    return best


def _tool_paths(job: Job, operation: Operation, layout: Layout, control: ControlLimits) -> Iterator[ToolPath]:
    """The passes in the order they are cut, in every kind of shape whose program might be the smallest."""
    kinds = [kind_of(job.post.control, job.post.blocks, operation.fit, control.poly_degree)]
    if kinds == ["poly"] and job.post.blocks == "auto" and control.knot_rule_verified:
        kinds.append("free")
    for kind in kinds:
        yield _tool_path(job, operation, layout, shape_layout(layout, kind, fit_path_mm(operation, control)))


def _smaller_kinds(layout: Layout, path_mm: float, bytes_a_pass: float) -> Iterator[Kind]:
    """Arcs or straight moves, which every control reads, where they may take fewer bytes than splines take.

    Over a plane, a cylinder or a sphere they do, or where the tolerance is coarse; elsewhere their number in one pass
    shows that they do not.
    """
    middle = layout.curves[len(layout.curves) // 2]
    for kind, least_bytes in LEAST_BYTES.items():
        if link_count(middle, kind, path_mm) * least_bytes < bytes_a_pass:
            yield kind


def _tool_path(job: Job, operation: Operation, layout: Layout, passes: list[Pass]) -> ToolPath:
    return ToolPath(
        passes=in_order(passes, operation.pattern),
        radius_mm=job.tool_of(operation).radius_mm,
        pick_feeds_mm=np.diff(layout.planes_mm),
        scallops_mm=layout.peaks.height_mm,
        scallop_method=Method.SAMPLED,
    )


def budget_mm(operation: Operation, radius_mm: float, coarse_mm: float = 0.0) -> float:
    """How far a pass as written may stand from the exact one, eq. (18): the scallop is planned lower for it.

    That is `path_mm`, or more where the digits that the control reads cost `coarse_mm`, more than path_mm leaves them.
    """
    high_mm = max(operation.path_mm, FIT_SHARE * operation.path_mm + coarse_mm)
    scallop_mm = operation.scallop_mm
    if scallop_mm is not None and scallop_mm <= high_mm * radius_mm / (radius_mm - scallop_mm):
        what = f"scallop_mm {scallop_mm:g} leaves nothing beside path_mm {operation.path_mm:g}"
        raise InputRejected(what, remedy="lower path_mm or raise scallop_mm", key=("operation", 0, "path_mm"))
    return high_mm


def _only_operation(job: Job, path: Path) -> Operation:
    """The job's operation, if this planner has what it asks for."""

    def refuse(what: str, remedy: str, *key: str | int) -> InputRejected:
        return InputRejected(f"{what} is not built yet", path=path, remedy=remedy, key=key)

    if len(job.operation) > 1:
        raise refuse("more than one operation in a job", "plan each operation as a job of its own", "operation", 1)
    operation = job.operation[0]
    if operation.path_mm < FINEST_PATH_MM:
        what = f"path_mm {operation.path_mm:g} is finer than {FINEST_PATH_MM:g}, which doubles hold over a part"
        raise InputRejected(what, path=path, remedy="give a tolerance such as 0.001", key=("operation", 0, "path_mm"))
    tool = job.tool_of(operation)
    if tool.kind != "ball":
        raise refuse(f"a {tool.kind} tool", "use a ball-end tool", "tool", job.tool.index(tool), "kind")
    if operation.strategy != "parallel":
        raise refuse(f'strategy "{operation.strategy}"', 'use "parallel"', "operation", 0, "strategy")
    if operation.boundary:
        raise refuse("boundary", "leave it empty", "operation", 0, "boundary")
    return operation


def _wishes(job: Job, operation: Operation, patch: NurbsPatch, coarse: float) -> Wishes:
    """What the strategy is asked for; the angle is chosen here where the job leaves it open."""
    radius_mm, scallop_mm = job.tool_of(operation).radius_mm, operation.scallop_mm
    high_mm = budget_mm(operation, radius_mm, coarse)
    if operation.angle_deg == "auto":
        angle_rad = best_angle_rad(patch, tool_side(survey(patch)), radius_mm, scallop_mm)
    else:
        angle_rad = float(np.radians(operation.angle_deg))
    stock_mm, rolls_over = operation.stock_to_leave_mm, operation.edge == "roll-over"
    return Wishes(radius_mm, angle_rad, scallop_mm, operation.pick_feed_mm, stock_mm, rolls_over, high_mm)


def _warnings(operation: Operation, report: dict[str, Any], line: tuple[int, float]) -> list[str]:
    """Where the line cannot keep up with the feed."""
    found = []
    limits = report["feed_limit_mm_min"].get(str(line[0]), {})
    for override, limit in limits.items():
        if limit is not None and limit < operation.cut_mm_min:
            found.append(
                f"at {line[0]} baud and {override} % override the line feeds {limit:.0f} mm/min at most, "
                f"cut_mm_min is {operation.cut_mm_min:g}: some pass would starve"
            )
    return found
