"""Measured points against the design: deviation, the set-up offset in it, and what is left when that is taken off.

A coordinate machine's points share the error of their zero point and of the tool's length, one shift along Z. Form is
what remains when that shift, the mean deviation along Z, is removed.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.tomlfile import read_text
from sim.errors import InputRejected
from sim.grid import net_of
from sim.nominal import Nominal
from sim.nominal_patch import NominalPatch

Floats = NDArray[np.float64]
_LARGEST_MM = 100_000.0
"""As for the control points of a surface."""


@dataclass(frozen=True, slots=True)
class MeasuredPoints:
    """Points of a table: x, z measured (n,), mm; y and the table's own design z where it has them, else nan; groups."""

    x_mm: Floats
    y_mm: Floats
    z_mm: Floats
    z_design_mm: Floats
    group: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Deviation of each point along Z (n,), mm, + above the design.

    `mismatch_mm` (n,) is how far the place a table names is from the design: large if it is not this surface.
    """

    points: MeasuredPoints
    along_z_mm: Floats
    mismatch_mm: Floats

    @property
    def offset_mm(self) -> float:
        """Mean deviation along Z: the set-up offset."""
        return float(self.along_z_mm.mean())

    @property
    def residual_mm(self) -> float:
        """Standard deviation (n - 1) along Z: what the offset does not explain."""
        return float(self.along_z_mm.std(ddof=1)) if len(self.along_z_mm) > 1 else 0.0

    def report(self) -> dict[str, Any]:
        """The report of `dnc measure`; lengths mm."""
        left = self.along_z_mm - self.offset_mm
        return {
            "schema": "dripmill.measure",
            "version": 1,
            "points": len(left),
            "offset_mm": self.offset_mm,
            "residual_mm": self.residual_mm,
            "residual_range_mm": [float(left.min()), float(left.max())],
            "deviation_mm": {
                "max": float(self.along_z_mm.max()),
                "min": float(self.along_z_mm.min()),
                "mean": self.offset_mm,
            },
            "design_mismatch_mm": float(self.mismatch_mm.max()),
            "groups": [self._group(name, left) for name in dict.fromkeys(self.points.group)],
        }

    def _group(self, name: str, left: Floats) -> dict[str, Any]:
        at = np.array([each == name for each in self.points.group])
        return {"name": name, "points": int(at.sum()), "residual_mean_mm": float(left[at].mean())}


def load_points(path: Path) -> MeasuredPoints:
    """A CSV table with columns x_mm and z_mm (or z_measured_mm), and y_mm or z_design_mm; raises InputRejected."""
    reader = csv.reader(read_text(path, remedy="name a table of points").splitlines())
    try:
        rows = list(reader)
    except csv.Error as problem:
        line = reader.line_num
        raise InputRejected(f"is no table: {problem}", path=path, line=line, remedy="mend this line") from None
    names = [name.strip() for name in rows[0]]
    measured = "z_measured_mm" if "z_measured_mm" in names else "z_mm"
    for needed in ("x_mm", measured):
        if needed not in names:
            raise InputRejected(f"has no column {needed}", path=path, line=1, remedy="name the columns in line 1")
    if "y_mm" not in names and "z_design_mm" not in names:
        raise InputRejected("has neither y_mm nor z_design_mm", path=path, line=1, remedy="say where the points lie")
    table: dict[str, list[float]] = {name: [] for name in ("x_mm", "y_mm", measured, "z_design_mm")}
    groups: list[str] = []
    for line, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        if len(row) != len(names):
            raise InputRejected(
                f"has {len(row)} columns where {len(names)} are named", path=path, line=line, remedy="complete it"
            )
        values = dict(zip(names, row, strict=True))
        for name, column in table.items():
            column.append(_number(values.get(name), name, path, line))
        groups.append(values.get("tool_path", ""))
    if not groups:
        raise InputRejected("has no points", path=path, remedy="give a row for each point")
    x, y, z, design = (np.array(column) for column in table.values())
    return MeasuredPoints(x, y, z, design, tuple(groups))


def _number(text: str | None, name: str, path: Path, line: int) -> float:
    if text is None:
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= _LARGEST_MM:
        raise InputRejected(f"{name} is {text!r}", path=path, line=line, remedy="give a number in mm")
    return value


def compared(points: MeasuredPoints, nominal: Nominal) -> Comparison:
    """Every point against the design point above or below it.

    Where y is unknown the table's design z finds the place: the point of the design with this x and z. Raises
    InputRejected if a point lies more than 1 mm beside every patch.
    """
    has_no_y = bool(np.isnan(points.y_mm).any())
    axes = (0, 2) if has_no_y else (0, 1)
    wanted = np.stack([points.x_mm, points.z_design_mm if has_no_y else points.y_mm], axis=1)
    mismatch, height = np.full(len(wanted), np.inf), np.zeros(len(wanted))
    for patch in nominal.patches:
        places = patch.frames(_located(patch, wanted, axes)).points
        gap = np.linalg.norm(places[:, axes] - wanted, axis=1)
        height = np.where(gap < mismatch, places[:, 2], height)
        mismatch = np.minimum(gap, mismatch)
    far = np.flatnonzero(mismatch > 1.0)
    if len(far):
        raise InputRejected(
            f"point {far[0] + 1} lies more than 1 mm beside the design",
            remedy="check job, frame and columns",
        )
    return Comparison(points, points.z_mm - (points.z_design_mm if has_no_y else height), mismatch)


def _located(patch: NominalPatch, wanted: Floats, axes: Sequence[int]) -> Floats:
    """Parameters (n, 2) of the design points whose two coordinates come nearest to those wanted, by Gauss-Newton."""
    net = net_of(patch, _size(patch) / 200)
    nodes = np.stack(np.meshgrid(net.u, net.v, indexing="ij"), axis=-1).reshape(-1, 2)
    shadows = net.points.reshape(-1, 3)[:, axes]
    uv = np.array([nodes[np.linalg.norm(shadows - each, axis=1).argmin()] for each in wanted])
    for _ in range(30):
        frames = patch.frames(uv)
        jacobian = np.stack([frames.along_u[:, axes], frames.along_v[:, axes]], axis=2)
        step = np.linalg.pinv(jacobian) @ (wanted - frames.points[:, axes])[..., None]
        uv = patch.clipped(uv + np.clip(step[..., 0], -0.05, 0.05))
    return uv


def _size(patch: NominalPatch) -> float:
    net = net_of(patch, math.inf)
    return float(np.ptp(net.points.reshape(-1, 3), axis=0).max())
