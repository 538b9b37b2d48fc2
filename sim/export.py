"""The deviation map for other programs: CSV of the probes, PLY mesh coloured by deviation."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planner.files import write_file
from sim.deviation import PatchMap, Verdict
from sim.errors import InputRejected

Floats = NDArray[np.float64]


def write_map(verdict: Verdict, path: Path) -> None:
    """The map as the file's ending says, .csv or .ply, whole or not at all; raises InputRejected."""
    makers = {".csv": _csv, ".ply": _ply}
    if path.suffix.lower() not in makers:
        raise InputRejected("the map is written as .csv or .ply", path=path, remedy="choose one of these endings")
    write_file(path, makers[path.suffix.lower()](verdict))


def _csv(verdict: Verdict) -> bytes:
    """One row a probe; deviation_mm is empty where the cutter did not come within reach."""
    text = io.StringIO()
    text.write("patch,u,v,x_mm,y_mm,z_mm,deviation_mm,is_accessible\n")
    for index, mapped in enumerate(verdict.maps):
        u, v = np.meshgrid(mapped.net.u, mapped.net.v, indexing="ij")
        columns = (u, v, *np.moveaxis(mapped.net.points, -1, 0), mapped.height_mm, mapped.is_accessible)
        for a, b, x, y, z, height, is_open in zip(*(each.ravel().tolist() for each in columns), strict=True):
            deviation = f"{height:.7f}" if np.isfinite(height) else ""
            text.write(f"{index},{a:.8f},{b:.8f},{x:.6f},{y:.6f},{z:.6f},{deviation},{int(is_open)}\n")
    return text.getvalue().encode("ascii")


def _ply(verdict: Verdict) -> bytes:
    """Binary PLY: vertices on the design with deviation_mm (nan where not reached) and colour, faces of four.

    Where the cutter cannot touch, is_accessible is 0 and the colour yellow.
    """
    vertices, faces, first = [], [], 0
    for mapped in verdict.maps:
        vertices.append(_vertices(mapped, verdict.scale_mm))
        n, m = mapped.height_mm.shape
        corner = first + (np.arange(n - 1)[:, None] * m + np.arange(m - 1)).ravel()
        rows = np.empty(len(corner), dtype=[("count", "u1"), ("corner", "<i4", 4)])
        rows["count"], rows["corner"] = 4, corner[:, None] + np.array([0, m, m + 1, 1])
        faces.append(rows)
        first += n * m
    points, quads = np.concatenate(vertices), np.concatenate(faces)
    head = (
        "ply\nformat binary_little_endian 1.0\ncomment deviation: + material left, - gouge, mm\n"
        f"element vertex {len(points)}\n"
        "property float x\nproperty float y\nproperty float z\nproperty float deviation_mm\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar is_accessible\n"
        f"element face {len(quads)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return head.encode("ascii") + points.tobytes() + quads.tobytes()


def _vertices(mapped: PatchMap, limit_mm: float) -> NDArray[np.void]:
    kind = [("place", "<f4", 3), ("deviation", "<f4"), ("colour", "u1", 3), ("is_accessible", "u1")]
    rows = np.empty(mapped.height_mm.size, dtype=kind)
    height = mapped.height_mm.ravel()
    share = np.clip(np.where(np.isfinite(height), height, 0.0) / limit_mm, -1.0, 1.0)[:, None]
    end = np.where(share < 0, [33.0, 102.0, 172.0], [178.0, 24.0, 43.0])
    colour = np.where(np.isfinite(height)[:, None], 247.0 + (end - 247.0) * np.abs(share), 150.0)
    rows["place"] = mapped.net.points.reshape(-1, 3)
    rows["deviation"] = np.where(np.isfinite(height), height, np.nan)
    is_open = mapped.is_accessible.ravel()
    rows["colour"] = np.where(is_open[:, None], np.round(colour), (250, 220, 70))
    rows["is_accessible"] = is_open
    return rows
