"""Curvature of a patch and the places where it is no surface, faces away or is too tight for a ball.

Sign: + convex toward the tool, - concave (EQUATIONS.md, section 2).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from planner.surface.bspline import SpanBasis
from planner.surface.patch import NurbsPatch

Array = NDArray[np.float64]
Measure = Callable[[Array, Array], Array]


def regularity(patch: NurbsPatch, u: Array, v: Array) -> Array:
    """|Qu x Qv| against the patch's own mean |Qu| |Qv|, shape (m,): 0 where the patch is singular."""
    found = patch.evaluate(u, v)
    cross = np.cross(found.du, found.dv, axis=0)
    scale = float(np.mean(np.linalg.norm(found.du, axis=0)) * np.mean(np.linalg.norm(found.dv, axis=0)))
    return np.asarray(np.linalg.norm(cross, axis=0) / max(scale, float(np.finfo(np.float64).tiny)))


def upwardness(patch: NurbsPatch, u: Array, v: Array) -> Array:
    """The Z component of the unit normal Qu x Qv / |Qu x Qv|, shape (m,)."""
    found = patch.evaluate(u, v)
    cross = np.cross(found.du, found.dv, axis=0)
    return np.asarray(cross[2] / np.linalg.norm(cross, axis=0))


def least_curvature(patch: NurbsPatch, side: int, u: Array, v: Array) -> Array:
    """The smaller principal curvature kappa_per_mm, shape (m,), eq. (5): below -1/R a ball of radius R gouges."""
    found = patch.evaluate(u, v)
    normal = np.cross(found.du, found.dv, axis=0)
    normal *= side / np.linalg.norm(normal, axis=0)
    E, F, G = ((a * b).sum(0) for a, b in ((found.du, found.du), (found.du, found.dv), (found.dv, found.dv)))
    L, M, N = (-(bend * normal).sum(0) for bend in (found.duu, found.duv, found.dvv))
    area = E * G - F * F
    mean = (E * N + G * L - 2 * F * M) / (2 * area)
    return np.asarray(mean - np.sqrt(np.maximum(mean**2 - (L * N - M * M) / area, 0.0)))


def lowest(patch: NurbsPatch, measure: Measure, *, a_span: int, rounds: int) -> tuple[float, float, float]:
    """The smallest value of a measure over the patch and its (u, v): a grid, then finer grids about the lowest point.

    `a_span` places a knot span and direction, both ends included; `rounds` finer grids, each a quarter of the last.
    """
    u, v = (span_places(knots, a_span) for knots in (patch.basis_u, patch.basis_v))
    half_u, half_v = float(np.diff(u).max()), float(np.diff(v).max())
    (u_low, u_high), (v_low, v_high) = patch.domain
    best = (np.inf, u_low, v_low)
    for _ in range(rounds + 1):
        grid_u, grid_v = (part.ravel() for part in np.meshgrid(u, v, indexing="ij"))
        values = measure(grid_u, grid_v)
        values = np.where(np.isfinite(values), values, -np.inf)
        at = int(np.argmin(values))
        if values[at] < best[0]:
            best = float(values[at]), float(grid_u[at]), float(grid_v[at])
        u = np.clip(np.linspace(best[1] - half_u, best[1] + half_u, 9), u_low, u_high)
        v = np.clip(np.linspace(best[2] - half_v, best[2] + half_v, 9), v_low, v_high)
        half_u, half_v = half_u / 4, half_v / 4
    return best


def span_places(basis: SpanBasis, a_span: int) -> Array:
    """Parameters evenly inside every knot span, with both ends of the domain."""
    starts, widths = basis.starts, basis.widths
    inside = starts[:, None] + widths[:, None] * np.arange(a_span) / a_span
    return np.append(inside.ravel(), starts[-1] + widths[-1])
