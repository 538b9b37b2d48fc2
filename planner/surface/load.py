"""Surface files: TOML tables of B-spline patches, checked before anybody evaluates them.

Format: docs/interface, section 2. Every complaint names the file, the line and, for shape, the patch and its (u, v).
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from planner import tomlfile
from planner.errors import InputRejected
from planner.surface.patch import NurbsPatch

Array = NDArray[np.float64]
Degree = Annotated[int, Meta(ge=1, le=9)]
MAX_COORDINATE_MM = 100_000.0  # no mill of this kind reaches further, and a slip of the unit does
MAX_WEIGHT_RATIO = 1e6  # of the heaviest to the lightest: beyond it doubles lose the lighter points
FEW_BRACKETS = 100  # around whole arrays and patches
MAX_CONTROL_POINTS = 250_000  # 16 coefficients of 3 doubles each: 100 MB


class PatchTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One patch as it stands in the file."""

    degree: tuple[Degree, Degree]
    knots_u: tuple[float, ...]
    knots_v: tuple[float, ...]
    control_points: tuple[tuple[tuple[float, float, float], ...], ...]
    weights: tuple[tuple[float, ...], ...] | None = None


class SurfaceFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A whole surface file: the keys of one patch at the top, or `[[patch]]` tables."""

    patch: tuple[PatchTable, ...] = ()
    degree: tuple[Degree, Degree] | None = None
    knots_u: tuple[float, ...] = ()
    knots_v: tuple[float, ...] = ()
    control_points: tuple[tuple[tuple[float, float, float], ...], ...] = ()
    weights: tuple[tuple[float, ...], ...] | None = None


def load_surface(path: Path) -> tuple[NurbsPatch, ...]:
    """The patches of a surface file; raises InputRejected with file, line and remedy for what cannot be a surface."""
    # A row holds two points or more and at most one row of weights, so half the brackets are points at least.
    if tomlfile.read_text(path).count("[") > 2 * MAX_CONTROL_POINTS + FEW_BRACKETS:
        what = f"has more than {MAX_CONTROL_POINTS} control points"
        raise InputRejected(what, path=path, remedy="split the surface into files")
    found, lines = tomlfile.load(path, SurfaceFile)
    if found.patch and found.degree is not None:
        raise InputRejected("has both [[patch]] tables and a patch at the top", path=path, remedy="keep one of them")
    if found.patch:
        return tuple(
            _patch(table, ("patch", index), f"patch {index + 1}", path, lines)
            for index, table in enumerate(found.patch)
        )
    if found.degree is None:
        raise InputRejected("degree is missing", path=path, line=1, remedy="add degree, knots and control_points")
    table = PatchTable(found.degree, found.knots_u, found.knots_v, found.control_points, found.weights)
    return (_patch(table, (), "patch 1", path, lines),)


def _patch(
    table: PatchTable, at: tomlfile.KeyPath, name: str, path: Path, lines: dict[tomlfile.KeyPath, int]
) -> NurbsPatch:
    def reject(key: str, what: str, remedy: str) -> InputRejected:
        return InputRejected(f"{name}: {what}", path=path, line=lines.get((*at, key)), remedy=remedy)

    rows = table.control_points
    widths = {len(row) for row in rows}
    if len(widths) != 1:
        uneven = next((i for i, row in enumerate(rows) if len(row) != len(rows[0])), 0)
        line = lines.get((*at, "control_points", uneven))
        what = f"{name}: control_points is not a full grid"
        raise InputRejected(what, path=path, line=line, remedy="give every row the same number of points")
    for i, row in enumerate(rows):
        if any(abs(value) > MAX_COORDINATE_MM for point in row for value in point):
            line = lines.get((*at, "control_points", i))
            what = f"{name}: a coordinate is beyond {MAX_COORDINATE_MM:g} mm"
            raise InputRejected(what, path=path, line=line, remedy="give millimetres")
    shape = (len(rows), len(rows[0]))
    if shape[0] * shape[1] > MAX_CONTROL_POINTS:
        what = f"{shape[0]} x {shape[1]} control points are more than {MAX_CONTROL_POINTS}"
        raise reject("control_points", what, "split the surface into patches")
    for direction, knots, degree, count in (
        ("knots_u", table.knots_u, table.degree[0], shape[0]),
        ("knots_v", table.knots_v, table.degree[1], shape[1]),
    ):
        problem = _knot_problem(np.array(knots), degree, count)
        if problem:
            raise reject(direction, f"{direction} {problem[0]}", problem[1])
    weights = None if table.weights is None else _weights(table.weights, shape, reject)
    points = np.array(rows, dtype=np.float64)
    degree_u, degree_v = table.degree
    return NurbsPatch(degree_u, degree_v, np.array(table.knots_u), np.array(table.knots_v), points, weights, name)


def _knot_problem(knots: Array, degree: int, count: int) -> tuple[str, str] | None:
    """What is wrong with a knot vector and the remedy, or None."""
    wanted = count + degree + 1
    if len(knots) != wanted:
        return f"has {len(knots)} knots", f"{count} control points of degree {degree} need {wanted}"
    if np.any(np.diff(knots) < 0):
        place = int(np.flatnonzero(np.diff(knots) < 0)[0]) + 1
        return f"falls at its element {place + 1}", "sort the knots"
    if not knots[count] > knots[degree]:
        return "has no span of positive width", "spread the knots"
    inner = knots[(knots > knots[degree]) & (knots < knots[count])]
    values, repeats = np.unique(inner, return_counts=True)
    if np.any(repeats > degree):
        return (
            f"repeats {values[repeats > degree][0]:g} more than degree times",
            "remove knots or split the patch there",
        )
    return None


def _weights(rows: tuple[tuple[float, ...], ...], shape: tuple[int, int], reject: object) -> Array:
    assert callable(reject)
    if len(rows) != shape[0] or any(len(row) != shape[1] for row in rows):
        raise reject("weights", "weights is not of the shape of control_points", "give one weight a control point")
    weights = np.array(rows, dtype=np.float64)
    if np.any(weights <= 0):
        i, j = np.argwhere(weights <= 0)[0]
        raise reject("weights", f"weights[{i}][{j}] is not above 0", "give positive weights")
    if weights.max() > MAX_WEIGHT_RATIO * weights.min():
        i, j = np.argwhere(weights == weights.max())[0]
        what = f"weights[{i}][{j}] is more than {MAX_WEIGHT_RATIO:g} times the lightest"
        raise reject("weights", what, "give weights of the same order")
    return weights
