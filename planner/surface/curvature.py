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
    """The smallest value of a measure: the survey's grid, then `rounds` finer grids about its lowest hollows.

    A hollow is followed as long as a parabola through it and its neighbours, twice as deep, could be the lowest of all.
    A value that is not a number counts as the lowest of all.
    """
    (u_low, u_high), (v_low, v_high) = survey.patch.domain
    half_u, half_v = float(np.diff(survey.u).max()), float(np.diff(survey.v).max())
    values = _measured(measure, survey.points).reshape(len(survey.u), len(survey.v))
    rows, columns = _hollows(values)
    best_u, best_v, best = survey.u[rows], survey.v[columns], values[rows, columns]
    steps = np.linspace(-1.0, 1.0, 9)
    for _ in range(rounds):
        u = np.clip(best_u[:, None, None] + half_u * steps[:, None], u_low, u_high) + 0 * steps
        v = np.clip(best_v[:, None, None] + half_v * steps, v_low, v_high) + 0 * steps[:, None]
        finer = _measured(measure, survey.patch.evaluate(u.ravel(), v.ravel())).reshape(len(best), -1)
        at = np.argmin(finer, axis=1)
        hollow = np.arange(len(best))
        is_lower = finer[hollow, at] < best
        best = np.where(is_lower, finer[hollow, at], best)
        best_u = np.where(is_lower, u.reshape(len(best), -1)[hollow, at], best_u)
        best_v = np.where(is_lower, v.reshape(len(best), -1)[hollow, at], best_v)
        half_u, half_v = half_u / 4, half_v / 4
    lowest_of_all = int(np.argmin(best))
    return Lowest(float(best[lowest_of_all]), float(best_u[lowest_of_all]), float(best_v[lowest_of_all]))


def _measured(measure: Measure, points: SurfacePoints) -> Array:
    """The measure (m,) at these points; what is not a number is lower than all."""
    with np.errstate(divide="ignore", invalid="ignore"):
        values = measure(points)
    return np.where(np.isnan(values), -np.inf, values)


def _hollows(values: Array, most: int = 64) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns (k,) of grid values (n, k) below all around that could be the lowest between samples.

    Of all that could, the `most` lowest, the very lowest first.
    """
    padded = np.pad(values, 1, constant_values=np.inf)
    rows, columns = values.shape
    around = np.stack([padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3) if (i, j) != (1, 1)])
    # A parabola with its samples a step apart falls below the lowest by an eighth of their second difference at most.
    rise = np.where(np.isfinite(around), around, -np.inf).max(axis=0) - values
    could_be = values - rise / 2
    is_hollow = (values <= around.min(axis=0)) & ~(could_be > values.min())
    at = np.flatnonzero(is_hollow | (values == values.min()))
    at = at[np.argsort(values.ravel()[at], kind="stable")][:most]
    return np.unravel_index(at, values.shape)[0], np.unravel_index(at, values.shape)[1]


def span_places(basis: SpanBasis, a_span: int) -> Array:
    """Parameters evenly inside every knot span, with both ends of the domain."""
    inside = basis.starts[:, None] + basis.widths[:, None] * np.arange(a_span) / a_span
    return np.append(inside.ravel(), basis.high)
