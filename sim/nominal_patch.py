"""A patch of the design as the verdict sees it: points, tangents, normals and curvature, by scipy's NdBSpline.

Lengths mm; u runs along the first index of the control points, v along the second.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, NdBSpline

Floats = NDArray[np.float64]
Evaluate = Callable[[tuple[int, int]], Floats]


@dataclass(frozen=True, slots=True)
class Frames:
    """Points of a patch with their tangents: each array (n, 3), mm (derivatives: mm per unit of u or v)."""

    points: Floats
    along_u: Floats
    along_v: Floats
    normals: Floats
    areas: Floats

    def rows(self, at: NDArray[np.int64]) -> Frames:
        """The frames of some of the points."""
        return Frames(self.points[at], self.along_u[at], self.along_v[at], self.normals[at], self.areas[at])

    def parameters_of(self, steps: Floats) -> Floats:
        """Changes of (u, v), (n, 2), that come nearest to these steps in space, (n, 3), mm."""
        e, f, g = (np.einsum("ij,ij->i", a, b) for a, b in _pairs(self.along_u, self.along_v))
        a, b = (np.einsum("ij,ij->i", steps, along) for along in (self.along_u, self.along_v))
        determinant = e * g - f * f
        with np.errstate(divide="ignore", invalid="ignore"):
            changes = np.stack([(g * a - f * b) / determinant, (e * b - f * a) / determinant], axis=1)
        return np.where(np.isfinite(changes), changes, 0.0)


@dataclass(frozen=True, slots=True)
class NominalPatch:
    """One tensor-product patch, rational where it carries weights; `sign` turns its normals toward the tool (+Z).

    `spline` gives (x, y, z), or (w x, w y, w z, w) when `is_rational`; `offset_mm` is stock left on purpose.
    """

    spline: NdBSpline
    is_rational: bool
    sign: float
    offset_mm: float

    @property
    def domain(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The parameter rectangle ((u0, u1), (v0, v1))."""
        (u, v), (p, q) = self.spline.t, self.spline.k
        return (float(u[p]), float(u[-p - 1])), (float(v[q]), float(v[-q - 1]))

    def frames(self, uv: Floats) -> Frames:
        """Points, tangents, unit normals toward the tool and area elements |Su x Sv| at parameters (n, 2).

        Where a patch is singular (|Su x Sv| = 0) the normal is nan; the caller leaves such probes out.
        """
        uv = self.clipped(uv)
        return self._frames(lambda order: np.asarray(self.spline(uv, nu=order), dtype=np.float64))

    def points(self, uv: Floats) -> Floats:
        """Points (n, 3) at parameters (n, 2), without the stock to leave."""
        uv = self.clipped(uv)
        return self._derivative(lambda order: np.asarray(self.spline(uv, nu=order), dtype=np.float64), (0, 0))

    def grid_frames(self, u: Floats, v: Floats) -> Frames:
        """As `frames` at all pairs of u (n,) and v (m,), u outermost: arrays (n m, 3); many times as fast."""
        return self._frames(lambda order: self._tensor(u, v, order))

    def grid_concave_curvature(self, u: Floats, v: Floats) -> Floats:
        """As `concave_curvature` at all pairs of u (n,) and v (m,): (n m,)."""
        return self._concave_curvature(lambda order: self._tensor(u, v, order))

    def _tensor(self, u: Floats, v: Floats, order: tuple[int, int]) -> Floats:
        """The spline's values or derivatives on a grid, one basis for each direction."""
        bases = [
            np.asarray(BSpline(knots, np.eye(len(knots) - int(degree) - 1), int(degree))(at, nu=times))
            for knots, degree, at, times in zip(self.spline.t, self.spline.k, (u, v), order, strict=True)
        ]
        values = np.tensordot(bases[0], self.spline.c, axes=(1, 0))
        return np.moveaxis(np.tensordot(bases[1], values, axes=(1, 1)), 0, 1).reshape(len(u) * len(v), -1)

    def _frames(self, evaluate: Evaluate) -> Frames:
        points, along_u, along_v = (self._derivative(evaluate, order) for order in ((0, 0), (1, 0), (0, 1)))
        cross = self.sign * np.cross(along_u, along_v)
        areas = np.linalg.norm(cross, axis=-1)
        scale = np.linalg.norm(along_u, axis=-1) * np.linalg.norm(along_v, axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            normals = np.where((areas > 1e-12 * scale)[..., None], cross / areas[..., None], np.nan)
        return Frames(points + self.offset_mm * normals, along_u, along_v, normals, areas)

    def _derivative(self, evaluate: Evaluate, order: tuple[int, int]) -> Floats:
        """Partial derivative of the point, (n, 3), for orders up to two in total."""
        return _rational_derivative(evaluate, order) if self.is_rational else evaluate(order)

    def clipped(self, uv: Floats) -> Floats:
        """Parameters brought back into the domain."""
        (u0, u1), (v0, v1) = self.domain
        return np.clip(uv, (u0, v0), (u1, v1))

    def concave_curvature(self, uv: Floats) -> Floats:
        """Largest curvature toward the tool, (n,), 1/mm: above 1/R the ball of radius R cannot touch (> 0 concave)."""
        uv = self.clipped(uv)
        return self._concave_curvature(lambda order: np.asarray(self.spline(uv, nu=order), dtype=np.float64))

    def _concave_curvature(self, evaluate: Evaluate) -> Floats:
        first = self._frames(evaluate)
        fundamental = np.array([np.einsum("ij,ij->i", a, b) for a, b in _pairs(first.along_u, first.along_v)])
        second = np.array(
            [
                np.einsum("ij,ij->i", self._derivative(evaluate, order), first.normals)
                for order in ((2, 0), (1, 1), (0, 2))
            ]
        )
        (E, F, G), (L, M, N) = fundamental, second
        determinant = E * G - F * F
        mean = (E * N - 2 * F * M + G * L) / (2 * determinant)
        gauss = (L * N - M * M) / determinant
        return np.asarray(mean + np.sqrt(np.maximum(mean * mean - gauss, 0.0)))


def _pairs(a: Floats, b: Floats) -> tuple[tuple[Floats, Floats], ...]:
    return (a, a), (a, b), (b, b)


def _rational_derivative(evaluate: Evaluate, order: tuple[int, int]) -> Floats:
    """Quotient rule on the homogeneous spline: S = A / w, S' = (A' - w' S) / w and so on up to total order two."""
    homogeneous = evaluate((0, 0))
    point, weight = homogeneous[..., :3] / homogeneous[..., 3:], homogeneous[..., 3:]
    if order == (0, 0):
        return point
    change = evaluate(order)
    if sum(order) == 1:
        return np.asarray((change[..., :3] - change[..., 3:] * point) / weight)
    first, second = {(1, 1): ((1, 0), (0, 1)), (2, 0): ((1, 0),) * 2, (0, 2): ((0, 1),) * 2}[order]
    weight_a, weight_b = (evaluate(each)[..., 3:] for each in (first, second))
    slope_a, slope_b = (_rational_derivative(evaluate, each) for each in (first, second))
    bent = change[..., :3] - weight_a * slope_b - weight_b * slope_a - change[..., 3:] * point
    return np.asarray(bent / weight)
