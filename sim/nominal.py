"""The design as the verdict sees it: its own reading of job and surface files, evaluated with scipy's NdBSpline.

Nothing here comes from `planner.surface` or `planner.job`, on purpose: a swapped u and v or a bad loader must not hide
in plan and verdict at once. Lengths mm; u runs along the first index of the control points, v along the second.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, NdBSpline

from planner import tomlfile
from sim.errors import InputRejected

Floats = NDArray[np.float64]
Evaluate = Callable[[tuple[int, int]], Floats]


@dataclass(frozen=True, slots=True)
class Frames:
    """Points of a patch with their tangents: each array (n, 3), mm (derivatives: mm per unit of u or v)."""

    points: Floats
    along_u: Floats
    along_v: Floats
    normals: Floats
    areas: Floats

    def rows(self, at: NDArray[np.int64]) -> Frames:
        """The frames of some of the points."""
        return Frames(self.points[at], self.along_u[at], self.along_v[at], self.normals[at], self.areas[at])

    def parameters_of(self, steps: Floats) -> Floats:
        """Changes of (u, v), (n, 2), that come nearest to these steps in space, (n, 3), mm."""
        e, f, g = (np.einsum("ij,ij->i", a, b) for a, b in _pairs(self.along_u, self.along_v))
        a, b = (np.einsum("ij,ij->i", steps, along) for along in (self.along_u, self.along_v))
        determinant = e * g - f * f
        with np.errstate(divide="ignore", invalid="ignore"):
            changes = np.stack([(g * a - f * b) / determinant, (e * b - f * a) / determinant], axis=1)
        return np.where(np.isfinite(changes), changes, 0.0)


@dataclass(frozen=True, slots=True)
class NominalPatch:
    """One tensor-product patch, rational where it carries weights; `sign` turns its normals toward the tool (+Z).

    `spline` gives (x, y, z), or (w x, w y, w z, w) when `is_rational`; `offset_mm` is stock left on purpose.
    """

    spline: NdBSpline
    is_rational: bool
    sign: float
    offset_mm: float

    @property
    def domain(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The parameter rectangle ((u0, u1), (v0, v1))."""
        (u, v), (p, q) = self.spline.t, self.spline.k
        return (float(u[p]), float(u[-p - 1])), (float(v[q]), float(v[-q - 1]))

    def frames(self, uv: Floats) -> Frames:
        """Points, tangents, unit normals toward the tool and area elements |Su x Sv| at parameters (n, 2).

        Where a patch is singular (|Su x Sv| = 0) the normal is nan; the caller leaves such probes out.
        """
        uv = self.clipped(uv)
        return self._frames(lambda order: np.asarray(self.spline(uv, nu=order), dtype=np.float64))

    def points(self, uv: Floats) -> Floats:
        """Points (n, 3) at parameters (n, 2), without the stock to leave."""
        uv = self.clipped(uv)
        return self._derivative(lambda order: np.asarray(self.spline(uv, nu=order), dtype=np.float64), (0, 0))

    def grid_frames(self, u: Floats, v: Floats) -> Frames:
        """As `frames` at all pairs of u (n,) and v (m,), u outermost: arrays (n m, 3); many times as fast."""
        return self._frames(lambda order: self._tensor(u, v, order))

    def grid_concave_curvature(self, u: Floats, v: Floats) -> Floats:
        """As `concave_curvature` at all pairs of u (n,) and v (m,): (n m,)."""
        return self._concave_curvature(lambda order: self._tensor(u, v, order))

    def _tensor(self, u: Floats, v: Floats, order: tuple[int, int]) -> Floats:
        """The spline's values or derivatives on a grid, one basis for each direction."""
        bases = [
            np.asarray(BSpline(knots, np.eye(len(knots) - int(degree) - 1), int(degree))(at, nu=times))
            for knots, degree, at, times in zip(self.spline.t, self.spline.k, (u, v), order, strict=True)
        ]
        values = np.tensordot(bases[0], self.spline.c, axes=(1, 0))
        return np.moveaxis(np.tensordot(bases[1], values, axes=(1, 1)), 0, 1).reshape(len(u) * len(v), -1)

    def _frames(self, evaluate: Evaluate) -> Frames:
        points, along_u, along_v = (self._derivative(evaluate, order) for order in ((0, 0), (1, 0), (0, 1)))
        cross = self.sign * np.cross(along_u, along_v)
        areas = np.linalg.norm(cross, axis=-1)
        scale = np.linalg.norm(along_u, axis=-1) * np.linalg.norm(along_v, axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            normals = np.where((areas > 1e-12 * scale)[..., None], cross / areas[..., None], np.nan)
        return Frames(points + self.offset_mm * normals, along_u, along_v, normals, areas)

    def _derivative(self, evaluate: Evaluate, order: tuple[int, int]) -> Floats:
        """Partial derivative of the point, (n, 3), for orders up to two in total."""
        return _rational_derivative(evaluate, order) if self.is_rational else evaluate(order)

    def clipped(self, uv: Floats) -> Floats:
        """Parameters brought back into the domain."""
        (u0, u1), (v0, v1) = self.domain
        return np.clip(uv, (u0, v0), (u1, v1))

    def concave_curvature(self, uv: Floats) -> Floats:
        """Largest curvature toward the tool, (n,), 1/mm: above 1/R the ball of radius R cannot touch (> 0 concave)."""
        uv = self.clipped(uv)
        return self._concave_curvature(lambda order: np.asarray(self.spline(uv, nu=order), dtype=np.float64))

    def _concave_curvature(self, evaluate: Evaluate) -> Floats:
        first = self._frames(evaluate)
        fundamental = np.array([np.einsum("ij,ij->i", a, b) for a, b in _pairs(first.along_u, first.along_v)])
        second = np.array(
            [
                np.einsum("ij,ij->i", self._derivative(evaluate, order), first.normals)
                for order in ((2, 0), (1, 1), (0, 2))
            ]
        )
        (E, F, G), (L, M, N) = fundamental, second
        determinant = E * G - F * F
        mean = (E * N - 2 * F * M + G * L) / (2 * determinant)
        gauss = (L * N - M * M) / determinant
        return np.asarray(mean + np.sqrt(np.maximum(mean * mean - gauss, 0.0)))


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


def _pairs(a: Floats, b: Floats) -> tuple[tuple[Floats, Floats], ...]:
    return (a, a), (a, b), (b, b)


def _rational_derivative(evaluate: Evaluate, order: tuple[int, int]) -> Floats:
    """Quotient rule on the homogeneous spline: S = A / w, S' = (A' - w' S) / w and so on up to total order two."""
    homogeneous = evaluate((0, 0))
    point, weight = homogeneous[..., :3] / homogeneous[..., 3:], homogeneous[..., 3:]
    if order == (0, 0):
        return point
    change = evaluate(order)
    if sum(order) == 1:
        return np.asarray((change[..., :3] - change[..., 3:] * point) / weight)
    first, second = {(1, 1): ((1, 0), (0, 1)), (2, 0): ((1, 0),) * 2, (0, 2): ((0, 1),) * 2}[order]
    weight_a, weight_b = (evaluate(each)[..., 3:] for each in (first, second))
    slope_a, slope_b = (_rational_derivative(evaluate, each) for each in (first, second))
    bent = change[..., :3] - weight_a * slope_b - weight_b * slope_a - change[..., 3:] * point
    return np.asarray(bent / weight)
