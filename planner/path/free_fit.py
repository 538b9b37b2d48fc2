"""Cubic B-splines fitted to many curves at once, with free parametrisation: every control point and every knot moves.

Gauss-Newton on the orthogonal distance, batched: one row a curve, the same number of spans in all rows. The weights
grow with the distance, so that the largest one falls and not only their mean. Equations (F5) to (F8) of
EQUATIONS-fitting.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.path.curve import Nodes
from planner.path.model import Array
from planner.path.plane_spline import Index, basis, combine, find_spans


@dataclass(frozen=True, slots=True)
class Fit:
    """Splines of a batch: `knots` (p, n + 4), `control_points` (p, n, 2), `feet` (p, m) parameters of the nodes."""

    knots: Array
    control_points: Array
    feet: Array

    def take(self, rows: Array) -> Fit:
        """These splines only; `rows` are indices or a mask."""
        return Fit(self.knots[rows], self.control_points[rows], self.feet[rows])

    def where(self, choice: Array, other: Fit) -> Fit:
        """This fit in the rows where `choice` (p,) holds, the other elsewhere."""
        return Fit(
            np.where(choice[:, None], self.knots, other.knots),
            np.where(choice[:, None, None], self.control_points, other.control_points),
            np.where(choice[:, None], self.feet, other.feet),
        )


def start_fit(nodes: Nodes, knots: Array) -> Fit:
    """Least squares in both coordinates with the arc length as parameter, ends held: where the iteration starts."""
    spans = find_spans(knots, nodes.arc_mm)
    values = basis(knots, nodes.arc_mm, spans)[0]
    rows, columns = _grid(spans)
    matrix = np.zeros((*spans.shape, knots.shape[1] - 4))
    for j in range(4):
        matrix[rows, columns, spans - 3 + j] = values[j]
    ends = nodes.points[:, [0, -1]]
    right = nodes.points - matrix[:, :, [0, -1]] @ ends
    inner = matrix[:, :, 1:-1]
    across = inner.transpose(0, 2, 1)
    damping = 1e-12 * np.eye(inner.shape[2])
    middle = np.linalg.solve(across @ inner + damping, across @ right)
    control_points = np.concatenate([ends[:, :1], middle, ends[:, 1:]], axis=1)
    return project(nodes, Fit(knots, control_points, nodes.arc_mm), steps=2)


def project(nodes: Nodes, fit: Fit, *, steps: int) -> Fit:
    """The fit with its feet moved to where the curve's normal at each node meets the spline, (F5)."""
    feet = fit.feet
    for _ in range(steps):
        spans = find_spans(fit.knots, feet)
        values, slopes, _ = basis(fit.knots, feet, spans)
        gap = combine(values, fit.control_points, spans) - nodes.points
        velocity = combine(slopes, fit.control_points, spans)
        ahead = (gap * nodes.tangents).sum(axis=-1) / (velocity * nodes.tangents).sum(axis=-1)
        feet = np.clip(feet - ahead, 0.0, fit.knots[:, -1:])
    return Fit(fit.knots, fit.control_points, feet)


def distances(nodes: Nodes, fit: Fit) -> Array:
    """Signed distances (p, m) of spline from curve along the curve's normal, mm, at the feet."""
    spans = find_spans(fit.knots, fit.feet)
    gap = combine(basis(fit.knots, fit.feet, spans)[0], fit.control_points, spans) - nodes.points
    return np.asarray(gap[..., 1] * nodes.tangents[..., 0] - gap[..., 0] * nodes.tangents[..., 1])


def improve(nodes: Nodes, fit: Fit, *, powers: Array) -> Fit:
    """The fit after one damped Gauss-Newton step for every power of `powers`: 2 is least squares, more nears minimax.

    A step that raises its own sum of powers is dropped and the damping raised, row by row (F8).
    """
    damping = np.full(len(fit.knots), 1e-4)
    for power in powers:
        distance, jacobian = linearise(nodes, fit)
        largest = np.maximum(np.abs(distance).max(axis=1, keepdims=True), np.finfo(float).tiny)
        share = np.abs(distance) / largest
        weight = (share + 1e-3) ** (power - 2.0)
        weighted = (jacobian * weight[..., None]).transpose(0, 2, 1)
        matrix = weighted @ jacobian
        diagonal = np.einsum("pii->pi", matrix)
        diagonal += damping[:, None] * diagonal + 1e-9 * diagonal.max(axis=1, keepdims=True)
        step = np.linalg.solve(matrix, weighted @ distance[..., None])[..., 0] / (1.0 - power)
        moved = project(nodes, _move(fit, step), steps=2)
        new_share = np.abs(distances(nodes, moved)) / largest
        is_better = (new_share**power).sum(axis=1) < (share**power).sum(axis=1)
        damping = np.where(is_better, 0.2 * damping, 10.0 * damping)
        fit = moved.where(is_better, fit)
    return fit


def _move(fit: Fit, step: Array) -> Fit:
    """The fit moved by unknowns (p, 3n - 8); a step that would shrink a knot interval below half is shortened."""
    rows, inner = len(fit.knots), fit.control_points.shape[1] - 2
    points, knots = step[:, : 2 * inner].reshape(rows, inner, 2), step[:, 2 * inner :]
    widths = np.diff(fit.knots[:, 3:-3], axis=1)
    growth = np.diff(np.pad(knots, ((0, 0), (1, 1))), axis=1)
    share = np.minimum(1.0, (0.5 * widths / np.maximum(-growth, 0.5 * widths)).min(axis=1))
    new_knots, new_points = fit.knots.copy(), fit.control_points.copy()
    new_knots[:, 4:-4] += share[:, None] * knots
    new_points[:, 1:-1] += share[:, None, None] * points
    return Fit(new_knots, new_points, fit.feet)


def linearise(nodes: Nodes, fit: Fit) -> tuple[Array, Array]:
    """Distances (p, m) and their derivatives (p, m, 3n - 8) by inner control points (w, z in turn), then inner knots.

    De Boor's scheme on the control points' own distances, then backwards through it for the derivatives, (F6), (F7).
    """
    spans = find_spans(fit.knots, fit.feet)
    rows, columns = _grid(spans)
    normal_w, normal_z = -nodes.tangents[..., 1], nodes.tangents[..., 0]
    near = [fit.knots[rows, spans + offset] for offset in range(-2, 4)]
    level: list[Array] = []
    for j in range(4):
        gap = fit.control_points[rows, spans - 3 + j] - nodes.points
        level.append(gap[..., 0] * normal_w + gap[..., 1] * normal_z)
    shares: list[list[Array]] = []
    rises: list[list[Array]] = []
    for depth in (1, 2, 3):
        widths = [near[a + 3] - near[a + depth - 1] for a in range(4 - depth)]
        share = [(fit.feet - near[a + depth - 1]) / widths[a] for a in range(4 - depth)]
        rise = [level[a + 1] - level[a] for a in range(4 - depth)]
        level = [level[a] + share[a] * rise[a] for a in range(4 - depth)]
        shares.append(share)
        rises.append([rise[a] / widths[a] for a in range(4 - depth)])
    by_knot = [np.zeros_like(fit.feet) for _ in near]
    by_point: list[Array] = [np.ones_like(fit.feet)]
    for depth in (3, 2, 1):
        spread = [np.zeros_like(fit.feet) for _ in range(5 - depth)]
        for a in range(4 - depth):
            upper = by_point[a] * shares[depth - 1][a]
            lower = by_point[a] - upper
            by_knot[a + depth - 1] -= lower * rises[depth - 1][a]
            by_knot[a + 3] -= upper * rises[depth - 1][a]
            spread[a] += lower
            spread[a + 1] += upper
        by_point = spread
    count = fit.control_points.shape[1]
    jacobian = np.zeros((*spans.shape, 3 * count + 4))
    for j in range(4):
        place = 2 * (spans - 3 + j)
        jacobian[rows, columns, place] = by_point[j] * normal_w
        jacobian[rows, columns, place + 1] = by_point[j] * normal_z
    for offset in range(6):
        jacobian[rows, columns, 2 * count + spans - 2 + offset] = by_knot[offset]
    free = np.concatenate([np.arange(2, 2 * count - 2), np.arange(2 * count + 4, 3 * count)])
    return level[0], jacobian[:, :, free]


def _grid(spans: Index) -> tuple[Index, Index]:
    """Row and column numbers that go with an index array (p, m)."""
    return np.arange(spans.shape[0])[:, None], np.arange(spans.shape[1])[None, :]
