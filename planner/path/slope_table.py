"""Enclosures, cell by cell of a patch, of how fast passes across it bend: equation (F14) in ranges.

For every cell: the least and largest d(curvature)/d(arc length) that any pass y = const through the cell can have
there, and the same for its curvature itself and for its parameters' speeds u' and v'.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from math import comb

import numpy as np

from planner.path.interval import Range, cross, dot, stack
from planner.path.model import Array
from planner.path.offset import OffsetSurface
from planner.path.plane_spline import Index
from planner.surface.bspline import SpanBasis
from planner.surface.creases import largest_turn_rad

FEW_CELLS, MOST_CELLS = 4000, 100_000
CELLS_AT_ONCE = 20_000
TURN_SPARE = 1.5  # times the largest turn at a crease that is seen
TABLES_KEPT = 8  # all cells of one patch, from coarse to fine, and those of a few of its passes


@dataclass(frozen=True, slots=True)
class SlopeTable:
    """Cells between `u_edges` (i + 1,) and `v_edges` (j + 1,), with ranges over each.

    `slope` and `bend` (i, j) are those of the curvature's change and of the curvature, `speeds` (2, i, j) those of u
    and v. `u_breaks` (i + 1,) and `v_breaks` (j + 1,) tell how many edges up to each are knots across which second
    derivatives may jump, and the curvature with them. `turn_rad` is how far a pass may turn at once in crossing one.
    """

    u_edges: Array
    v_edges: Array
    slope: Range
    bend: Range
    speeds: Range
    u_breaks: Index
    v_breaks: Index
    turn_rad: float

    @property
    def cells(self) -> int:
        """How many cells there are."""
        return self.slope.low.size

    def over(self, what: Range, low: Array, high: Array) -> Range:
        """The range (..., k) of `what` (..., i, j) over boxes from low (2, k) to high (2, k) of (u, v).

        All numbers for boxes that reach beyond the cells.
        """
        first, last = self._cells_of(low, high)
        shape = self.slope.low.shape
        is_inside = (first[0] >= 0) & (first[1] >= 0) & (last[0] < shape[0]) & (last[1] < shape[1])
        found = (*what.low.shape[:-2], low.shape[1])
        least, most = np.full(found, np.inf), np.full(found, -np.inf)
        # Four blocks of 2^a by 2^b cells, which may overlap, cover a box whatever its size.
        counts = np.array(last) - first + 1
        sizes = 64 * (np.frexp(counts[0])[1] - 1) + np.frexp(counts[1])[1] - 1
        is_read = is_inside & (counts > 0).all(axis=0)
        for size in np.flatnonzero(np.bincount(sizes[is_read])).tolist():
            a, b = divmod(size, 64)
            blocks = _in_blocks(what, a, b)
            at = np.flatnonzero(is_read & (sizes == size))
            for i in (first[0][at], last[0][at] + 1 - 2**a):
                for j in (first[1][at], last[1][at] + 1 - 2**b):
                    least[..., at] = np.minimum(least[..., at], blocks.low[..., i, j])
                    most[..., at] = np.maximum(most[..., at], blocks.high[..., i, j])
        return Range(np.where(is_inside, least, -np.inf), np.where(is_inside, most, np.inf))

    def jumps(self, low: Array, high: Array, width_mm: Array) -> Array:
        """How far the curvature may jump (k,) within boxes from low (2, k) to high (2, k): 0 where nothing does, (F23).

        However often a curve crosses a knot there, its curvature stays in the range of the box. A crease counts as much
        as a curvature that turns the curve as far on half of `width_mm` (k,).
        """
        first, last = self._cells_of(low, high)
        crosses = np.zeros(low.shape[1], dtype=bool)
        for axis, breaks in ((0, self.u_breaks), (1, self.v_breaks)):
            begin, end = (np.clip(cell, 0, len(breaks) - 1) for cell in (first[axis], last[axis]))
            crosses |= breaks[end] > breaks[begin]
        jumps, at = np.zeros(low.shape[1]), np.flatnonzero(crosses)
        bend = self.over(self.bend, low[:, at], high[:, at])
        jumps[at] = bend.high - bend.low + 2 * self.turn_rad / width_mm[at]
        return jumps

    def _cells_of(self, low: Array, high: Array) -> tuple[list[Index], list[Index]]:
        """The first and the last cell (k,) that each box touches, along u and along v."""
        first, last = [], []
        for axis, edges in ((0, self.u_edges), (1, self.v_edges)):
            first.append(np.searchsorted(edges, low[axis], side="left") - 1)
            last.append(np.searchsorted(edges, high[axis], side="right") - 1)
        return first, last


def _in_blocks(what: Range, a: int, b: int) -> Range:
    """The range over the 2^a by 2^b cells that begin at each cell, for all cells where so many are left."""
    low, high = what.low, what.high
    for axis, power in ((-2, a), (-1, b)):
        for half in 2 ** np.arange(power):
            low, high = np.moveaxis(low, axis, 0), np.moveaxis(high, axis, 0)
            low, high = np.minimum(low[:-half], low[half:]), np.maximum(high[:-half], high[half:])
            low, high = np.moveaxis(low, 0, axis), np.moveaxis(high, 0, axis)
    return Range(low, high)


def slope_table(surface: OffsetSurface, finer: int = 1, reach: tuple[Array, Array] | None = None) -> SlopeTable:
    """The table of a patch, its end polynomials carried on by a cell at least on every side.

    Its cells are `finer` times as narrow as those that serve gentle patches. They cover all (u, v) from the first to
    the second of `reach`, (2,) each. Tables are kept for a while: every way of writing the same passes asks for them.
    """
    low, high = reach or np.array(surface.patch.domain).T
    return _table(surface, finer, tuple(low.tolist()), tuple(high.tolist()))


@lru_cache(maxsize=TABLES_KEPT)
def _table(surface: OffsetSurface, finer: int, low: tuple[float, ...], high: tuple[float, ...]) -> SlopeTable:
    """`slope_table` from `low` to `high`."""
    patch = surface.patch
    spans = len(patch.basis_u.starts) * len(patch.basis_v.starts)
    a_span = finer * int(np.clip(np.sqrt(FEW_CELLS / spans), 1, 24))
    in_u, in_v = (
        _cells(basis, a_span, low[axis], high[axis]) for axis, basis in enumerate((patch.basis_u, patch.basis_v))
    )
    reach_u = patch.basis_u.first[in_u.span][:, None] + np.arange(patch.degree_u + 1)
    reach_v = patch.basis_v.first[in_v.span][:, None] + np.arange(patch.degree_v + 1)
    points = patch.control_points
    if patch.weights is not None:
        points = np.concatenate([points * patch.weights[..., None], patch.weights[..., None]], axis=2)
    half = np.einsum("cia,cad->cid", in_u.weights, points[reach_u].reshape(*reach_u.shape, -1))
    half = half.reshape(len(reach_u), patch.degree_u + 1, *points.shape[1:])
    strips = []
    for strip in np.array_split(np.arange(len(half)), -(-len(half) * len(reach_v) // CELLS_AT_ONCE)):
        nets = np.einsum("ejb,ciebd->ijdce", in_v.weights, half[strip][:, :, reach_v]).copy()
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            strips.append(_bend_rates(surface, nets, in_u.widths[strip, None], in_v.widths[None, :]))
    slope, bend, speeds = (_widened(_joined(parts)) for parts in zip(*strips, strict=True))
    u_breaks = _breaks(in_u.edges, patch.knots_u, patch.degree_u)
    v_breaks = _breaks(in_v.edges, patch.knots_v, patch.degree_v)
    turn_rad = TURN_SPARE * largest_turn_rad(patch)
    return SlopeTable(in_u.edges, in_v.edges, slope, bend, speeds, u_breaks, v_breaks, turn_rad)


def _breaks(edges: Array, knots: Array, degree: int) -> Index:
    """How many edges up to each are knots that leave second derivatives free to jump."""
    inner = knots[(knots > knots[degree]) & (knots < knots[-degree - 1])]
    values, repeats = np.unique(inner, return_counts=True)
    return np.cumsum(np.isin(edges, values[repeats >= degree - 1]))


@dataclass(frozen=True, slots=True)
class _Cells:
    """Cells of one direction: `edges` (c + 1,), the `span` each lies on, `weights` (c, i, a) of the span's control
    points a in the cell's own Bernstein points i, and its `widths`.
    """

    edges: Array
    span: Index
    weights: Array

    @property
    def widths(self) -> Array:
        """Width of each cell."""
        return np.diff(self.edges)


def _cells(basis: SpanBasis, a_span: int, low: float, high: float) -> _Cells:
    """So many cells a span, and as many beyond both ends as it takes to cover all from `low` to `high`."""
    first, last = basis.widths[[0, -1]] / a_span
    before = max(1, int(np.ceil((basis.low - low) / first)))
    after = max(1, int(np.ceil((high - basis.high) / last)))
    spans = np.arange(len(basis.starts))
    shares = np.arange(a_span) / a_span
    inner = (basis.starts[:, None] + basis.widths[:, None] * shares).ravel()
    outside = basis.low - np.arange(before, 0, -1) * first, basis.high + np.arange(1, after + 1) * last
    edges = np.concatenate([outside[0], inner, [basis.high], outside[1]])
    span = np.concatenate([np.zeros(before, np.intp), np.repeat(spans, a_span), np.full(after, spans[-1])])
    from_ = (edges[:-1] - basis.starts[span]) / basis.widths[span]
    size = np.diff(edges) / basis.widths[span]
    degree = basis.degree
    moved = np.zeros((len(span), degree + 1, degree + 1))
    for i in range(degree + 1):
        for k in range(i + 1):
            moved[:, k, i] = comb(i, k) * from_ ** (i - k) * size**k
    bernstein = np.array([[comb(j, k) / comb(degree, k) for k in range(degree + 1)] for j in range(degree + 1)])
    return _Cells(edges, span, np.einsum("jk,cki,cai->cja", bernstein, moved, basis.powers[span]))


def _derivative(nets: Array, by_u: int, by_v: int, u_width: Array, v_width: Array) -> Range:
    """The range (d, c, e) of a derivative, from the Bernstein points (p + 1, q + 1, d, c, e) of the cells."""
    scale = 1.0 / (u_width**by_u * v_width**by_v)
    for axis in [0] * by_u + [1] * by_v:
        scale = (nets.shape[axis] - 1) * scale
        nets = np.diff(nets, axis=axis)
    if 0 in nets.shape:
        zero = np.zeros(nets.shape[2:])
        return Range(zero, zero)
    return Range(scale * nets.min(axis=(0, 1)), scale * nets.max(axis=(0, 1)))


def _rational(nets: Array, u_width: Array, v_width: Array) -> Callable[[int, int], Range]:
    """Ranges (3, c, e) of the derivatives of A / w, from the Bernstein points of (A, w), by Leibniz's rule, (F14).

    The origin is moved into every cell, where A / w is then small beside its derivatives.
    """
    middle = nets.mean(axis=(0, 1))
    moved = nets.copy()
    moved[:, :, :3] -= middle[:3] / middle[3] * nets[:, :, 3:]
    over_weight = _derivative(moved, 0, 0, u_width, v_width).part(3).inverse()

    @cache
    def of(by_u: int, by_v: int) -> Range:
        whole = _derivative(moved, by_u, by_v, u_width, v_width)
        rest = Range(whole.low[:3], whole.high[:3])
        for i in range(by_u + 1):
            for j in range(by_v + 1):
                if i or j:
                    weight = _derivative(moved, i, j, u_width, v_width).part(3)
                    rest = rest - (weight * of(by_u - i, by_v - j)).times(comb(by_u, i) * comb(by_v, j))
        return rest * over_weight

    return of


def _bend_rates(surface: OffsetSurface, nets: Array, u_width: Array, v_width: Array) -> tuple[Range, Range, Range]:
    """d(curvature)/ds (c, e), curvature (c, e) and speeds u', v' (2, c, e) of passes through each cell, (F14)."""

    def polynomial(by_u: int, by_v: int) -> Range:
        return _derivative(nets, by_u, by_v, u_width, v_width)

    of = polynomial if surface.patch.weights is None else _rational(nets, u_width, v_width)
    reach = surface.radius_mm + surface.stock_mm
    q_u, q_v, q_uu, q_uv, q_vv = of(1, 0), of(0, 1), of(2, 0), of(1, 1), of(0, 2)
    long = cross(q_u, q_v).times(surface.side)
    shrink = Range(*(np.sum(end, axis=0) for end in _ends(long.square()))).root().inverse()
    normal = _clipped(long * shrink)
    turns = []
    for bent in (cross(q_uu, q_v) + cross(q_u, q_uv), cross(q_uv, q_v) + cross(q_u, q_vv)):
        bent = bent.times(surface.side)
        turns.append((bent - dot(bent, normal) * normal) * shrink)
    c_u, c_v = q_u + turns[0].times(reach), q_v + turns[1].times(reach)
    flat = (Range(np.ones_like(normal.low[1]), np.ones_like(normal.low[1])) - normal.part(1).square()).root()
    spread = flat.inverse()
    cosine = _clipped(normal.part(2) * spread)
    scale = (c_u.part(0) * c_v.part(1) - c_u.part(1) * c_v.part(0)).inverse() * cosine
    u, v = c_v.part(1) * scale, (c_u.part(1) * scale).times(-1.0)
    normal_s = u * turns[0] + v * turns[1]
    sine = _clipped((normal.part(0) * spread).times(-1.0))
    bend = (normal_s.part(0) * cosine + normal_s.part(2) * sine).times(-1.0) * spread
    q_pp = u.square() * q_uu + (u * v * q_uv).times(2.0) + v.square() * q_vv
    q_ppp = u * u.square() * of(3, 0) + v * v.square() * of(0, 3)
    q_ppp = q_ppp + (u.square() * v * of(2, 1)).times(3.0) + (u * v.square() * of(1, 2)).times(3.0)
    slope = (dot(normal, q_ppp) + dot(normal_s, q_pp).times(3.0)) * spread
    slope = slope + (bend * normal.part(1) * normal_s.part(1)).times(3.0) * spread.square()
    return slope, bend, stack([u, v])


def _joined(strips: Sequence[Range]) -> Range:
    """Ranges of strips of cells that lie side by side along u."""
    return Range(*(np.concatenate(ends, axis=-2) for ends in zip(*map(_ends, strips), strict=True)))


def _ends(values: Range) -> tuple[Array, Array]:
    return values.low, values.high


def _clipped(values: Range) -> Range:
    """Components of unit vectors."""
    return Range(np.maximum(values.low, -1.0), np.minimum(values.high, 1.0))


def _widened(values: Range) -> Range:
    """Wider by far more than the rounding of doubles; all numbers where the arithmetic broke down."""
    slack = 1e-9 * np.maximum(np.abs(values.low), np.abs(values.high)) + 1e-15
    low, high = values.low - slack, values.high + slack
    return Range(np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high))
