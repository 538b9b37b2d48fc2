"""A plane spline as one cubic per knot span, in power form: what POLY and SPL blocks carry."""

from __future__ import annotations

import numpy as np

from planner.path.model import Array, DrivingPlane, PlaneSpline


def bezier_points(spline: PlaneSpline) -> Array:
    """Bezier points of every knot span that is not empty, shape (spans, degree + 1, 2), by blossoming.

    Point j of the span [a, b] is the blossom at (degree - j) times a and j times b, so neighbouring spans share their
    joint bit for bit as far as rounding of doubles goes.
    """
    degree, knots = spline.degree, spline.knots
    inner = np.arange(degree, len(spline.control_points))
    spans = inner[knots[inner + 1] > knots[inner]]
    ends = np.stack([knots[spans], knots[spans + 1]])
    return np.stack([_blossom(spline, spans, ends, number) for number in range(degree + 1)], axis=1)


def _blossom(spline: PlaneSpline, spans: np.ndarray, ends: Array, at_end: int) -> Array:
    degree, knots = spline.degree, spline.knots
    points = spline.control_points[spans[:, None] + np.arange(-degree, 1)]
    for level in range(1, degree + 1):
        argument = ends[1 if level <= at_end else 0][:, None]
        index = spans[:, None] + np.arange(level - degree, 1)
        low, high = knots[index], knots[index + degree + 1 - level]
        share = ((argument - low) / (high - low))[:, :, None]
        points = (1.0 - share) * points[:, :-1] + share * points[:, 1:]
    return np.asarray(points[:, 0])


def knot_lengths(spline: PlaneSpline) -> Array:
    """Lengths of the knot spans that are not empty, shape (spans,)."""
    lengths = np.diff(spline.knots[spline.degree : len(spline.control_points) + 1])
    return np.asarray(lengths[lengths > 0.0])


def power_form(bezier: Array) -> Array:
    """Cubic Bezier points (m, 4, d) as coefficients (m, 4, d) of p^0 .. p^3 on [0, 1]."""
    b0, b1, b2, b3 = (bezier[:, j] for j in range(4))
    return np.stack([b0, 3.0 * (b1 - b0), 3.0 * (b2 - 2.0 * b1 + b0), b3 - 3.0 * b2 + 3.0 * b1 - b0], axis=1)


def raised_to_cubic(bezier: Array) -> Array:
    """Bezier points of degree 1, 2 or 3, shape (m, degree + 1, d), as cubic ones (m, 4, d)."""
    while bezier.shape[1] < 4:
        degree = bezier.shape[1] - 1
        share = (np.arange(1, degree + 1) / (degree + 1.0))[None, :, None]
        middle = share * bezier[:, :-1] + (1.0 - share) * bezier[:, 1:]
        bezier = np.concatenate([bezier[:, :1], middle, bezier[:, -1:]], axis=1)
    return bezier


def in_work(plane: DrivingPlane, plane_points: Array, drop_z_mm: float) -> Array:
    """Plane points (..., 2) of (w, z) as work points (..., 3), lowered by `drop_z_mm`."""
    flat = plane.to_work(plane_points.reshape(-1, 2)) - np.array([0.0, 0.0, drop_z_mm])
    return np.asarray(flat.reshape(*plane_points.shape[:-1], 3))
