"""How far rounded numbers move a written path: bounds that hold everywhere along it, not only at the ends of spans.

A point of the written curve is compared with the exact curve a little further on where rounding only slid it along:
that slide is no deviation of the path. At the two ends of a pass nothing may slide.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from planner.path.model import Array

_PIECES = 4
_LONGEST_SLIDE = 0.5  # of a span
_POWERS = np.arange(4)
_NODES = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0])


def _bezier_of_pieces(degree: int) -> Array:
    """Matrix (4 (degree + 1), degree + 1) from power coefficients on [0, 1] to Bezier points of four equal pieces."""
    order = range(degree + 1)
    to_bezier = np.array([[comb(j, k) / comb(degree, k) for k in order] for j in order])
    rows = []
    for piece in range(_PIECES):
        start, width = piece / _PIECES, 1.0 / _PIECES
        shift = np.array([[comb(k, j) * start ** max(k - j, 0) * width**j for k in order] for j in order])
        rows.append(to_bezier @ shift)
    return np.concatenate(rows)


_TO_BEZIER = {degree: _bezier_of_pieces(degree) for degree in (3, 5)}
_VALUES = _NODES[:, None] ** _POWERS
_INTERPOLATE = np.linalg.inv(_VALUES)
_TAYLOR_AT_END = np.array([[comb(k, order) for k in range(4)] for order in range(4)], dtype=np.float64)


def curve_bound_mm(coefficients: Array) -> Array:
    """Upper bound (m,) of |e(p)|, p in [0, 1], for error curves e of degree 3 or 5, (m, degree + 1, axes), in mm.

    A curve lies in the convex hull of its Bezier points, here those of four equal pieces.
    """
    hull = np.einsum("bk,mkd->mbd", _TO_BEZIER[coefficients.shape[1] - 1], coefficients)
    return np.asarray(np.sqrt((hull**2).sum(axis=2).max(axis=1)))


@dataclass(frozen=True, slots=True)
class SpanChain:
    """The exact spans of one or more passes, with what every bound over them needs again.

    `power` (m, 4, 3) are coefficients of p^k on [0, 1], mm; `is_first` and `is_last` (m,) mark the ends of passes;
    `slope` (m, 3, 3) is the derivative, `pull` (m, 4, 3) its values over their squares at four parameters, `bend` and
    `third` (m,) bound the second and third derivative, `jump` (m, 3) are the sizes of the differences |D_k| of a span's
    polynomial and its predecessor's at their joint, `ratio` (m,) the span's knot length over its predecessor's.
    """

    power: Array
    is_first: NDArray[np.bool_]
    is_last: NDArray[np.bool_]
    slope: Array
    pull: Array
    bend: Array
    third: Array
    jump: Array
    ratio: Array

    @classmethod
    def of(cls, power: Array, lengths: Array, is_first: NDArray[np.bool_], is_last: NDArray[np.bool_]) -> SpanChain:
        """From coefficients (m, 4, 3), knot lengths (m,) and the marks of first and last spans."""
        slope = (power * _POWERS[None, :, None])[:, 1:]
        tangents = np.einsum("nk,mkd->mnd", _VALUES[:, :3], slope)
        square = (tangents**2).sum(axis=2)[:, :, None]
        pull = np.where(square > 0.0, tangents / np.where(square > 0.0, square, 1.0), 0.0)
        pull[is_first, 0] = 0.0
        pull[is_last, -1] = 0.0
        second, third = 2.0 * power[:, 2], 6.0 * power[:, 3]
        bend = np.maximum(np.linalg.norm(second, axis=1), np.linalg.norm(second + third, axis=1))
        ratio = lengths / np.roll(lengths, 1)
        before = np.einsum("jk,mkd->mjd", _TAYLOR_AT_END, np.roll(power, 1, axis=0))
        jump = np.linalg.norm(power - before * ratio[:, None, None] ** _POWERS[None, :, None], axis=2)[:, 1:]
        jump[is_first] = 0.0
        return cls(power, is_first, is_last, slope, pull, bend, np.linalg.norm(third, axis=1), jump, ratio)


def path_bound_mm(exact: SpanChain, written: Array) -> Array:
    """Upper bound (m,) of the distance between each written span (m, 4, 3) and the exact curve, both ways, mm.

    W(p) = C(p) + e(p) is compared with C(p + s(p)); the slide s is the cubic through e . C1 / |C1|^2 at four parameters
    (C1, C2, C3: derivatives), 0 at the ends of a pass and equal on both sides of a joint, so the match covers the whole
    curve. By Taylor, |W - C(p + s)| <= |e - C1 s| + max |C2| s^2 / 2 + |C3| |s|^3 / 6, the first term bounded by its
    hull; where the match runs over the end of a span, the difference of the two polynomials there is added. A pass
    where a slide is longer than half a span or half its neighbour is bounded without sliding.
    """
    error = written - exact.power
    at_nodes = (np.einsum("nk,mkd->mnd", _VALUES, error) * exact.pull).sum(axis=2)
    slide = at_nodes @ _INTERPOLATE.T
    across = np.zeros((len(error), 6, error.shape[2]))
    across[:, :4] = error
    for power in range(3):
        across[:, power : power + 4] -= exact.slope[:, power, None, :] * slide[:, :, None]
    reach = curve_bound_mm(slide[:, :, None])
    remainder = exact.bend * reach**2 / 2.0 + exact.third * reach**3 / 6.0
    slid_mm = curve_bound_mm(across) + remainder + _overrun_mm(exact, reach)
    return np.where(_slides_far(exact, reach), curve_bound_mm(error), slid_mm)


def _slides_far(exact: SpanChain, reach: Array) -> NDArray[np.bool_]:
    """For every span (m,), whether any slide of its pass is too long for the argument of `path_bound_mm`."""
    into_before = np.where(exact.is_first, 0.0, reach * exact.ratio)
    into_after = np.where(exact.is_last, 0.0, reach / np.roll(exact.ratio, -1))
    is_far = np.maximum(reach, np.maximum(into_before, into_after)) > _LONGEST_SLIDE
    starts = np.flatnonzero(exact.is_first)
    lengths = np.diff(np.append(starts, len(reach)))
    return np.repeat(np.logical_or.reduceat(is_far, starts), lengths)


def _overrun_mm(exact: SpanChain, reach: Array) -> Array:
    """How far a span's polynomial and its neighbours' differ within `reach` (m,) beyond the span: sum |D_k| reach^k."""
    widest = np.maximum(reach, np.roll(reach, 1) / exact.ratio)
    total = ((exact.jump[:, 2] * widest + exact.jump[:, 1]) * widest + exact.jump[:, 0]) * widest
    return np.maximum(total, np.where(exact.is_last, 0.0, np.roll(total, -1)))


def poly_power(start: Array, end: Array, square: Array, cube: Array) -> Array:
    """Coefficients (m, 4, 3) of POLY spans from what the blocks say, all (m, 3): the control finds the linear one."""
    return np.stack([start, end - start - square - cube, square, cube], axis=1)


def polyline_bound_mm(exact: Array, written: Array) -> float:
    """Upper bound of the distance between two polylines with vertices (n, 3) in pairs, mm; ends may not slide.

    Along a segment the offset across it is linear, so its ends bound it; where a vertex slid past its corner, the slide
    times the sine of the corner's angle is added.
    """
    error = written - exact
    legs = np.diff(exact, axis=0)
    lengths = np.sqrt((legs**2).sum(axis=1))[:, None]
    units = legs / np.where(lengths == 0.0, 1.0, lengths)
    along_before, along_after = (error[1:] * units).sum(axis=1), (error[:-1] * units).sum(axis=1)
    across_before = np.linalg.norm(error[1:] - along_before[:, None] * units, axis=1)
    across_after = np.linalg.norm(error[:-1] - along_after[:, None] * units, axis=1)
    sine = np.linalg.norm(np.cross(units[:-1], units[1:]), axis=1)
    slide = np.maximum(np.abs(along_before[:-1]), np.abs(along_after[1:]))
    inner = np.maximum(across_before[:-1], across_after[1:]) + slide * sine
    ends = np.linalg.norm(error[[0, -1]], axis=1)
    return float(max(inner.max(initial=0.0), ends.max()))
