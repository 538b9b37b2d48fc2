"""One B-spline or NURBS patch, evaluated with its first and second derivatives in blocks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planner.surface.bspline import SpanBasis, span_basis

Array = NDArray[np.float64]

BLOCK = 2048  # points a block: the working set stays in the processor's cache


@dataclass(frozen=True, slots=True)
class SurfacePoints:
    """Points of a surface and their derivatives: each array is (3, m), mm, components first."""

    point: Array
    du: Array
    dv: Array
    duu: Array
    duv: Array
    dvv: Array


@dataclass(frozen=True, eq=False)  # a patch is equal to itself alone, and so can be a key
class NurbsPatch:
    """A tensor-product patch Q(u, v); outside its knots the end polynomials go on.

    `control_points` (n_u, n_v, 3), mm; `weights` (n_u, n_v), or None for a polynomial patch. `name` is how messages
    call the patch.
    """

    degree_u: int
    degree_v: int
    knots_u: Array
    knots_v: Array
    control_points: Array
    weights: Array | None = None
    name: str = "patch 1"

    @cached_property
    def basis_u(self) -> SpanBasis:
        """Basis of the u direction."""
        return span_basis(self.knots_u, self.degree_u)

    @cached_property
    def basis_v(self) -> SpanBasis:
        """Basis of the v direction."""
        return span_basis(self.knots_v, self.degree_v)

    @property
    def domain(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((u_low, u_high), (v_low, v_high))."""
        return (self.basis_u.low, self.basis_u.high), (self.basis_v.low, self.basis_v.high)

    def turned(self, angle_rad: float) -> NurbsPatch:
        """The same patch in a frame turned about +Z by this angle: what lay along the angle lies along +x."""
        if angle_rad == 0.0:
            return self
        cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
        turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return replace(self, control_points=self.control_points @ turn.T)

    @cached_property
    def _rows(self) -> Array:
        """Coefficients, one row a pair of spans: (spans_u * spans_v, (p + 1)(q + 1) dim), eq. (2)."""
        points = self.control_points
        if self.weights is not None:
            weights = self.weights[..., None]
            points = np.concatenate([points * weights, weights], axis=2)
        in_u, in_v = self.basis_u, self.basis_v
        reach_u = in_u.first[:, None] + np.arange(in_u.degree + 1)
        reach_v = in_v.first[:, None] + np.arange(in_v.degree + 1)
        rows = np.einsum("sai,sabd->sibd", in_u.powers, points[reach_u])
        full = np.einsum("tbj,sitbd->stijd", in_v.powers, rows[:, :, reach_v])
        return np.ascontiguousarray(full.reshape(len(reach_u) * len(reach_v), -1))

    def evaluate(self, u: Array, v: Array) -> SurfacePoints:
        """Points and derivatives at parameters u, v of shape (m,); any m, worked through in blocks."""
        if len(u) <= BLOCK:
            return self._evaluate_block(u, v)
        parts = [self._evaluate_block(u[at : at + BLOCK], v[at : at + BLOCK]) for at in range(0, len(u), BLOCK)]
        names = SurfacePoints.__slots__
        return SurfacePoints(*(np.concatenate([getattr(part, name) for part in parts], axis=1) for name in names))

    def _evaluate_block(self, u: Array, v: Array) -> SurfacePoints:
        in_u, in_v = self.basis_u, self.basis_v
        span_u, span_v = in_u.spans_of(u), in_v.spans_of(v)
        width_u, width_v = in_u.widths[span_u], in_v.widths[span_v]
        rows = self._rows[span_u * len(in_v.starts) + span_v]
        dim = 3 if self.weights is None else 4
        cells = np.ascontiguousarray(rows.T).reshape(in_u.degree + 1, in_v.degree + 1, dim, len(u))
        in_span_u, in_span_v = (u - in_u.starts[span_u]) / width_u, (v - in_v.starts[span_v]) / width_v
        value, slope, bend = _horner(cells.transpose(1, 0, 2, 3), in_span_v, 2)
        point, du, duu = _horner(value, in_span_u, 2)
        dv, duv = _horner(slope, in_span_u, 1)
        (dvv,) = _horner(bend, in_span_u, 0)
        found = SurfacePoints(
            point, du / width_u, dv / width_v, duu / width_u**2, duv / (width_u * width_v), dvv / width_v**2
        )
        return found if self.weights is None else _project(found)


def _horner(coefficients: Array, at: Array, derivatives: int) -> tuple[Array, ...]:
    """A polynomial and its first derivatives: coefficients (degree + 1, ..., m), at (m,)."""
    totals = [coefficients[-1].copy()]
    for coefficient in coefficients[-2::-1]:
        highest = [totals[-1].copy()] if len(totals) <= derivatives else []
        for order in range(len(totals) - 1, 0, -1):
            totals[order] *= at
            totals[order] += totals[order - 1]
        totals[0] *= at
        totals[0] += coefficient
        totals += highest
    totals += [np.zeros_like(totals[0]) for _ in range(derivatives + 1 - len(totals))]
    if derivatives == 2:
        totals[2] *= 2.0
    return tuple(totals)


def _project(found: SurfacePoints) -> SurfacePoints:
    """Homogeneous values (4, m) into space by the quotient rule, eq. (3)."""
    weight = found.point[3]
    point = found.point[:3] / weight
    du = (found.du[:3] - found.du[3] * point) / weight
    dv = (found.dv[:3] - found.dv[3] * point) / weight
    duu = (found.duu[:3] - 2 * found.du[3] * du - found.duu[3] * point) / weight
    duv = (found.duv[:3] - found.du[3] * dv - found.dv[3] * du - found.duv[3] * point) / weight
    dvv = (found.dvv[:3] - 2 * found.dv[3] * dv - found.dvv[3] * point) / weight
    return SurfacePoints(point, du, dv, duu, duv, dvv)
