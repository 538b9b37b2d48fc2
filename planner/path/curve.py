"""What fitting and bounding need to know of an exact plane curve, and a dense copy of it to fit against.

Plane coordinates (w, z), mm. The curve is parametrised by its arc length; curvature is d(angle)/ds, 1/mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.path.model import Array


class Samples(Protocol):
    """Exact values at chosen arc lengths: points (k, 2), unit tangents (k, 2), signed curvatures (k,)."""

    @property
    def points(self) -> Array:
        """Points (k, 2), mm."""

    @property
    def tangents(self) -> Array:
        """Unit tangents (k, 2)."""

    @property
    def curvatures(self) -> Array:
        """Signed curvatures (k,), 1/mm, positive where the curve turns from w towards z."""


class ExactCurve(Samples, Protocol):
    """A curve known exactly at any arc length, with samples at increasing `arc_mm`, both ends included."""

    @property
    def arc_mm(self) -> Array:
        """Arc lengths (m,) of the samples, mm, increasing."""

    def refine(self, arc_mm: Array) -> Samples:
        """The exact curve at these arc lengths (k,)."""


@dataclass(frozen=True, slots=True)
class Nodes:
    """Values of several curves at the same relative arc lengths; the shape that is fitted in one batch.

    `points` and `tangents` (p, m, 2), `curvatures` (p, m), `arc_mm` (p, m) from 0; one row per curve.
    """

    arc_mm: Array
    points: Array
    tangents: Array
    curvatures: Array

    def take(self, rows: Array) -> Nodes:
        """These curves only; `rows` are indices or a mask."""
        return Nodes(self.arc_mm[rows], self.points[rows], self.tangents[rows], self.curvatures[rows])


def resample(curve: Samples, arc_mm: Array, wanted_mm: Array) -> tuple[Array, Array, Array]:
    """Points, tangents, curvatures at `wanted_mm` (k,) from samples at `arc_mm` (m,), by quintic Hermite.

    Agrees with position, tangent and curvature at both samples; for fitting only, a bound never rests on it.
    """
    at = np.clip(np.searchsorted(arc_mm, wanted_mm, side="right") - 1, 0, arc_mm.size - 2)
    h = arc_mm[at + 1] - arc_mm[at]
    x = ((wanted_mm - arc_mm[at]) / h)[:, None]
    normals = np.stack([-curve.tangents[:, 1], curve.tangents[:, 0]], axis=1)
    bend = curve.curvatures[:, None] * normals
    p0, p1 = curve.points[at], curve.points[at + 1]
    t0, t1 = curve.tangents[at] * h[:, None], curve.tangents[at + 1] * h[:, None]
    k0, k1 = bend[at] * (h**2)[:, None], bend[at + 1] * (h**2)[:, None]
    # The cubic, quartic and quintic coefficients close the jump that the Taylor part leaves at x = 1.
    gap, slope, turn = p1 - p0 - t0 - k0 / 2, t1 - t0 - k0, k1 - k0
    c3 = 10 * gap - 4 * slope + turn / 2
    c4 = -15 * gap + 7 * slope - turn
    c5 = 6 * gap - 3 * slope + turn / 2
    points = p0 + x * (t0 + x * (k0 / 2 + x * (c3 + x * (c4 + x * c5))))
    first = t0 + x * (k0 + x * (3 * c3 + x * (4 * c4 + x * 5 * c5)))
    second = k0 + x * (6 * c3 + x * (12 * c4 + x * 20 * c5))
    speed = np.hypot(first[:, 0], first[:, 1])
    tangents = first / speed[:, None]
    curvatures = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3
    return points, tangents, curvatures


def relative_nodes(curves: list[ExactCurve], count: int) -> Nodes:
    """The curves at `count` equally spaced relative arc lengths each, taken from their own samples."""
    places = np.linspace(0.0, 1.0, count)
    rows = []
    for curve in curves:
        arc = curve.arc_mm - curve.arc_mm[0]
        wanted = places * arc[-1]
        rows.append((wanted, *resample(curve, arc, wanted)))
    arcs, points, tangents, curvatures = (np.stack(parts) for parts in zip(*rows, strict=True))
    return Nodes(arcs, points, tangents, curvatures)
