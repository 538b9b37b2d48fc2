"""The job file as frozen values: what to cut, with what, how finely, and for which control.

Lengths mm, feeds mm/min, angles in the file in degrees (the `_deg` keys). Schema: docs/interface, section 3.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from planner import tomlfile
from planner.errors import InputRejected

Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]
Feed = Annotated[float, Meta(ge=0.001, le=999_999.999)]  # what an F word can say
SpindleSpeed = Annotated[float, Meta(ge=0.001, le=999_999.999)]
Angle = Annotated[float, Meta(ge=-360, le=360)]
Height = Annotated[float, Meta(ge=-1e6, le=1e6)]
Dwell = Annotated[float, Meta(ge=0, le=3600)]
Xy = tuple[float, float]
Xyz = tuple[float, float, float]


class Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The surface file, relative to the job file."""

    surface: str


class Setup(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where the part stands on the machine; heights above the work offset."""

    clearance_z_mm: Height
    safe_z_mm: Height
    work_offset: str = "G54"
    origin: str = ""
    stock_box_mm: tuple[Xyz, Xyz] | None = None


class Tool(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One cutter; `length_mm` out of the holder."""

    number: Annotated[int, Meta(ge=1, le=32000)]
    kind: Literal["ball", "bull", "flat"]
    diameter_mm: Positive
    edge: Annotated[int, Meta(ge=1, le=9)] = 1
    corner_radius_mm: NotNegative | None = None
    length_mm: Positive | None = None
    flutes: Annotated[int, Meta(ge=1)] = 2

    @property
    def radius_mm(self) -> float:
        """Half the diameter: the ball radius R of a ball-end mill, in mm."""
        return self.diameter_mm / 2


class Operation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One finishing operation; exactly one of `scallop_mm` and `pick_feed_mm` is given."""

    tool: int
    path_mm: Positive
    cut_mm_min: Feed
    spindle_rpm: SpindleSpeed
    strategy: Literal["parallel", "isoparametric", "constant-scallop"] = "parallel"
    angle_deg: Angle | Literal["auto"] = 0.0
    pattern: Literal["zigzag", "one-way"] = "zigzag"
    scallop_mm: Positive | None = None
    pick_feed_mm: Positive | None = None
    edge: Literal["to-border", "roll-over"] = "to-border"
    fit: Literal["free", "paper"] = "free"
    stock_to_leave_mm: NotNegative = 0.0
    boundary: tuple[tuple[Xy, ...], ...] = ()
    plunge_mm_min: Feed = 100.0
    spindle_dwell_s: Dwell = 0.0
    coolant: Literal["off", "flood", "mist"] = "off"


class Post(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the program is written."""

    control: Literal["sinumerik-840d", "fanuc-30i", "heidenhain-itnc530", "linuxcnc", "generic"] = "sinumerik-840d"
    blocks: Literal["auto", "bspline", "poly", "nurbs", "spl", "arcs", "linear"] = "auto"
    reference: Literal["tip", "centre"] = "tip"
    numbers: Literal["none", "pass", "all"] = "pass"
    name: str = "PART"


class Job(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A whole job file; tables `tool` and `operation` may repeat."""

    part: Part
    setup: Setup
    tool: Annotated[tuple[Tool, ...], Meta(min_length=1)]
    operation: Annotated[tuple[Operation, ...], Meta(min_length=1)]
    post: Post = msgspec.field(default_factory=Post)

    def tool_of(self, operation: Operation) -> Tool:
        """The tool an operation names; `load_job` has checked that it exists."""
        return next(tool for tool in self.tool if tool.number == operation.tool)

    @property
    def tool_radii_mm(self) -> dict[int, float]:
        """Radii by tool number."""
        return {tool.number: tool.radius_mm for tool in self.tool}


def load_job(path: Path) -> Job:
    """The job in this file; raises InputRejected with file and line for anything that cannot be planned."""
    job, lines = tomlfile.load(path, Job)
    if job.setup.safe_z_mm < job.setup.clearance_z_mm:
        _reject(path, lines, ("setup", "safe_z_mm"), "safe_z_mm is below clearance_z_mm", "raise it")
    _check_box(job.setup, path, lines)
    for index, tool in enumerate(job.tool):
        if any(one.number == tool.number for one in job.tool[:index]):
            what = f"tool {tool.number} is described twice, and an operation names no edge"
            _reject(path, lines, ("tool", index), what, "keep one of them, or number them apart")
        if tool.kind != "bull" and tool.corner_radius_mm is not None:
            what = "corner_radius_mm goes with a bull-nose tool"
            _reject(path, lines, ("tool", index, "corner_radius_mm"), what, 'leave it out, or write kind = "bull"')
        if tool.length_mm is not None and tool.length_mm <= tool.radius_mm:
            what = f"length_mm {tool.length_mm:g} is not above the tool's radius {tool.radius_mm:g}"
            _reject(path, lines, ("tool", index, "length_mm"), what, "give the length out of the holder")
    for index, operation in enumerate(job.operation):
        _check_operation(job, operation, ("operation", index), path, lines)
    return job


def located(problem: InputRejected, path: Path) -> InputRejected:
    """The same complaint with the line that its key has in this job file, or the table that lacks it."""
    if problem.line is not None or not problem.key:
        return problem
    lines = tomlfile.key_lines(tomlfile.read_text(path))
    heads = (problem.key[:count] for count in range(len(problem.key), 0, -1))
    line = next((lines[head] for head in heads if head in lines), None)
    return type(problem)(problem.what, path=path, line=line, remedy=problem.remedy)


def _check_box(setup: Setup, path: Path, lines: dict[tomlfile.KeyPath, int]) -> None:
    """Raises InputRejected where the billet has no inside."""
    if setup.stock_box_mm is None:
        return
    low, high = setup.stock_box_mm
    for axis, below, above in zip("XYZ", low, high, strict=True):
        if below >= above:
            what = f"stock_box_mm runs from {axis}{below:g} to {axis}{above:g}"
            _reject(path, lines, ("setup", "stock_box_mm"), what, "give the lowest corner first, then the highest")


def _check_operation(
    job: Job, operation: Operation, at: tomlfile.KeyPath, path: Path, lines: dict[tomlfile.KeyPath, int]
) -> None:
    if all(tool.number != operation.tool for tool in job.tool):
        known = ", ".join(str(tool.number) for tool in job.tool)
        _reject(path, lines, (*at, "tool"), f"tool {operation.tool} is not in the job", f"known: {known}")
    radius_mm = job.tool_of(operation).radius_mm
    if (operation.scallop_mm is None) == (operation.pick_feed_mm is None):
        _reject(path, lines, at, "needs either scallop_mm or pick_feed_mm", "give exactly one of them")
    if operation.scallop_mm is not None and operation.scallop_mm >= radius_mm:
        what = f"scallop_mm {operation.scallop_mm:g} is not below the ball radius {radius_mm:g}"
        _reject(path, lines, (*at, "scallop_mm"), what, "give a height such as 0.01")
    if operation.pick_feed_mm is not None and operation.pick_feed_mm >= 2 * radius_mm:
        what = f"pick_feed_mm {operation.pick_feed_mm:g} is not below the ball diameter {2 * radius_mm:g}"
        _reject(path, lines, (*at, "pick_feed_mm"), what, "give less than the diameter")


def _reject(path: Path, lines: dict[tomlfile.KeyPath, int], at: tomlfile.KeyPath, what: str, remedy: str) -> None:
    raise InputRejected(what, path=path, line=lines.get(at), remedy=remedy)
