"""Curvature of a patch and the places where it is no surface, faces away or is too tight for a ball.

Sign: + convex toward the tool, - concave (EQUATIONS.md, section 2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.surface.bspline import SpanBasis
from planner.surface.patch import NurbsPatch, SurfacePoints

Array = NDArray[np.float64]
Measure = Callable[[SurfacePoints], Array]


@dataclass(frozen=True, slots=True)
class Lowest:
    """The smallest value of a measure over a patch and where it was found."""

    value: float
    u: float
    v: float

    @property
    def place(self) -> str:
        """The place as messages say it."""
        return f"(u, v) = ({self.u:.4g}, {self.v:.4g})"


@dataclass(frozen=True, slots=True)
class Survey:
    """A patch evaluated on a grid once, for several measures: `u` (n,), `v` (k,), `points` of all n k places."""

    patch: NurbsPatch
    u: Array
    v: Array
    points: SurfacePoints


def survey(patch: NurbsPatch) -> Survey:
    """Every knot span at both ends and between, more densely where spans are few."""
    spans = len(patch.basis_u.starts) * len(patch.basis_v.starts)
    a_span = 2 if spans > 400 else 6 if spans > 25 else 16
    u, v = span_places(patch.basis_u, a_span), span_places(patch.basis_v, a_span)
    grid_u, grid_v = (part.ravel() for part in np.meshgrid(u, v, indexing="ij"))
    return Survey(patch, u, v, patch.evaluate(grid_u, grid_v))


def regularity(points: SurfacePoints) -> Array:
    """The area |Qu x Qv| of the parameter cell, mm^2, shape (m,): 0 where the patch is singular."""
    return np.asarray(np.linalg.norm(np.cross(points.du, points.dv, axis=0), axis=0))


def upwardness(points: SurfacePoints) -> Array:
    """The Z component of the unit normal Qu x Qv / |Qu x Qv|, shape (m,)."""
    cross = np.cross(points.du, points.dv, axis=0)
    return np.asarray(cross[2] / np.linalg.norm(cross, axis=0))


def least_curvature(points: SurfacePoints, side: int) -> Array:
    """The smaller principal curvature kappa_per_mm, shape (m,), eq. (5): at -1/R or below a ball of radius R gouges."""
    normal = np.cross(points.du, points.dv, axis=0)
    normal *= side / np.linalg.norm(normal, axis=0)
    E, F, G = ((a * b).sum(0) for a, b in ((points.du, points.du), (points.du, points.dv), (points.dv, points.dv)))
    L, M, N = (-(bend * normal).sum(0) for bend in (points.duu, points.duv, points.dvv))
    area = E * G - F * F
    mean = (E * N + G * L - 2 * F * M) / (2 * area)
    return np.asarray(mean - np.sqrt(np.maximum(mean**2 - (L * N - M * M) / area, 0.0)))


def lowest(survey: Survey, measure: Measure, *, rounds: int) -> Lowest:
    """The smallest value of a measure: the survey's grid, then `rounds` finer grids about the lowest point.

    A value that is not a number counts as the lowest of all.
    """
    u, v, points = survey.u, survey.v, survey.points
    half_u, half_v = float(np.diff(u).max()), float(np.diff(v).max())
    (u_low, u_high), (v_low, v_high) = survey.patch.domain
    best = Lowest(np.inf, u_low, v_low)
    for _ in range(rounds + 1):
        with np.errstate(divide="ignore", invalid="ignore"):
            values = measure(points)
        values = np.where(np.isnan(values), -np.inf, values)
        row, column = np.unravel_index(int(np.argmin(values)), (len(u), len(v)))
        if values.min() < best.value:
            best = Lowest(float(values.min()), float(u[row]), float(v[column]))
        u = np.clip(np.linspace(best.u - half_u, best.u + half_u, 9), u_low, u_high)
        v = np.clip(np.linspace(best.v - half_v, best.v + half_v, 9), v_low, v_high)
        points = survey.patch.evaluate(*(part.ravel() for part in np.meshgrid(u, v, indexing="ij")))
        half_u, half_v = half_u / 4, half_v / 4
    return best


def span_places(basis: SpanBasis, a_span: int) -> Array:
    """Parameters evenly inside every knot span, with both ends of the domain."""
    inside = basis.starts[:, None] + basis.widths[:, None] * np.arange(a_span) / a_span
    return np.append(inside.ravel(), basis.high)
