"""The design as the verdict sees it: its own reading of job and surface files.

Nothing here comes from `planner.surface` or `planner.job`, on purpose: a swapped u and v or a bad loader must not hide
in plan and verdict at once. Lengths mm.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from scipy.interpolate import NdBSpline

from planner import tomlfile
from sim.errors import InputRejected
from sim.nominal_patch import NominalPatch


@dataclass(frozen=True, slots=True)
class CutterData:
    """The cutter as the job names it; `corner_mm` is R for a ball, 0 for a flat end mill."""

    kind: Literal["ball", "bull", "flat"]
    radius_mm: float
    corner_mm: float


@dataclass(frozen=True, slots=True)
class Nominal:
    """The design surface with what the job says of tool and programmed point."""

    patches: tuple[NominalPatch, ...]
    cutter: CutterData
    reference: Literal["tip", "centre"]
    scallop_mm: float | None


class _Patch(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    degree: tuple[int, int]
    knots_u: list[float]
    knots_v: list[float]
    control_points: list[list[tuple[float, float, float]]]
    weights: list[list[float]] | None = None


class _SurfaceFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    degree: tuple[int, int] | None = None
    knots_u: list[float] | None = None
    knots_v: list[float] | None = None
    control_points: list[list[tuple[float, float, float]]] | None = None
    weights: list[list[float]] | None = None
    patch: list[_Patch] = []


class _Part(msgspec.Struct, frozen=True):
    surface: str


class _Tool(msgspec.Struct, frozen=True):
    number: int
    kind: Literal["ball", "bull", "flat"]
    diameter_mm: float
    corner_radius_mm: float | None = None


class _Operation(msgspec.Struct, frozen=True):
    tool: int
    scallop_mm: float | None = None
    stock_to_leave_mm: float = 0.0


class _Post(msgspec.Struct, frozen=True):
    reference: Literal["tip", "centre"] = "tip"


class _JobFile(msgspec.Struct, frozen=True):
    part: _Part
    tool: list[_Tool]
    operation: list[_Operation]
    post: _Post = msgspec.field(default_factory=_Post)


def load_nominal(job_path: Path) -> Nominal:
    """The design named by a job file; raises InputRejected with file, line and remedy.

    Tool and stock to leave are those of the first operation.
    """
    job, lines = tomlfile.load(job_path, _JobFile)
    if not job.operation:
        raise InputRejected("has no operation", path=job_path, remedy="add an [[operation]] table")
    operation = job.operation[0]
    tool = next((each for each in job.tool if each.number == operation.tool), None)
    if tool is None:
        line = lines.get(("operation", 0, "tool"))
        raise InputRejected(
            f"tool {operation.tool} is not in the job", path=job_path, line=line, remedy="add a [[tool]] table"
        )
    if tool.diameter_mm <= 0:
        raise InputRejected("diameter_mm is not above 0", path=job_path, remedy="give the cutter's diameter")
    patches = load_patches(job_path.parent / job.part.surface, operation.stock_to_leave_mm)
    radius_mm = tool.diameter_mm / 2
    corner_mm = {"ball": radius_mm, "flat": 0.0, "bull": tool.corner_radius_mm or 0.0}[tool.kind]
    return Nominal(patches, CutterData(tool.kind, radius_mm, corner_mm), job.post.reference, operation.scallop_mm)


def load_patches(path: Path, offset_mm: float = 0.0) -> tuple[NominalPatch, ...]:
    """All patches of a surface file; raises InputRejected with file, line and remedy."""
    surface, lines = tomlfile.load(path, _SurfaceFile)
    if surface.patch:
        return tuple(
            _patch(table, path, lines, ("patch", index), offset_mm) for index, table in enumerate(surface.patch)
        )
    single = {name: getattr(surface, name) for name in _Patch.__struct_fields__}
    missing = [name for name, value in single.items() if value is None and name != "weights"]
    if missing:
        raise InputRejected(f"{missing[0]} is missing", path=path, remedy="add it")
    return (_patch(_Patch(**single), path, lines, (), offset_mm),)


def _patch(
    table: _Patch, path: Path, lines: dict[tomlfile.KeyPath, int], place: tomlfile.KeyPath, offset_mm: float
) -> NominalPatch:
    rows = {len(row) for row in table.control_points}
    if len(rows) != 1:
        _reject("control_points has rows of different length", path, lines, (*place, "control_points"))
    net = np.array(table.control_points, dtype=np.float64)
    if table.weights is not None:
        weights = np.array(table.weights, dtype=np.float64) if _is_even(table.weights) else np.empty(0)
        if weights.shape != net.shape[:2] or not (weights > 0).all():
            _reject("weights must be positive, one for each control point", path, lines, (*place, "weights"))
        net = np.concatenate([net * weights[..., None], weights[..., None]], axis=-1)
    for name, degree, knots, count in (
        ("knots_u", table.degree[0], table.knots_u, net.shape[0]),
        ("knots_v", table.degree[1], table.knots_v, net.shape[1]),
    ):
        _check_knots(name, degree, knots, count, path, lines, place)
    both = (np.array(table.knots_u, dtype=np.float64), np.array(table.knots_v, dtype=np.float64))
    patch = NominalPatch(NdBSpline(both, net, table.degree), table.weights is not None, 1.0, offset_mm)
    return NominalPatch(patch.spline, patch.is_rational, _side(patch), offset_mm)


def _check_knots(
    name: str,
    degree: int,
    knots: list[float],
    count: int,
    path: Path,
    lines: dict[tomlfile.KeyPath, int],
    place: tomlfile.KeyPath,
) -> None:
    at = (*place, name)
    if degree < 1 or count <= degree:
        _reject(f"degree {degree} needs at least {degree + 1} control points, not {count}", path, lines, at)
    if len(knots) != count + degree + 1:
        _reject(f"{name} has {len(knots)} values where {count + degree + 1} are needed", path, lines, at)
    if any(b < a for a, b in itertools.pairwise(knots)) or knots[degree] >= knots[count]:
        _reject(f"{name} does not rise", path, lines, at)


def _reject(what: str, path: Path, lines: dict[tomlfile.KeyPath, int], at: tomlfile.KeyPath) -> None:
    raise InputRejected(what, path=path, line=lines.get(at), remedy="mend the surface file")


def _is_even(rows: list[list[float]]) -> bool:
    return len({len(row) for row in rows}) == 1


def _side(patch: NominalPatch) -> float:
    """+1 or -1, so that the mean normal of the patch points up, to the tool."""
    (u0, u1), (v0, v1) = patch.domain
    frames = patch.grid_frames(np.linspace(u0, u1, 9), np.linspace(v0, v1, 9))
    return 1.0 if np.cross(frames.along_u, frames.along_v)[:, 2].sum() >= 0 else -1.0
