"""Quintics z(w) fitted to many curves at once: in every joint the place, height, slope and second derivative move.

Gauss-Newton on the distance, batched: one row a curve, all rows' spans end to end. Two neighbouring spans share what
their joint says, so the fit bends without a jump. Equations (F18) to (F20) of EQUATIONS-fitting.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.path.arc_length import quintic_coefficients
from planner.path.gauss_newton import whole_power
from planner.path.height_table import HeightTable
from planner.path.model import Array, PlaneSpline
from planner.path.plane_spline import Index
from planner.path.span_batch import SpanFits, SpanIndex, solve_spans

PLACES = 14
SHARES = ((1.0 - np.cos(np.pi * (np.arange(PLACES) + 0.5) / PLACES)) / 2.0)[:, None]
WIDEST_CHANGE = 0.4  # of a span, in one step
STIFFNESS = 30.0
_UNIT = np.eye(6).reshape(2, 3, 6)
_POWERS = quintic_coefficients(_UNIT[0], _UNIT[1])
SHAPES = np.asarray(SHARES ** np.arange(6) @ _POWERS).T.reshape(2, 3, PLACES, 1)


@dataclass(frozen=True, slots=True)
class HeightFit(SpanFits):
    """Quintics of a batch, span by span, and how far they are from their curves.

    `joints` (2, S) are the places w of both ends of every span, `values` (2, 3, S) height, slope and second derivative
    there; `distance` (k, S) is across the curve at the places of the spans, where `lean` (k, S) is the cosine of the
    curve's angle.
    """

    joints: Array
    values: Array
    distance: Array
    lean: Array

    def joints_of(self, row: int) -> Array:
        """The joints (n + 1,) of one row."""
        spans = slice(self.index.firsts[row], self.index.lasts[row] + 1)
        return np.append(self.joints[0, spans], self.joints[1, self.index.lasts[row]])

    def spline(self, row: int) -> PlaneSpline:
        """One row as a B-spline of degree 5 with triple knots inside, its parameter w."""
        spans = slice(self.index.firsts[row], self.index.lasts[row] + 1)
        joints, width = self.joints[:, spans], np.diff(self.joints[:, spans], axis=0)[0]
        values = self.values[:, :, spans]
        left = np.stack([joints[0], joints[0] + width / 5, joints[0] + 2 * width / 5])
        right = np.stack([joints[1] - 2 * width / 5, joints[1] - width / 5, joints[1]])
        heights = np.concatenate([_bezier_half(values[0], width), _bezier_half(values[1], -width)[::-1]])
        bezier = np.stack([np.concatenate([left, right]), heights], axis=2)
        ratio = (width[:-1] / width[1:])[:, None]
        at_joint = (1.0 + ratio) * bezier[1, 1:] - ratio * bezier[2, 1:]
        inner = np.stack([bezier[3, :-1], at_joint, bezier[2, 1:]], axis=1).reshape(-1, 2)
        knots = np.concatenate([np.repeat(joints[0, 0], 6), np.repeat(joints[0, 1:], 3), np.repeat(joints[1, -1], 6)])
        return PlaneSpline(5, knots, np.concatenate([bezier[:3, 0], inner, bezier[3:, -1]]))


def _bezier_half(values: Array, width: Array) -> Array:
    """The three Bezier heights (3, S) next to an end with these values (3, S), the span reaching `width` from it."""
    height, slope, bend = values
    return np.stack([height, height + width * slope / 5, height + 2 * width * slope / 5 + width**2 * bend / 20])


def start_heights(table: HeightTable, rows: Index, joints: Sequence[Array]) -> HeightFit:
    """The quintics that agree with their curves at these joints (n + 1,): where iteration starts."""
    index = SpanIndex.of(np.array([len(one) - 1 for one in joints]))
    sides = np.stack([np.concatenate([one[:-1] for one in joints]), np.concatenate([one[1:] for one in joints])])
    values = np.stack(table.read(rows[index.owners], sides), axis=1)
    return measure(table, rows, index, sides, values)


def measure(table: HeightTable, rows: Index, index: SpanIndex, joints: Array, values: Array) -> HeightFit:
    """These quintics with their distances at the places, (F18)."""
    width = joints[1] - joints[0]
    height, slope, _ = table.read(rows[index.owners], joints[0] + SHARES * width)
    found = (SHAPES * _scaled(values, width)[:, :, None]).sum(axis=(0, 1))
    lean = 1.0 / np.sqrt(1.0 + slope**2)
    distance = (found - height) * lean
    return HeightFit(index, index.largest(np.abs(distance).max(axis=0)), joints, values, distance, lean)


def _scaled(values: Array, width: Array) -> Array:
    """Derivatives (2, 3, S) by w as derivatives by the share of a span."""
    return np.asarray(values * width ** np.arange(3)[:, None])


def step(table: HeightTable, rows: Index, fit: HeightFit, power: int, damping: Array) -> tuple[HeightFit, Array]:
    """One damped Gauss-Newton step on the sum of this power of the distances, and the new damping (p,), (F20).

    A step that raises its own sum is dropped.
    """
    index = fit.index
    largest = np.maximum(fit.errors_mm, np.finfo(float).tiny)[index.owners]
    share = np.abs(fit.distance) / largest
    thirds = _third_derivatives(fit)
    jacobian, scale = _linearise(fit, thirds)
    weight = whole_power(share + 1e-3, power - 2)
    blocks, right = _normal_equations(jacobian, fit.distance, weight)
    # A joint hardly matters where two quintics nearly agree; without this it would jump about.
    stiff = STIFFNESS * (index.total((weight * fit.distance**2).sum(axis=0)) / index.counts)[index.owners]
    blocks[0, 3, 0, 3] += stiff
    blocks[1, 3, 1, 3] += stiff
    unknowns = solve_spans(blocks, right, index, damping)[:, :, 0] * scale / (1.0 - power)
    moved = measure(table, rows, index, *_move(fit, thirds.mean(axis=0), unknowns))
    before = index.total(whole_power(share, power).sum(axis=0))
    after = index.total(whole_power(np.abs(moved.distance) / largest, power).sum(axis=0))
    is_better = after < before
    kept = np.flatnonzero(~is_better)
    moved.put(kept, fit.take(kept))
    return moved, np.where(is_better, 0.2 * damping, 10.0 * damping)


def _third_derivatives(fit: HeightFit) -> Array:
    """Third derivatives (2, 2, S) at both ends of every span: of the span itself, and of its neighbour there.

    Beyond the ends of a pass the neighbour is the span itself.
    """
    index, width = fit.index, fit.joints[1] - fit.joints[0]
    c3, c4, c5 = quintic_coefficients(*_scaled(fit.values, width))[3:]
    own = np.stack([6 * c3, 6 * c3 + 24 * c4 + 60 * c5]) / width**3
    other = np.stack([np.roll(own[1], 1), np.roll(own[0], -1)])
    other[0, index.firsts], other[1, index.lasts] = own[0, index.firsts], own[1, index.lasts]
    return np.stack([own, other])


def _linearise(fit: HeightFit, thirds: Array) -> tuple[Array, Array]:
    """Derivatives (2, 4, k, S) of the distances by height, slope, second derivative and place of both joints, (F19).

    In units (4, S) that make them alike. A joint moves along the mean of the two quintics that meet there. The held
    ends' are 0.
    """
    index, width = fit.index, fit.joints[1] - fit.joints[0]
    mean = (index.total(width) / index.counts)[index.owners]
    by_value = SHAPES * _scaled(np.ones((2, 3, 1)), width)[:, :, None] * fit.lean
    by_place = by_value[:, 2] * (thirds.mean(axis=0) - thirds[0])[:, None]
    found = np.concatenate([by_value, by_place[:, None]], axis=1)
    for side, ends in ((0, index.firsts), (1, index.lasts)):
        found[side, [[0], [3]], :, ends] = 0.0
    scale = np.stack([np.ones_like(mean), 5.0 / mean, 20.0 / mean**2, mean])
    return found * scale[:, None], scale


def _normal_equations(jacobian: Array, distance: Array, weight: Array) -> tuple[Array, Array]:
    """Blocks (2, 4, 2, 4, S) and right sides (2, 4, 1, S) of every span."""
    flat = jacobian.reshape(8, *jacobian.shape[2:])
    blocks, right = np.empty((8, 8, flat.shape[2])), np.empty((8, flat.shape[2]))
    for number in range(8):
        weighted = weight * flat[number]
        products = np.einsum("aks,ks->as", flat[number:], weighted)
        blocks[number, number:] = blocks[number:, number] = products
        right[number] = np.einsum("ks,ks->s", distance, weighted)
    return blocks.reshape(2, 4, 2, 4, -1), right.reshape(2, 4, 1, -1)


def _move(fit: HeightFit, thirds: Array, unknowns: Array) -> tuple[Array, Array]:
    """Joints (2, S) and values (2, 3, S) moved by unknowns (2, 4, S), less where a span would change too much."""
    width = fit.joints[1] - fit.joints[0]
    growth = np.abs(unknowns[1, 3] - unknowns[0, 3])
    share = WIDEST_CHANGE * width / np.maximum(growth, WIDEST_CHANGE * width)
    least = -fit.index.largest(-share)[fit.index.owners]
    height, slope, bend = fit.values.transpose(1, 0, 2)
    change = least * unknowns
    on = change[:, 3]
    carried = [
        height + on * (slope + on * (bend / 2 + on * thirds / 6)),
        slope + on * (bend + on * thirds / 2),
        bend + on * thirds,
    ]
    return fit.joints + on, np.stack(carried, axis=1) + change[:, :3]
