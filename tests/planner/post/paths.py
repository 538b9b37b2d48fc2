"""Tool paths made by hand, for the tests of this folder."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
from scipy.spatial import cKDTree

from planner.job import Job, load_job
from planner.path.model import ArcChain, DrivingPlane, Method, Pass, PlaneSpline, Polyline, ToolPath

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


def arcs(seed: int, count: int = 6, length_mm: float = 50.0) -> ArcChain:
    """Arcs through points of a wave, one of them a straight line, so that joints have small corners."""
    random = np.random.default_rng(seed)
    phase, height = random.uniform(0, 6), random.uniform(0.5, 4.0)
    w = np.linspace(0.0, length_mm, 2 * count + 1)
    at = np.stack([w, 8.0 + height * np.sin(w / 9.0 + phase)], axis=1)
    a, b, c = at[:-1:2], at[1::2], at[2::2]
    u, v = b - a, c - a
    cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    u2, v2 = (u**2).sum(1)[:, None], (v**2).sum(1)[:, None]
    arm = u2 * np.stack([v[:, 1], -v[:, 0]], 1) - v2 * np.stack([u[:, 1], -u[:, 0]], 1)
    turns = np.where(cross > 0, 1, -1).astype(np.int8)
    turns[count // 2] = 0
    return ArcChain(at[::2].copy(), a + arm / (2 * cross)[:, None], turns)


def tool_path(
    shapes: list[PlaneSpline | Polyline | ArcChain], *, angle_rad: float = 0.0, deviation_mm: float = 0.0009
) -> ToolPath:
    passes = tuple(
        Pass(DrivingPlane(angle_rad, 1.7418 + 1.5 * number), shape, deviation_mm, Method.PROVED, np.empty((0, 2)), 50.0)
        for number, shape in enumerate(shapes)
    )
    gaps = np.full(max(len(passes) - 1, 0), 1.5)
    return ToolPath(passes, 4.0, gaps, np.full(len(gaps), 0.07), Method.PROVED)


def distance_mm(these: np.ndarray, those: np.ndarray) -> float:
    """Largest distance of these points from the chords through those, on both sides of the nearest point."""
    those = those[np.append(True, np.abs(np.diff(those, axis=0)).max(axis=1) > 1e-9)]
    at = cKDTree(those).query(these)[1]
    best = np.full(len(these), np.inf)
    for low in (np.maximum(at - 1, 0), np.minimum(at, len(those) - 2)):
        start, leg = those[low], those[low + 1] - those[low]
        square = np.maximum((leg**2).sum(axis=1), 1e-300)
        share = np.clip(((these - start) * leg).sum(axis=1) / square, 0.0, 1.0)[:, None]
        best = np.minimum(best, np.linalg.norm(these - start - share * leg, axis=1))
    return float(best.max())
