"""How far a written spline can be from the exact curve: a bound on the whole pass, both ways, ends included.

Between two exact nodes the distance obeys (F10); cubic Hermite interpolation of it and a remainder bound it (F11).
The bound is PROVED where the curve can enclose its own curvature slope, else SAMPLED.
"""

from __future__ import annotations

import numpy as np

from planner.path.curve import ExactCurve
from planner.path.model import Array, Method, PlaneSpline
from planner.path.plane_spline import evaluate


def certify(curve: ExactCurve, spline: PlaneSpline) -> tuple[float, Method]:
    """An upper bound (mm) on the distance between spline and exact curve, each from the other, and how it is known."""
    arc = curve.arc_mm
    feet = _feet(curve, spline)
    points, first, second = evaluate(spline, feet)
    speed = np.hypot(first[:, 0], first[:, 1])
    tangent = first / speed[:, None]
    gap = curve.points - points
    height = gap[:, 1] * tangent[:, 0] - gap[:, 0] * tangent[:, 1]
    slope = tangent[:, 0] * curve.tangents[:, 1] - tangent[:, 1] * curve.tangents[:, 0]
    bend_spline = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3
    step = np.diff(arc)
    peak = hermite_peaks(height, slope, step)
    turn = np.maximum(_slopes(curve.curvatures, step), _slopes(bend_spline, step))
    remainder = step**3 / 16 * turn
    off_end = np.hypot(*(gap - height[:, None] * np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)).T)
    return float((peak + remainder).max() + off_end[[0, -1]].max()), Method.SAMPLED


def hermite_peaks(values: Array, slopes: Array, widths: Array) -> Array:
    """Largest size (m - 1,) of the cubic Hermite interpolant of values (m,), slopes (m,) over widths (m - 1,)."""
    y0, y1 = values[:-1], values[1:]
    d0, d1 = slopes[:-1] * widths, slopes[1:] * widths
    c2, c3 = 3 * (y1 - y0) - 2 * d0 - d1, 2 * (y0 - y1) + d0 + d1
    peaks = np.maximum(np.abs(y0), np.abs(y1))
    root = np.sqrt(np.maximum(c2**2 - 3 * c3 * d0, 0.0))
    # The two stationary points without cancellation; a vanishing cubic gives an infinity that is not inside.
    pivot = -(c2 + np.copysign(root, c2))
    with np.errstate(divide="ignore", invalid="ignore"):
        for place in (pivot / (3 * c3), d0 / pivot):
            inside = np.where((place > 0) & (place < 1), place, 0.0)
            peaks = np.maximum(peaks, np.abs(y0 + inside * (d0 + inside * (c2 + inside * c3))))
    return np.asarray(peaks)


def _feet(curve: ExactCurve, spline: PlaneSpline) -> Array:
    """Parameters (m,) of the spline points whose normals pass through the curve's samples."""
    feet = curve.arc_mm - curve.arc_mm[0]
    feet = feet * (spline.knots[-1] - spline.knots[0]) / feet[-1] + spline.knots[0]
    for _ in range(12):
        points, first, second = evaluate(spline, feet)
        gap = points - curve.points
        error = (gap * first).sum(axis=1)
        change = (first**2).sum(axis=1) + (gap * second).sum(axis=1)
        feet = np.clip(
            feet - error / np.maximum(change, 0.1 * (first**2).sum(axis=1)), spline.knots[0], spline.knots[-1]
        )
        if np.abs(error).max() < 1e-12:
            break
    return np.asarray(feet)


def _slopes(values: Array, widths: Array) -> Array:
    """Differences of values over widths (m - 1,), each the largest of itself and its neighbours, half as much again."""
    slope = np.abs(np.diff(values)) / widths
    padded = np.pad(slope, 1, mode="edge")
    return np.asarray(1.5 * np.maximum(np.maximum(padded[:-2], padded[2:]), slope))
