"""Cubic B-splines fitted to many curves at once, with free parametrisation: every control point and every knot moves.

Gauss-Newton on the orthogonal distance, batched: one row a curve, all rows' spans end to end. The weights grow with
the distance, so that the largest one falls and not only their mean. Equations (F5) to (F9) of EQUATIONS-fitting.md.
Arrays run over coordinates w, z or numbers of a span first, then the k places in a span, then all S spans.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.path.curve import CurveTable
from planner.path.gauss_newton import whole_power
from planner.path.model import Array
from planner.path.plane_spline import Index
from planner.path.span_batch import SpanFits, SpanIndex, solve_spans

PLACES = 12
NARROWEST = 0.1  # of the mean span
SHARES = ((np.arange(PLACES) + 0.5) / PLACES)[:, None]


@dataclass(frozen=True, slots=True)
class Fit(SpanFits):
    """Splines of a batch, span by span, and how far they are from their curves.

    `knots` (6, S) about each span and its `points` (2, 4, S) of control; `arcs` (k, S) the arc lengths on the curve
    opposite to the places, `on_curve` (2, k, S) the points there with unit `normals` (2, k, S), `distance` (k, S) along
    these.
    """

    knots: Array
    points: Array
    arcs: Array
    on_curve: Array
    normals: Array
    distance: Array

    def spline(self, row: int) -> tuple[Array, Array]:
        """Knots (n + 4,) and control points (n, 2) of one spline."""
        first, last = self.index.firsts[row], self.index.lasts[row]
        near, points = self.knots[:, first : last + 1], self.points[:, :, first : last + 1]
        knots = np.concatenate([near[:1, 0], near[:, 0], near[5, 1:], near[5, -1:]])
        return knots, np.concatenate([points[:, :, 0], points[:, 3, 1:]], axis=1).T.copy()


def places_in(knots: Array) -> Array:
    """The parameters (k, S) of the places in spans with knots (6, S)."""
    return np.asarray(knots[2] + SHARES * (knots[3] - knots[2]))


def start_fit(table: CurveTable, rows: Index, knots: Sequence[Array], arcs: Array) -> Fit:
    """Least squares in both coordinates against the curves at these arc lengths, ends held: where iteration starts.

    `knots` (s + 7,) a spline, `arcs` (k, S).
    """
    index = SpanIndex.of(np.array([len(one) - 7 for one in knots]))
    begins = np.cumsum([0, *(len(one) for one in knots[:-1])])
    window = begins[index.owners] + index.ranks + 1 + np.arange(6)[:, None]
    near = np.concatenate(knots)[window]
    values = _basis_at(near)
    points, _ = table.read(rows[index.owners], arcs)
    begin, end = table.ends[:, :, rows]
    free = values.copy()
    free[0, :, index.firsts] = free[3, :, index.lasts] = 0.0
    held = values[0, :, None, index.firsts] * begin.T[:, None], values[3, :, None, index.lasts] * end.T[:, None]
    points[:, :, index.firsts] -= held[0].transpose(2, 1, 0)
    points[:, :, index.lasts] -= held[1].transpose(2, 1, 0)
    blocks = np.einsum("aks,bks->abs", free, free)[:, None, :, None]
    right = np.einsum("aks,cks->acs", free, points)[:, None]
    found = solve_spans(blocks, right, index, np.zeros(len(rows)))[:, 0].transpose(1, 0, 2).copy()
    found[:, 0, index.firsts], found[:, 3, index.lasts] = begin, end
    return measure(table, rows, index, near, found, arcs, steps=2)


def measure(
    table: CurveTable, rows: Index, index: SpanIndex, knots: Array, points: Array, arcs: Array, *, steps: int
) -> Fit:
    """The splines with the arc lengths moved to the feet of the places on the curves, (F5), and the distances there."""
    c0, c1, c2, c3 = _powers_of(knots, points)
    x = SHARES * (knots[3] - knots[2])
    places = c0 + x * (c1 + x * (c2 + x * c3))
    owners = rows[index.owners]
    longest = table.lengths_mm[owners]
    for _ in range(steps):
        on_curve, tangents = table.read(owners, arcs)
        gap = places - on_curve
        arcs = np.clip(arcs + gap[0] * tangents[0] + gap[1] * tangents[1], 0.0, longest)
    distance = gap[1] * tangents[0] - gap[0] * tangents[1]
    normals = np.stack([-tangents[1], tangents[0]])
    errors_mm = index.largest(np.abs(distance).max(axis=0))
    return Fit(index, errors_mm, knots, points, arcs, on_curve, normals, distance)


def step(table: CurveTable, rows: Index, fit: Fit, power: int, damping: Array) -> tuple[Fit, Array]:
    """One damped Gauss-Newton step on the sum of this power of the distances, and the new damping (p,)."""
    index = fit.index
    largest = np.maximum(fit.errors_mm, np.finfo(float).tiny)[index.owners]
    share = np.abs(fit.distance) / largest
    blocks, right = _normal_equations(linearise(fit), fit.distance, whole_power(share + 1e-3, power - 2))
    unknowns = solve_spans(blocks, right, index, damping)[:, :, 0] / (1.0 - power)
    knots, points = _move(fit, unknowns)
    moved = measure(table, rows, index, knots, points, fit.arcs, steps=2)
    before = index.total(whole_power(share, power).sum(axis=0))
    after = index.total(whole_power(np.abs(moved.distance) / largest, power).sum(axis=0))
    is_better = after < before
    kept = np.flatnonzero(~is_better)
    moved.put(kept, fit.take(kept))
    return moved, np.where(is_better, 0.2 * damping, 10.0 * damping)


def _normal_equations(jacobian: Array, distance: Array, weight: Array) -> tuple[Array, Array]:
    """Blocks (6, 3, 6, 3, S) and right sides (6, 3, 1, S) of every span, in windows of six groups (w, z, knot).

    Control point j shares a group with knot j + 2, so that the fourteen numbers of a span lie close together.
    """
    slots = np.concatenate([3 * np.arange(1, 5), 3 * np.arange(1, 5) + 1, 3 * np.arange(6) + 2])
    spans = jacobian.shape[2]
    blocks, right = np.zeros((18, 18, spans)), np.zeros((18, spans))
    for number, slot in enumerate(slots):
        weighted = weight * jacobian[number]
        products = np.einsum("aks,ks->as", jacobian[number:], weighted)
        blocks[slot, slots[number:]] = products
        blocks[slots[number:], slot] = products
        right[slot] = np.einsum("ks,ks->s", distance, weighted)
    return blocks.reshape(6, 3, 6, 3, spans), right.reshape(6, 3, 1, spans)


def _move(fit: Fit, step: Array) -> tuple[Array, Array]:
    """Knots and control points moved by unknowns (6, 3, S), less where an interval would halve or grow too narrow."""
    index, widths = fit.index, fit.knots[3] - fit.knots[2]
    growth = step[3, 2] - step[2, 2]
    floor = NARROWEST * (index.total(widths) / index.counts)[index.owners]
    room = np.clip(widths - floor, 0.0, 0.5 * widths)
    share = np.where(growth < -room, room / np.maximum(-growth, room + np.finfo(float).tiny), 1.0)
    least = -index.largest(-share)[index.owners]
    return fit.knots + least * step[:, 2], fit.points + least * step[1:5, :2].transpose(1, 0, 2)


def linearise(fit: Fit) -> Array:
    """Derivatives (14, k, S) of the distances by a span's control points' w, by their z, by its six knots.

    De Boor's scheme on the control points' own distances, then backwards through it for the derivatives, (F6), (F7).
    The held ends' are 0, and those of knots beside an interval at its narrowest.
    """
    near, at = fit.knots, places_in(fit.knots)
    fall, run = fit.normals
    on_curve = fit.on_curve[0] * fall + fit.on_curve[1] * run
    level = fit.points[0][:, None] * fall + fit.points[1][:, None] * run - on_curve
    shares, rates = [], []
    for depth in (1, 2, 3):
        narrow = 1.0 / (near[3 : 7 - depth] - near[depth - 1 : 3])[:, None]
        share, rise = (at - near[depth - 1 : 3, None]) * narrow, np.diff(level, axis=0)
        level = level[:-1] + share * rise
        shares.append(share)
        rates.append(rise * narrow)
    found = np.zeros((14, *at.shape))
    by_knot, by_point = found[8:], np.ones((1, *at.shape))
    for depth in (3, 2, 1):
        upper = by_point * shares[depth - 1]
        lower = by_point - upper
        by_knot[depth - 1 : 3] -= lower * rates[depth - 1]
        by_knot[3 : 7 - depth] -= upper * rates[depth - 1]
        by_point = np.empty((5 - depth, *at.shape))
        by_point[:-1], by_point[-1] = lower, 0.0
        by_point[1:] += upper
    found[0:4], found[4:8] = by_point * fall, by_point * run
    _hold(found, fit)
    return found


def _hold(jacobian: Array, fit: Fit) -> None:
    """No derivative where nothing may move: the ends, and knots that have no room left."""
    index = fit.index
    jacobian[[[0], [4]], :, index.firsts] = 0.0
    jacobian[[[3], [7]], :, index.lasts] = 0.0
    widths = fit.knots[3] - fit.knots[2]
    is_held = widths <= 1.05 * NARROWEST * (index.total(widths) / index.counts)[index.owners]
    # A knot lies between one span of the spline and the one after it.
    offset = np.arange(-3, 3)[:, None]
    is_inner = (index.ranks + offset >= 0) & (index.ranks + offset + 1 < index.counts[index.owners])
    before = np.where(is_inner, np.arange(len(widths)) + offset, 0)
    after = np.minimum(before + 1, len(widths) - 1)
    jacobian[8:] *= (is_inner & ~is_held[before] & ~is_held[after])[:, None]


def _powers_of(knots: Array, points: Array) -> tuple[Array, Array, Array, Array]:
    """Coefficients (2, 1, S) of rising powers from the start of every span, (F3)."""
    k0, k1, k2, k3, k4, _ = knots
    first = 3 * np.diff(points, axis=1) / (knots[3:6] - knots[0:3])
    second = 2 * np.diff(first, axis=1) / (knots[3:5] - knots[1:3])
    upper = (k2 - k1) / (k3 - k1)
    inner = points[:, 0] + (k2 - k0) / (k3 - k0) * (points[:, 1] - points[:, 0])
    outer = points[:, 1] + (k2 - k1) / (k4 - k1) * (points[:, 2] - points[:, 1])
    start = inner + upper * (outer - inner)
    slope = first[:, 0] + upper * (first[:, 1] - first[:, 0])
    third = (second[:, 1] - second[:, 0]) / (6 * (k3 - k2))
    return start[:, None], slope[:, None], second[:, :1] / 2, third[:, None]


def _basis_at(knots: Array) -> Array:
    """Values (4, k, S) of the four basis functions alive at the places of every span, (F1)."""
    near, at = knots[:, None], places_in(knots)
    values = np.ones((1, *at.shape))
    for degree in (1, 2, 3):
        low, high = near[3 - degree : 3], near[3 : 3 + degree]
        part = values / (high - low)
        values = np.zeros((degree + 1, *at.shape))
        values[:-1] += (high - at) * part
        values[1:] += (at - low) * part
    return values
