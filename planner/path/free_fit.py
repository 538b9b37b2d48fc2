"""Cubic B-splines fitted to many curves at once, with free parametrisation: every control point and every knot moves.

Gauss-Newton on the orthogonal distance, batched: one row a curve, the same number of spans in all rows. The weights
grow with the distance, so that the largest one falls and not only their mean. Equations (F5) to (F8) of
EQUATIONS-fitting.md. Arrays carry the coordinates w, z first: (2, p, m).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.path.curve import Nodes
from planner.path.model import Array
from planner.path.plane_spline import Index, basis, find_spans, pieces

GIVE_UP_AFTER = 5
FEWEST_NODES = 4.0


@dataclass(frozen=True, slots=True)
class Fit:
    """Splines of a batch: `knots` (p, n + 4), `control_points` (2, p, n), `feet` (p, m), and the `errors_mm` (p,).

    The feet are the parameters of the nodes; an error is the largest distance at the nodes.
    """

    knots: Array
    control_points: Array
    feet: Array
    errors_mm: Array

    def take(self, rows: Index) -> Fit:
        """These splines only."""
        return Fit(self.knots[rows], self.control_points[:, rows], self.feet[rows], self.errors_mm[rows])

    def put(self, rows: Index, other: Fit) -> None:
        """Overwrite these rows."""
        self.knots[rows], self.control_points[:, rows] = other.knots, other.control_points
        self.feet[rows], self.errors_mm[rows] = other.feet, other.errors_mm


def start_fit(nodes: Nodes, knots: Array, feet: Array) -> Fit:
    """Least squares in both coordinates with the feet (p, m) as parameters, ends held: where the iteration starts."""
    spans = find_spans(knots, feet)
    rows, count = knots.shape[0], knots.shape[1] - 4
    matrix = np.zeros((*spans.shape, count))
    grid = np.arange(spans.size).reshape(spans.shape) * count + spans - 3
    matrix.reshape(-1)[grid + np.arange(4)[:, None, None]] = basis(knots, feet, spans)[0]
    points = nodes.points.transpose(1, 2, 0)
    ends = points[:, [0, -1]]
    right = points - matrix[:, :, [0, -1]] @ ends
    inner = matrix[:, :, 1:-1]
    across = inner.transpose(0, 2, 1)
    middle = np.linalg.solve(across @ inner + 1e-12 * np.eye(count - 2), across @ right)
    control_points = np.concatenate([ends[:, :1], middle, ends[:, 1:]], axis=1).transpose(2, 0, 1)
    fit = Fit(knots.copy(), np.ascontiguousarray(control_points), feet, np.zeros(rows))
    return project(nodes, fit, steps=2)[0]


def project(nodes: Nodes, fit: Fit, *, steps: int) -> tuple[Fit, Array]:
    """The fit with its feet moved to where the curve's normal at each node meets the spline, (F5).

    Also the signed distances (p, m) along those normals, mm, carried to the moved feet to first order.
    """
    form = pieces(fit.knots, fit.control_points)
    feet, (cosine, sine) = fit.feet, nodes.tangents
    last = fit.knots[:, -1:]
    for _ in range(steps):
        points, velocity = form.evaluate(feet)
        gap = points - nodes.points
        ahead = (gap[0] * cosine + gap[1] * sine) / (velocity[0] * cosine + velocity[1] * sine)
        moved = np.minimum(np.maximum(feet - ahead, 0.0), last)
        distance = gap[1] * cosine - gap[0] * sine + (moved - feet) * (velocity[1] * cosine - velocity[0] * sine)
        feet = moved
    return Fit(fit.knots, fit.control_points, feet, np.abs(distance).max(axis=1)), distance


def improve(nodes: Nodes, fit: Fit, *, powers: Array, targets_mm: Array) -> Fit:
    """The fit after one damped Gauss-Newton step for every power of `powers`: 2 is least squares, more nears minimax.

    A step that raises its own sum of powers is dropped and the damping raised, row by row (F8). A row stops when it
    reaches its target of `targets_mm` (p,), or when it is far from it and has gained less than a tenth in some steps.
    """
    best = Fit(fit.knots.copy(), fit.control_points.copy(), fit.feet.copy(), fit.errors_mm.copy())
    live = np.flatnonzero(fit.errors_mm > targets_mm)
    fit, part, damping = fit.take(live), nodes.take(live), np.full(len(live), 1e-4)
    history: list[Array] = []
    for power in powers:
        if not len(live):
            break
        fit, damping = _step(part, fit, float(power), damping)
        is_better = fit.errors_mm < best.errors_mm[live]
        best.put(live[is_better], fit.take(np.flatnonzero(is_better)))
        reached = best.errors_mm[live]
        history.append(reached)
        is_open = reached > targets_mm[live]
        if len(history) > GIVE_UP_AFTER:
            gain = history[-1 - GIVE_UP_AFTER] / reached
            is_open &= (gain**2 > reached / targets_mm[live]) | (gain > 1.1)
        if not is_open.all():
            kept = np.flatnonzero(is_open)
            live, fit, part, damping = live[kept], fit.take(kept), part.take(kept), damping[kept]
            history = [values[kept] for values in history]
    return best


def _step(nodes: Nodes, fit: Fit, power: float, damping: Array) -> tuple[Fit, Array]:
    """One damped Gauss-Newton step on the sum of this power of the distances, and the new damping (p,)."""
    distance, jacobian = linearise(nodes, fit)
    floor = _floors(fit)
    # Knots beside an interval at its floor stay, or every step would be cut to nothing.
    is_held = np.diff(fit.knots[:, 3:-3], axis=1) <= 1.05 * floor
    first = jacobian.shape[2] - (fit.knots.shape[1] - 8)
    jacobian[:, :, first:] *= ~(is_held[:, None, :-1] | is_held[:, None, 1:])
    largest = np.maximum(np.abs(distance).max(axis=1, keepdims=True), np.finfo(float).tiny)
    share = np.abs(distance) / largest
    weight = (share + 1e-3) ** (power - 2.0)
    weighted = (jacobian * weight[..., None]).transpose(0, 2, 1)
    matrix = weighted @ jacobian
    diagonal = np.einsum("pii->pi", matrix)
    diagonal += damping[:, None] * diagonal + 1e-9 * diagonal.max(axis=1, keepdims=True)
    step = np.linalg.solve(matrix, weighted @ distance[..., None])[..., 0] / (1.0 - power)
    moved, new_distance = project(nodes, _move(fit, step, floor), steps=2)
    is_better = ((np.abs(new_distance) / largest) ** power).sum(axis=1) < (share**power).sum(axis=1)
    moved.put(np.flatnonzero(~is_better), fit.take(np.flatnonzero(~is_better)))
    return moved, np.where(is_better, 0.2 * damping, 10.0 * damping)


def _move(fit: Fit, step: Array, floor: Array) -> Fit:
    """The fit moved by unknowns (p, 3n - 8); shortened where a knot interval would halve or fall below its floor."""
    rows, inner = len(fit.knots), fit.control_points.shape[2] - 2
    points, knots = step[:, : 2 * inner].reshape(rows, 2, inner), step[:, 2 * inner :]
    widths = np.diff(fit.knots[:, 3:-3], axis=1)
    growth = np.empty_like(widths)
    growth[:, :-1], growth[:, -1] = knots, 0.0
    growth[:, 1:] -= knots
    room = np.clip(widths - floor, 0.0, 0.5 * widths)
    share = np.where(growth < -room, room / np.maximum(-growth, room + np.finfo(float).tiny), 1.0).min(axis=1)
    new_knots, new_points = fit.knots.copy(), fit.control_points.copy()
    new_knots[:, 4:-4] += share[:, None] * knots
    new_points[:, :, 1:-1] += (share[:, None, None] * points).transpose(1, 0, 2)
    return Fit(new_knots, new_points, fit.feet, fit.errors_mm)


def _floors(fit: Fit) -> Array:
    """The least width (p, spans) that leaves each knot interval its fewest nodes."""
    rows, spans = len(fit.knots), fit.knots.shape[1] - 7
    places = find_spans(fit.knots, fit.feet) - 3 + spans * np.arange(rows)[:, None]
    counts = np.bincount(places.ravel(), minlength=rows * spans).reshape(rows, spans)
    return np.asarray(FEWEST_NODES / np.maximum(counts, 1) * np.diff(fit.knots[:, 3:-3], axis=1))


def linearise(nodes: Nodes, fit: Fit) -> tuple[Array, Array]:
    """Distances (p, m) and their derivatives (p, m, 3n - 8): by inner control points' w, by their z, by inner knots.

    De Boor's scheme on the control points' own distances, then backwards through it for the derivatives, (F6), (F7).
    """
    spans = find_spans(fit.knots, fit.feet)
    rows, count = np.arange(len(spans))[:, None], fit.control_points.shape[2]
    fall, run = nodes.tangents[1], nodes.tangents[0]
    near = fit.knots.reshape(-1)[rows * (count + 4) + spans + np.arange(-2, 4)[:, None, None]]
    legs = rows * count + spans + np.arange(-3, 1)[:, None, None]
    gap = fit.control_points.reshape(2, -1)[:, legs] - nodes.points[:, None]
    levels = [gap[1] * run - gap[0] * fall]
    shares, rates = [], []
    for depth in (1, 2, 3):
        width = near[3 : 7 - depth] - near[depth - 1 : 3]
        share, rise = (fit.feet - near[depth - 1 : 3]) / width, np.diff(levels[-1], axis=0)
        levels.append(levels[-1][:-1] + share * rise)
        shares.append(share)
        rates.append(rise / width)
    by_knot = np.zeros_like(near)
    by_point = np.ones_like(spans[None], dtype=np.float64)
    for depth in (3, 2, 1):
        upper = by_point * shares[depth - 1]
        lower = by_point - upper
        by_knot[depth - 1 : 3] -= lower * rates[depth - 1]
        by_knot[3 : 7 - depth] -= upper * rates[depth - 1]
        by_point = np.empty((5 - depth, *spans.shape))
        by_point[:-1], by_point[-1] = lower, 0.0
        by_point[1:] += upper
    values = np.concatenate([-by_point * fall, by_point * run, by_knot])
    free = 3 * count - 8
    jacobian = np.zeros((*spans.shape, free + 1))
    base = np.arange(spans.size).reshape(spans.shape) * (free + 1)
    jacobian.reshape(-1)[base + _columns(count)[:, spans - 3]] = values
    return levels[3][0], jacobian[:, :, :free]


def _columns(count: int) -> Index:
    """Column (14, spans) of each of a span's fourteen numbers; those of held ends fall into one more column."""
    spill = 3 * count - 8
    spans = np.arange(count - 3)
    places = np.full(count + 4, spill)
    places[1 : count - 1] = np.arange(count - 2)
    along = places[spans + np.arange(4)[:, None]]
    knots = np.full(count + 4, spill)
    knots[4:count] = 2 * (count - 2) + np.arange(count - 4)
    return np.concatenate(
        [along, np.where(along == spill, spill, along + count - 2), knots[spans + 1 + np.arange(6)[:, None]]]
    )
