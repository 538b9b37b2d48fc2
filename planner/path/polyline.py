"""Straight moves for controls without splines: the fewest that stay within a tolerance of the curve."""

from __future__ import annotations

import numpy as np

from planner.path.curve import ExactCurve
from planner.path.model import Array, Polyline


def lean_polyline(curve: ExactCurve, tolerance_mm: float) -> tuple[Polyline, float]:
    """A polyline within the tolerance of the curve, and its largest distance from it, mm.

    The vertices are spaced by curvature so that every chord keeps the tolerance.
    """
    arc = curve.arc_mm
    density = np.sqrt(np.abs(curve.curvatures) / (8.0 * tolerance_mm))
    chords = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(arc))])
    count = max(int(np.ceil(chords[-1])), 1)
    while True:
        rising = chords + 1e-9 * np.arange(chords.size)
        places = np.interp(np.linspace(0.0, rising[-1], count + 1), rising, arc)
        points = curve.refine(places).points
        deviation_mm = _chord_error(curve, places, points)
        if deviation_mm <= tolerance_mm:
            return Polyline(points), deviation_mm
        count += max(1, count // 20)


def _chord_error(curve: ExactCurve, places: Array, points: Array) -> float:
    """The largest distance of the curve, at seven places a chord, from its chord."""
    shares = np.linspace(0.0, 1.0, 9)[1:-1]
    inner = places[:-1, None] + np.diff(places)[:, None] * shares
    middle = curve.refine(inner.ravel()).points.reshape(*inner.shape, 2)
    chord = np.diff(points, axis=0)
    chord /= np.hypot(chord[:, 0], chord[:, 1])[:, None]
    gap = middle - points[:-1, None]
    return float(np.abs(gap[..., 0] * chord[:, None, 1] - gap[..., 1] * chord[:, None, 0]).max())
