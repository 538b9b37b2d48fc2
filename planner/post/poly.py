"""Cubic spans as POLY blocks: PO[axis]=(end, square, cube), p from 0 to 1, the linear coefficient left to the control.

Digits are chosen a pass at a time: the fewest whose error curve, bounded along every span, stays in the budget. What
rounding the cube leaves is taken back by the square where the two nearly coincide: p^3 - p = 1.5 (p^2 - p) + a
remainder below 0.049.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.path.model import Array, Pass, PlaneSpline
from planner.post.numbers import decimal_text, to_units
from planner.post.passtext import AXES, PassText, Point
from planner.post.rounding import curve_bound_mm, poly_error
from planner.post.spans import bezier_points, in_work, power_form, raised_to_cubic

Units = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Digits:
    """Decimals of end points, of square and of cube coefficients."""

    end: int
    square: int
    cube: int


@dataclass(frozen=True, slots=True)
class Spans:
    """The spans of all passes one after another: `power` (m, 4, 3) mm, `end_mm` (m, 3), `owner` (m,) pass numbers.

    `is_first` (m,) marks the first span of each pass.
    """

    power: Array
    end_mm: Array
    owner: NDArray[np.int64]
    is_first: NDArray[np.bool_]


def poly_passes(passes: Sequence[Pass], drop_z_mm: float, budget_mm: float, most_decimals: int) -> list[PassText]:
    """Every pass as POLY blocks, each with the cheapest digits that keep its error curve within `budget_mm`."""
    spans = _spans_of(passes, drop_z_mm)
    starts = np.flatnonzero(spans.is_first)
    texts: dict[int, PassText] = {}
    waiting = np.ones(len(passes), dtype=bool)
    candidates = _candidates(most_decimals)
    for digits in candidates:
        rounded = round_spans(spans, digits)
        worst_mm = np.maximum.reduceat(rounded.bound_mm, starts)
        is_last_chance = digits is candidates[-1]
        for number in np.flatnonzero(waiting & ((worst_mm <= budget_mm) | is_last_chance)):
            chosen = slice(starts[number], starts[number + 1] if number + 1 < len(starts) else None)
            texts[int(number)] = _pass_text(rounded, chosen, digits, float(worst_mm[number]))
            waiting[number] = False
        if not waiting.any():
            break
    return [texts[number] for number in range(len(passes))]


@dataclass(frozen=True, slots=True)
class Rounded:
    """Spans with their numbers rounded: units of the last digit (m, 3), and the bound of each error curve (m,), mm."""

    start: Units
    end: Units
    square: Units
    cube: Units
    bound_mm: Array


def round_spans(spans: Spans, digits: Digits) -> Rounded:
    """All numbers of all spans at these digits, and how far each written span may lie from its span."""
    begin, square_mm, cube_mm = spans.power[:, 0], spans.power[:, 2], spans.power[:, 3]
    end = to_units(spans.end_mm, digits.end)
    end_error = end / 10.0**digits.end - spans.end_mm
    start = np.where(spans.is_first[:, None], to_units(begin, digits.end), np.roll(end, 1, axis=0))
    start_error = start / 10.0**digits.end - begin
    cube = to_units(cube_mm, digits.cube)
    cube_error = cube / 10.0**digits.cube - cube_mm
    square = to_units(square_mm - 1.5 * cube_error, digits.square)
    square_error = square / 10.0**digits.square - square_mm
    bound_mm = curve_bound_mm(poly_error(start_error, end_error, square_error, cube_error))
    return Rounded(start, end, square, cube, bound_mm)


def _spans_of(passes: Sequence[Pass], drop_z_mm: float) -> Spans:
    pieces, owners, firsts = [], [], []
    for number, one in enumerate(passes):
        assert isinstance(one.shape, PlaneSpline)
        bezier = raised_to_cubic(bezier_points(one.shape))
        pieces.append(in_work(one.plane, bezier, drop_z_mm))
        owners.append(np.full(len(bezier), number))
        firsts.append(np.arange(len(bezier)) == 0)
    work = np.concatenate(pieces)
    return Spans(power_form(work), work[:, 3], np.concatenate(owners), np.concatenate(firsts))


def _candidates(most_decimals: int) -> list[Digits]:
    """Digits from the fewest bytes to the most; the last is the finest the control reads."""
    every = [
        Digits(end, square, cube)
        for end in range(most_decimals + 1)
        for square in range(max(end - 2, 0), min(end + 1, most_decimals) + 1)
        for cube in range(max(end - 2, 0), min(end + 1, most_decimals) + 1)
    ]
    every.sort(key=lambda digits: (digits.end + digits.square + digits.cube, digits.end))
    return every


def _pass_text(rounded: Rounded, chosen: slice, digits: Digits, bound_mm: float) -> PassText:
    before = rounded.start[chosen][0].tolist()
    first = Point((before[0], before[1], before[2]), digits.end)
    blocks = []
    rows = zip(*(units[chosen].tolist() for units in (rounded.end, rounded.square, rounded.cube)), strict=True)
    for end, square, cube in rows:
        words = "".join(_axis_word(axis, end, before, square, cube, digits) for axis in range(3))
        if words:
            blocks.append(words)
        before = end
    blocks[:1] = [f"POLY {block}" for block in blocks[:1]]
    return PassText(first, Point((before[0], before[1], before[2]), digits.end), tuple(blocks), bound_mm)


def _axis_word(axis: int, end: list[int], before: list[int], square: list[int], cube: list[int], digits: Digits) -> str:
    name = AXES[axis]
    if square[axis] == 0 and cube[axis] == 0:
        return "" if end[axis] == before[axis] else name + decimal_text(end[axis], digits.end)
    numbers = [decimal_text(end[axis], digits.end), decimal_text(square[axis], digits.square)]
    if cube[axis] != 0:
        numbers.append(decimal_text(cube[axis], digits.cube))
    return f"PO[{name}]=({','.join(numbers)})"
