"""Brute-force distances, the second opinion on every bound."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planner.path.model import ArcChain

Array = NDArray[np.float64]


def farthest_mm(points: Array, polyline: Array) -> float:
    """The largest distance of points from a dense polyline."""
    start, chord = polyline[:-1], np.diff(polyline, axis=0)
    square = (chord**2).sum(axis=1)
    worst = 0.0
    for point in points:
        gap = point - start
        share = np.clip((gap * chord).sum(axis=1) / square, 0.0, 1.0)
        worst = max(worst, float(np.hypot(*(gap - share[:, None] * chord).T).min()))
    return worst


def walked(chain: ArcChain, steps: int = 400) -> Array:
    """Dense points along a chain of arcs; fails if an arc's ends are not equally far from its centre."""
    parts = [chain.points[:1]]
    shares = np.linspace(0.0, 1.0, steps + 1)[1:, None]
    for start, stop, centre, turn in zip(chain.points[:-1], chain.points[1:], chain.centres, chain.turns, strict=True):
        if turn == 0:
            parts.append(start + shares * (stop - start))
            continue
        a, b = start - centre, stop - centre
        radius = np.hypot(*a)
        np.testing.assert_allclose(np.hypot(*b), radius, rtol=1e-9)
        first = np.arctan2(a[1], a[0])
        swept = turn * np.mod(turn * (np.arctan2(b[1], b[0]) - first), 2 * np.pi)
        parts.append(
            centre + radius * np.concatenate([np.cos(first + shares * swept), np.sin(first + shares * swept)], 1)
        )
    return np.concatenate(parts)
