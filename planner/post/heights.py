"""Passes that are heights of degree 5 as POLY blocks: X and Y run evenly to their end, PO[Z]=(end, a2, a3, a4, a5).

Joints slide along the pass to places with few digits, for a span's polynomial says itself what it is between others.
What rounding a coefficient leaves is taken back by the lower ones: p^k is nearly a polynomial of less degree on [0, 1].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from planner.gcode.words import decimal_text
from planner.path.model import Array, Pass, PlaneSpline
from planner.path.spans import bezier_points, in_work, joints_of, power_form
from planner.post.digits import Digits, fewest_digits
from planner.post.numbers import rounded_mm, to_units
from planner.post.passtext import AXES, PassText, Point, is_constant
from planner.post.rounding import curve_bound_mm

DEGREE = 5
_POWERS = np.arange(DEGREE + 1)
_LONGEST_SLIDE = 0.5  # of a span
_MOST_MARGIN = 2
# columns of the search: X and Y, the end of Z, then its coefficients from the square on
_PLACE, _END, _SQUARE = 0, 1, 2


def _nearest_lower(degree: int) -> Array:
    """Coefficients (degree,) of the polynomial of less degree nearest to p^degree on [0, 1], equal at 0 and 1.

    What is left is a Chebyshev polynomial stretched until its outermost zeros are 0 and 1.
    """
    reach = np.cos(np.pi / (2 * degree))
    in_place = np.polynomial.Polynomial([-reach, 2.0 * reach])
    left = np.polynomial.Chebyshev.basis(degree)(in_place).coef
    return np.asarray(-left[:-1] / left[-1])


_AT_END = np.array([[comb(j, k) for j in range(DEGREE + 1)] for k in range(DEGREE + 1)], dtype=np.float64)
_LOWER = {degree: _nearest_lower(degree) for degree in range(2, DEGREE + 1)}


@dataclass(frozen=True, slots=True)
class _Chain:
    """All passes' spans: heights by p on [0, 1] (m, 6) between the joints `begin` and `end` (m, 3) in work coordinates.

    `along` and `across` (m, 2) are the pass's direction and normal in XY, `is_still` (m, 2) the axes it does not move;
    `jumps` (m, 6) the sizes of the differences, by rising powers of mm from the joint, between a span's polynomial and
    the one before it.
    """

    heights: Array
    begin: Array
    end: Array
    along: Array
    across: Array
    is_still: NDArray[np.bool_]
    jumps: Array
    owner: NDArray[np.int64]
    is_first: NDArray[np.bool_]
    is_last: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class _Numbers:
    """What the blocks say: joints (m, 3) and coefficients a2 to a5 (m, 4), with their decimals; bounds (m,), mm."""

    begin: Array
    end: Array
    end_decimals: Digits
    powers: Array
    power_decimals: Digits
    bounds_mm: Array


def is_heights(one: Pass) -> bool:
    """Whether a pass is of the kind this file writes."""
    return isinstance(one.shape, PlaneSpline) and one.shape.degree == DEGREE


def heights_passes(
    passes: Sequence[Pass], drop_z_mm: float, budgets_mm: Array, fine: Digits, most_decimals: int
) -> list[PassText]:
    """Every pass as POLY blocks of degree 5 with the fewest digits that keep its path within `budgets_mm`.

    `fine` (passes,) are the decimals of the ends of passes and of axes that stand still; `most_decimals` what the
    control reads.
    """
    if not passes:
        return []
    chain = _chain_of(passes, drop_z_mm)
    starts = np.flatnonzero(chain.is_first)
    columns = _SQUARE + DEGREE - 1
    uses = np.array([1.0, 1.3, 1.2, 1.1, 1.0, 0.9])
    least, most = (np.tile(np.minimum(fine + margin, most_decimals)[:, None], columns) for margin in (0, _MOST_MARGIN))

    def bound_mm(digits: Digits) -> Array:
        return np.maximum.reduceat(_numbers(chain, digits, fine).bounds_mm, starts)

    digits, bounds = fewest_digits(least, most, uses, bound_mm, budgets_mm)
    numbers = _numbers(chain, digits, fine)
    stops = [*starts[1:].tolist(), len(chain.owner)]
    return [
        _pass_text(numbers, slice(begin, stop), finest, bound)
        for begin, stop, finest, bound in zip(starts.tolist(), stops, fine.tolist(), bounds.tolist(), strict=True)
    ]


def _chain_of(passes: Sequence[Pass], drop_z_mm: float) -> _Chain:
    splines = [one.shape for one in passes if isinstance(one.shape, PlaneSpline)]
    bezier = bezier_points(splines)
    heights = power_form(bezier[:, :, 1:])[:, :, 0]
    heights[:, 0] -= drop_z_mm
    counts = [len(joints_of(spline)) - 1 for spline in splines]
    lasts = np.cumsum(counts)
    parts = np.split(bezier[:, [0, -1]], lasts[:-1])
    ends = np.concatenate([in_work(one.plane, part, drop_z_mm) for one, part in zip(passes, parts, strict=True)])
    is_first, is_last = np.zeros((2, len(bezier)), dtype=bool)
    is_last[lasts - 1] = True
    is_first[lasts - counts] = True
    owner = np.repeat(np.arange(len(passes)), counts)
    along = np.array([one.plane.direction[:2] for one in passes])[owner]
    across = np.array([one.plane.normal[:2] for one in passes])[owner]
    still = np.array([is_constant(one.plane)[:2] for one in passes])[owner]
    runs_mm = (bezier[:, -1, 0] - bezier[:, 0, 0])[:, None] ** _POWERS
    jumps = np.abs(heights / runs_mm - np.roll(heights @ _AT_END.T / runs_mm, 1, axis=0))
    jumps[is_first] = 0.0
    return _Chain(heights, ends[:, 0], ends[:, 1], along, across, still, jumps, owner, is_first, is_last)


def _numbers(chain: _Chain, digits: Digits, fine: Digits) -> _Numbers:
    """All numbers of all passes, rounded to these digits (passes, 6), and how far they lead from the exact spans."""
    of_span, finest = digits[chain.owner], fine[chain.owner]
    end_decimals = np.tile(of_span[:, [_PLACE]], 3)
    end_decimals[:, :2][chain.is_still] = np.broadcast_to(finest[:, None], chain.is_still.shape)[chain.is_still]
    end_decimals[:, 2] = of_span[:, _END]
    end_decimals[chain.is_last] = finest[chain.is_last, None]
    end = rounded_mm(chain.end, end_decimals)
    begin = np.where(chain.is_first[:, None], rounded_mm(chain.begin, finest[:, None]), np.roll(end, 1, axis=0))
    begin_slide, end_slide, aside = _slides_mm(chain, begin, end)
    run = ((chain.end - chain.begin)[:, :2] * chain.along).sum(axis=1)
    wanted = _between(chain.heights, begin_slide / run, 1.0 + end_slide / run)
    # An inner joint takes the height of its own place, not of the one it slid from.
    end[~chain.is_last, 2] = rounded_mm(wanted.sum(axis=1), end_decimals[:, 2])[~chain.is_last]
    begin[~chain.is_first, 2] = np.roll(end[:, 2], 1)[~chain.is_first]
    powers = np.zeros((len(end), DEGREE + 1))
    left = wanted.copy()
    for degree in range(DEGREE, 1, -1):
        powers[:, degree] = rounded_mm(left[:, degree], of_span[:, _SQUARE + degree - 2])
        left[:, :degree] += (left[:, degree] - powers[:, degree])[:, None] * _LOWER[degree]
    powers[:, 0] = begin[:, 2]
    powers[:, 1] = end[:, 2] - powers.sum(axis=1)
    near = curve_bound_mm((powers - wanted)[:, :, None]) + _overrun_mm(chain, begin_slide, end_slide)
    bounds_mm = np.maximum(np.hypot(near, aside), _end_gaps_mm(chain, begin, end))
    is_far = np.maximum(np.abs(begin_slide), np.abs(end_slide)) > _LONGEST_SLIDE * np.abs(run)
    bounds_mm[is_far] = np.inf
    return _Numbers(begin, end, end_decimals, powers[:, 2:], of_span[:, _SQUARE:], bounds_mm)


def _slides_mm(chain: _Chain, begin: Array, end: Array) -> tuple[Array, Array, Array]:
    """How far rounding slid both joints of every span along its pass (m,), and the larger distance aside (m,)."""
    moved = np.stack([begin - chain.begin, end - chain.end])[:, :, :2]
    begin_slide, end_slide = (moved * chain.along).sum(axis=2)
    return begin_slide, end_slide, np.abs((moved * chain.across).sum(axis=2)).max(axis=0)


def _between(powers: Array, start: Array, stop: Array) -> Array:
    """The polynomials (m, 6) again, with p from 0 to 1 where it ran from `start` to `stop` (m,)."""
    moved = list(powers.T)
    for low in range(DEGREE):
        for k in range(DEGREE - 1, low - 1, -1):
            moved[k] = moved[k] + start * moved[k + 1]
    return np.asarray(np.stack(moved, axis=1) * (stop - start)[:, None] ** _POWERS)


def _overrun_mm(chain: _Chain, begin_slide: Array, end_slide: Array) -> Array:
    """How far a span's polynomial is from its neighbour's where it runs beyond its own joint (m,)."""
    at_begin = (chain.jumps * np.abs(begin_slide)[:, None] ** _POWERS).sum(axis=1)
    after = np.where(chain.is_last[:, None], 0.0, np.roll(chain.jumps, -1, axis=0))
    at_end = (after * np.abs(end_slide)[:, None] ** _POWERS).sum(axis=1)
    return np.asarray(np.maximum(at_begin, at_end))


def _end_gaps_mm(chain: _Chain, begin: Array, end: Array) -> Array:
    """How far the ends of passes moved (m,); 0 for joints within. What is bent in so short a stretch is added."""
    gaps = np.zeros(len(begin))
    run = np.abs(((chain.end - chain.begin)[:, :2] * chain.along).sum(axis=1))
    bend = (np.abs(chain.heights) * _POWERS * (_POWERS - 1)).sum(axis=1) / run**2
    for is_end, exact, written in ((chain.is_first, chain.begin, begin), (chain.is_last, chain.end, end)):
        gap = np.linalg.norm(written - exact, axis=1)
        gaps = np.maximum(gaps, np.where(is_end, gap + bend * gap**2, 0.0))
    return gaps


def _pass_text(numbers: _Numbers, chosen: slice, fine: int, bound_mm: float) -> PassText:
    first, last = Point.of(numbers.begin[chosen][0], fine), Point.of(numbers.end[chosen][-1], fine)
    before = [first.text(axis) for axis in range(3)]
    ends = _texts(numbers.end[chosen], numbers.end_decimals[chosen])
    powers = _texts(numbers.powers[chosen], numbers.power_decimals[chosen])
    blocks = []
    for end, of_z in zip(ends, powers, strict=True):
        words = "".join(AXES[axis] + end[axis] for axis in range(2) if end[axis] != before[axis])
        while of_z and of_z[-1] == "0":
            of_z.pop()
        if of_z:
            words += f"PO[Z]=({','.join([end[2], *of_z])})"
        elif end[2] != before[2]:
            words += f"Z{end[2]}"
        blocks.append(words)
        before = end
    blocks[0] = f"POLY {blocks[0]}"
    return PassText(first, last, tuple(blocks), bound_mm)


def _texts(values_mm: Array, decimals: Digits) -> list[list[str]]:
    units, places = to_units(values_mm, decimals).tolist(), decimals.tolist()
    return [
        [decimal_text(unit, place) for unit, place in zip(row, row_places, strict=True)]
        for row, row_places in zip(units, places, strict=True)
    ]
