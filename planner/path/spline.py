"""The planar cubic B-spline of every pass, with as few spans as its tolerance allows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.path.bound import certify
from planner.path.curve import ExactCurve, relative_nodes
from planner.path.free_fit import Fit, improve, start_fit
from planner.path.model import Array, Method, PlaneSpline

NODES_A_SPAN = 10


@dataclass(frozen=True, slots=True)
class FittedSpline:
    """A spline in the pass's plane and the bound on its distance from the exact curve, both ways."""

    spline: PlaneSpline
    deviation_mm: float
    method: Method


def fit_passes(curves: Sequence[ExactCurve], tolerance_mm: float) -> list[FittedSpline]:
    """One cubic B-spline a curve, bounded within the tolerance, ends on the curve's ends; (F5) to (F11).

    Curves that need the same number of spans are fitted together.
    """
    done: dict[int, FittedSpline] = {}
    spans = 1
    while len(done) < len(curves):
        open_ = [index for index in range(len(curves)) if index not in done]
        nodes = relative_nodes([curves[index] for index in open_], NODES_A_SPAN * spans + 9)
        start = start_fit(nodes, even_knots(nodes.arc_mm[:, -1], spans))
        for fit in (improve(nodes, start, powers=np.minimum(2.0 + 0.3 * np.arange(40), 12.0)), start):
            for row, index in enumerate(open_):
                spline = spline_of(fit, row)
                deviation_mm, method = certify(curves[index], spline)
                if deviation_mm <= tolerance_mm and index not in done:
                    done[index] = FittedSpline(spline, deviation_mm, method)
        spans += max(1, spans // 6)
    return [done[index] for index in range(len(curves))]


def even_knots(lengths_mm: Array, spans: int) -> Array:
    """Clamped cubic knots (p, spans + 7) at equal distances over lengths (p,)."""
    inner = lengths_mm[:, None] * np.linspace(0.0, 1.0, spans + 1)
    return np.concatenate([np.repeat(inner[:, :1], 3, axis=1), inner, np.repeat(inner[:, -1:], 3, axis=1)], axis=1)


def spline_of(fit: Fit, row: int) -> PlaneSpline:
    """One spline of a batch."""
    return PlaneSpline(3, fit.knots[row].copy(), fit.control_points[row].copy())
