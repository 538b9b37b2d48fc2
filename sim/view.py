"""One self-contained page of a verdict: deviation in plan, the tool's way, the program line under the cursor."""

from __future__ import annotations

import base64
import importlib.resources
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.files import write_file
from sim.deviation import PatchMap, Verdict
from sim.interpreter.canon import Motion
from sim.sweep import sweep_of

Floats = NDArray[np.float64]


def page_of(verdict: Verdict, motions: Sequence[Motion], program: bytes, title: str, *, nodes: int, pieces: int) -> str:
    """The page as HTML; it needs no network and holds at most about `nodes` probes and `pieces` strokes of the way."""
    stride = max(1, round((sum(each.height_mm.size for each in verdict.maps) / nodes) ** 0.5))
    points = np.concatenate([each.net.points[..., :2].reshape(-1, 2) for each in verdict.maps])
    data = {
        "title": title,
        "pitch_mm": verdict.probe_pitch_mm * stride,
        "limit_um": 1000 * verdict.scale_mm,
        "box_mm": [*np.nanmin(points, axis=0).tolist(), *np.nanmax(points, axis=0).tolist()],
        "nets": [_net(each, motions, stride) for each in verdict.maps],
        "way": _way(motions, pieces),
        "program": program.decode("latin-1").splitlines(),
    }
    template = importlib.resources.files("sim").joinpath("view_page.html").read_text()
    return template.replace("DATA", json.dumps(data).replace("<", "\\u003c"), 1)


def write_page(page: str, path: Path) -> None:
    """The page in a file, whole or not at all; raises InputRejected if it cannot be written."""
    write_file(path, page.encode())


def _net(mapped: PatchMap, motions: Sequence[Motion], stride: int) -> dict[str, Any]:
    lines = np.array([motion.line for motion in motions] + [0], dtype=np.int32)
    points, owner = mapped.net.points[::stride, ::stride], mapped.motion[::stride, ::stride]
    return {
        "rows": points.shape[0],
        "columns": points.shape[1],
        "x": _packed(points[..., 0], "<f4"),
        "y": _packed(points[..., 1], "<f4"),
        "deviation_um": _packed(1000 * mapped.height_mm[::stride, ::stride], "<f4"),
        "line": _packed(lines[owner], "<i4"),
        "is_accessible": _packed(mapped.is_accessible[::stride, ::stride], "u1"),
    }


def _way(motions: Sequence[Motion], pieces: int) -> dict[str, str]:
    """The way in plan as strokes (x0, y0, x1, y1) with the line of each; coarser where there are too many."""
    length_mm = 1.0
    sweep = sweep_of(motions, 0.0, sag_mm=0.05, length_mm=length_mm, fit_mm=0.01)
    while len(sweep.motion) > pieces and length_mm < 100.0:
        length_mm *= 2
        sweep = sweep_of(motions, 0.0, sag_mm=0.05 * length_mm, length_mm=length_mm, fit_mm=0.01)
    strokes = np.concatenate([sweep.coefficients[:, 0, :2], sweep.ends[:, :2]], axis=1)
    lines = np.array([motions[k].line for k in sweep.motion], dtype=np.int32)
    return {"xy": _packed(strokes, "<f4"), "line": _packed(lines, "<i4")}


def _packed(values: NDArray[Any], kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
