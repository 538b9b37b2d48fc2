"""Tool paths made by hand, for the tests of this folder."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np

from planner.job import Job, load_job
from planner.path.model import DrivingPlane, Method, Pass, PlaneSpline, Polyline, ToolPath

THESIS = Path(__file__).parents[3] / "configs/jobs/thesis.toml"


def job(**post: object) -> Job:
    loaded = load_job(THESIS)
    return msgspec.structs.replace(loaded, post=msgspec.structs.replace(loaded.post, **post))


def spline(seed: int, *, inner: int = 1, length_mm: float = 50.0) -> PlaneSpline:
    """A clamped cubic across `length_mm`, a few mm high, knots uneven and scaled to mm."""
    random = np.random.default_rng(seed)
    breaks = np.sort(random.uniform(0.15, 0.85, inner)) * length_mm
    knots = np.concatenate([np.zeros(4), breaks, np.full(4, length_mm)])
    w = np.linspace(0.0, length_mm, inner + 4) + np.concatenate([[0], random.uniform(-2, 2, inner + 2), [0]])
    return PlaneSpline(3, knots, np.stack([w, random.uniform(5.0, 8.0, inner + 4)], axis=1))


def polyline(seed: int, vertices: int = 12) -> Polyline:
    random = np.random.default_rng(seed)
    return Polyline(np.stack([np.linspace(0.0, 50.0, vertices), random.uniform(5.0, 8.0, vertices)], axis=1))


def tool_path(
    shapes: list[PlaneSpline | Polyline], *, angle_rad: float = 0.0, deviation_mm: float = 0.0009
) -> ToolPath:
    passes = tuple(
        Pass(DrivingPlane(angle_rad, 1.7418 + 1.5 * number), shape, deviation_mm, Method.PROVED, np.empty((0, 2)), 50.0)
        for number, shape in enumerate(shapes)
    )
    gaps = np.full(max(len(passes) - 1, 0), 1.5)
    return ToolPath(passes, 4.0, gaps, np.full(len(gaps), 0.07), Method.PROVED)
