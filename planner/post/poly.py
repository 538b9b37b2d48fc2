"""Cubic spans as POLY blocks: PO[axis]=(end, square, cube), p from 0 to 1, the linear coefficient left to the control.

Digits are chosen a pass at a time: the fewest whose path, bounded along every span, stays in the budget. What rounding
the cube leaves is taken back by the square where the two nearly coincide: p^3 - p = 1.5 (p^2 - p) + a remainder below
0.049.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.gcode.words import decimal_text
from planner.path.model import Array, Pass, PlaneSpline
from planner.path.spans import bezier_points, in_work, joints_of, power_form, raised_to_cubic
from planner.post.digits import Digits, fewest_digits
from planner.post.numbers import rounded_mm, to_units
from planner.post.passtext import AXES, PassText, Point, is_constant
from planner.post.rounding import SpanChain, path_bound_mm, poly_power

_MOST_MARGIN = 2
# columns of the search: end, square, cube of X and Y, then of Z
_END, _SQUARE, _CUBE, _OF_Z = 0, 1, 2, 3


@dataclass(frozen=True, slots=True)
class _Chain:
    """All passes' spans: the exact curves, their owners (m,), axes that a pass does not move (m, 3)."""

    exact: SpanChain
    end_mm: Array
    owner: NDArray[np.int64]
    starts: NDArray[np.int64]
    is_still: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class _Numbers:
    """What the blocks say, (m, 3) each, mm, with their decimals (m, 3)."""

    start: Array
    end: Array
    square: Array
    cube: Array
    end_decimals: Digits
    square_decimals: Digits
    cube_decimals: Digits


def poly_passes(
    passes: Sequence[Pass], drop_z_mm: float, budgets_mm: Array, fine: Digits, most_decimals: int
) -> list[PassText]:
    """Every pass as POLY blocks with the fewest digits that keep its path within `budgets_mm`.

    `fine` (passes,) are the decimals of the ends of passes and of axes that stand still; `most_decimals` what the
    control reads.
    """
    if not passes:
        return []
    chain = _chain_of(passes, drop_z_mm)
    uses = np.tile(np.array([1.0, 1.2, 1.1]), 2)
    least, most = (np.tile(np.minimum(fine + margin, most_decimals)[:, None], 6) for margin in (0, _MOST_MARGIN))

    def bound_mm(digits: Digits) -> Array:
        numbers = _numbers(chain, digits, fine)
        written = poly_power(numbers.start, numbers.end, numbers.square, numbers.cube)
        return np.maximum.reduceat(path_bound_mm(chain.exact, written), chain.starts)

    digits, bounds = fewest_digits(least, most, uses, bound_mm, budgets_mm)
    numbers = _numbers(chain, digits, fine)
    stops = [*chain.starts[1:].tolist(), len(chain.owner)]
    return [
        _pass_text(numbers, slice(begin, stop), finest, bound)
        for begin, stop, finest, bound in zip(chain.starts.tolist(), stops, fine.tolist(), bounds.tolist(), strict=True)
    ]


def _chain_of(passes: Sequence[Pass], drop_z_mm: float) -> _Chain:
    pieces, counts, lengths, still = [], [], [], []
    for one in passes:
        assert isinstance(one.shape, PlaneSpline)
        bezier = raised_to_cubic(bezier_points([one.shape]))
        pieces.append(in_work(one.plane, bezier, drop_z_mm))
        lengths.append(np.diff(joints_of(one.shape)))
        counts.append(len(bezier))
        still.append(np.tile(is_constant(one.plane), (len(bezier), 1)))
    work = np.concatenate(pieces)
    ends = np.cumsum(counts)
    starts = np.asarray(ends - counts, dtype=np.int64)
    is_first, is_last = np.zeros((2, len(work)), dtype=bool)
    is_first[starts] = True
    is_last[ends - 1] = True
    exact = SpanChain.of(power_form(work), np.concatenate(lengths), is_first, is_last)
    return _Chain(exact, work[:, 3], np.repeat(np.arange(len(passes)), counts), starts, np.concatenate(still))


def _numbers(chain: _Chain, digits: Digits, fine: Digits) -> _Numbers:
    """All numbers of all passes, rounded to these digits (passes, 6)."""
    of_span, finest = digits[chain.owner], fine[chain.owner][:, None]
    power = chain.exact.power
    keeps_fine = chain.exact.is_last[:, None] | chain.is_still
    end_decimals = np.where(keeps_fine, finest, _by_axis(of_span, _END))
    end = rounded_mm(chain.end_mm, end_decimals)
    start = np.where(chain.exact.is_first[:, None], rounded_mm(power[:, 0], finest), np.roll(end, 1, axis=0))
    cube_decimals, square_decimals = _by_axis(of_span, _CUBE), _by_axis(of_span, _SQUARE)
    cube = rounded_mm(power[:, 3], cube_decimals)
    square = rounded_mm(power[:, 2] - 1.5 * (cube - power[:, 3]), square_decimals)
    return _Numbers(start, end, square, cube, end_decimals, square_decimals, cube_decimals)


def _by_axis(of_span: Digits, kind: int) -> Digits:
    return np.stack([of_span[:, kind], of_span[:, kind], of_span[:, kind + _OF_Z]], axis=1)


def _pass_text(numbers: _Numbers, chosen: slice, fine: int, bound_mm: float) -> PassText:
    first = Point.of(numbers.start[chosen][0], fine)
    last = Point.of(numbers.end[chosen][-1], fine)
    before = [first.text(axis) for axis in range(3)]
    parts = [
        _texts(values[chosen], decimals[chosen])
        for values, decimals in (
            (numbers.end, numbers.end_decimals),
            (numbers.square, numbers.square_decimals),
            (numbers.cube, numbers.cube_decimals),
        )
    ]
    blocks = []
    for end, square, cube in zip(*parts, strict=True):
        words = "".join(_axis_word(axis, end[axis], before[axis], square[axis], cube[axis]) for axis in range(3))
        if words:
            blocks.append(words)
        before = end
    blocks[:1] = [f"POLY {block}" for block in blocks[:1]]
    return PassText(first, last, tuple(blocks), bound_mm)


def _texts(values_mm: Array, decimals: Digits) -> list[list[str]]:
    units, places = to_units(values_mm, decimals).tolist(), decimals.tolist()
    return [
        [decimal_text(unit, place) for unit, place in zip(row, row_places, strict=True)]
        for row, row_places in zip(units, places, strict=True)
    ]


def _axis_word(axis: int, end: str, before: str, square: str, cube: str) -> str:
    name = AXES[axis]
    if square == "0" and cube == "0":
        return "" if end == before else name + end
    return f"PO[{name}]=({end},{square})" if cube == "0" else f"PO[{name}]=({end},{square},{cube})"
