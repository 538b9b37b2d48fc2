"""Arcs in the pass's plane for controls without splines: each within a tolerance of the curve."""

from __future__ import annotations

import numpy as np

from planner.path.curve import ExactCurve
from planner.path.model import ArcChain, Array


def arc_chain(curve: ExactCurve, tolerance_mm: float) -> tuple[ArcChain, float]:
    """Arcs through points of the curve within the tolerance, and their largest distance from it, mm."""
    length = curve.arc_mm[-1] - curve.arc_mm[0]
    count = 1
    while True:
        places = curve.arc_mm[0] + length * np.linspace(0.0, 1.0, 16 * count + 1)
        points = curve.refine(places).points
        chain, deviation_mm = _through(points.reshape(-1, 2), count)
        if deviation_mm <= tolerance_mm:
            return chain, deviation_mm
        count += max(1, count // 10)


def _through(points: Array, count: int) -> tuple[ArcChain, float]:
    """Arcs through every 16th point and the one half-way, and the largest distance of the others."""
    start, middle, end = points[:-1:16], points[8::16], points[16::16]
    a, b = middle - start, end - start
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    is_line = np.abs(cross) < 1e-9 * (b**2).sum(axis=1)
    safe = np.where(is_line, 1.0, 2.0 * cross)[:, None]
    a2, b2 = (a**2).sum(axis=1)[:, None], (b**2).sum(axis=1)[:, None]
    centres = start + (a2 * np.stack([b[:, 1], -b[:, 0]], axis=1) - b2 * np.stack([a[:, 1], -a[:, 0]], axis=1)) / safe
    radius = np.hypot(*(start - centres).T)
    places = points[:-1].reshape(count, 16, 2)
    round_error = np.hypot(places[..., 0] - centres[:, None, 0], places[..., 1] - centres[:, None, 1]) - radius[:, None]
    unit = b / np.sqrt(b2)
    gap = places - start[:, None]
    flat_error = gap[..., 0] * unit[:, None, 1] - gap[..., 1] * unit[:, None, 0]
    error = np.where(is_line[:, None], flat_error, round_error)
    turns = np.where(is_line, 0, np.where(cross > 0, 1, -1)).astype(np.int8)
    return ArcChain(points[::16].copy(), np.where(is_line[:, None], 0.0, centres), turns), float(np.abs(error).max())
