"""Plane splines as one polynomial per knot span: its Bezier points, its powers, the lengths of the spans."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import comb

import numpy as np

from planner.path.model import ArcChain, Array, DrivingPlane, PlaneSpline, Shape


def bezier_points(splines: Sequence[PlaneSpline]) -> Array:
    """Bezier points of every knot span that is not empty, of splines of one degree, (spans of all, degree + 1, 2).

    By blossoming: point j of the span [a, b] is the blossom at (degree - j) times a and j times b, so neighbouring
    spans share their joint bit for bit as far as rounding of doubles goes.
    """
    degree = splines[0].degree
    knots = np.concatenate([spline.knots for spline in splines])
    points = np.concatenate([spline.control_points for spline in splines])
    owner = np.repeat(np.arange(len(splines)), [len(spline.knots) for spline in splines])
    is_span = np.append((knots[1:] > knots[:-1]) & (owner[1:] == owner[:-1]), False)
    spans = np.flatnonzero(is_span)
    # A spline has degree + 1 knots more than points.
    first = spans - degree - (degree + 1) * owner[spans]
    ends = np.stack([knots[spans], knots[spans + 1]])
    window = knots[spans[:, None] + np.arange(1 - degree, degree + 1)]
    legs = points[first[:, None] + np.arange(degree + 1)]
    shares = _shares(window, ends)
    found = []
    for by_end in range(degree + 1):
        by_begin = legs
        for level in range(by_end, degree):
            by_begin = _between(by_begin, shares[level][0])
        found.append(by_begin[:, 0])
        legs = _between(legs, shares[by_end][1]) if by_end < degree else legs
    return np.stack(found, axis=1)


def _shares(window: Array, ends: Array) -> list[Array]:
    """Where the ends (2, m) of spans lie between the knots of each level, (2, m, degree - level, 1).

    `window` (m, 2 degree) are the knots around each span.
    """
    degree = window.shape[1] // 2
    shares = []
    for level in range(degree):
        low, high = window[:, level:degree], window[:, degree : 2 * degree - level]
        shares.append(((ends[:, :, None] - low) / (high - low))[..., None])
    return shares


def _between(points: Array, share: Array) -> Array:
    """From each point (m, n, 2) this share (m, n - 1, 1) of the way to the next."""
    return (1.0 - share) * points[:, :-1] + share * points[:, 1:]


def joints_of(spline: PlaneSpline) -> Array:
    """The parameters (spans + 1,) where the spans that are not empty begin and end."""
    knots = spline.knots[spline.degree : len(spline.control_points) + 1]
    return np.asarray(knots[np.append(True, np.diff(knots) > 0.0)])


def folds_mm(spline: PlaneSpline) -> Array:
    """How far each span (spans,) runs backwards along w, mm.

    0 where Bezier points that rise prove that a span does not; the others are read at 65 places.
    """
    bezier = bezier_points([spline])[:, :, :1]
    found = np.zeros(len(bezier))
    suspect = np.flatnonzero((np.diff(bezier[:, :, 0], axis=1) < 0.0).any(axis=1))
    if len(suspect):
        places = np.linspace(0.0, 1.0, 65)[:, None] ** np.arange(bezier.shape[1])
        w = np.einsum("pk,mk->mp", places, power_form(bezier[suspect])[:, :, 0])
        found[suspect] = np.maximum(-np.diff(w, axis=1), 0.0).sum(axis=1)
    return found


def points_along(shape: Shape, a_segment: int = 12) -> Array:
    """Points (n, 2) of (w, z) along a shape, mm: so many a span or arc, and its highest and lowest places."""
    if isinstance(shape, PlaneSpline):
        return np.concatenate([_along_span(power, a_segment) for power in power_form(bezier_points([shape]))])
    if isinstance(shape, ArcChain):
        return np.concatenate([_along_link(shape, link, a_segment) for link in range(len(shape.turns))])
    return shape.points


def _along_span(power: Array, count: int) -> Array:
    """Points of one polynomial (degree + 1, 2) on [0, 1], those with a level tangent among them."""
    degrees = np.arange(len(power))
    level = np.polynomial.polynomial.polyroots((degrees * power[:, 1].T)[1:])
    level = level.real[(np.abs(level.imag) < 1e-9) & (level.real > 0) & (level.real < 1)]
    places = np.sort(np.append(np.linspace(0.0, 1.0, count), level))
    return np.asarray(places[:, None] ** degrees @ power)


def _along_link(chain: ArcChain, link: int, count: int) -> Array:
    """Points of one arc or line, the arc's top and bottom among them."""
    ends, turn = chain.points[link : link + 2], int(chain.turns[link])
    if not turn:
        return ends
    spokes = ends - chain.centres[link]
    first, last = np.arctan2(spokes[:, 1], spokes[:, 0])
    sweep = (turn * (last - first)) % (2 * np.pi)
    level = (turn * (np.array([0.5, 1.5]) * np.pi - first)) % (2 * np.pi)
    angles = first + turn * np.sort(np.append(np.linspace(0.0, sweep, count), level[level < sweep]))
    around = np.hypot(*spokes[0]) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.asarray(chain.centres[link] + around)


def power_form(bezier: Array) -> Array:
    """Bezier points (m, n + 1, d) as coefficients (m, n + 1, d) of p^0 .. p^n on [0, 1]."""
    return np.asarray(np.einsum("kj,mjd->mkd", _powers_of_bezier(bezier.shape[1] - 1), bezier))


@cache
def _powers_of_bezier(degree: int) -> Array:
    """Matrix from Bezier points to power coefficients: binomial (n, k) times the kth forward difference."""
    order = range(degree + 1)
    return np.array(
        [[(-1.0) ** (k - j) * comb(degree, k) * comb(k, j) if j <= k else 0.0 for j in order] for k in order]
    )


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
