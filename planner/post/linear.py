"""Polylines as straight moves: one block a vertex, only the coordinates that change."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from planner.gcode.words import decimal_text
from planner.path.model import Array, Pass, Polyline
from planner.path.spans import in_work
from planner.post.digits import Digits, fewest_digits
from planner.post.numbers import rounded_mm, to_units
from planner.post.passtext import PassText, Point, is_constant, moved_words
from planner.post.rounding import polyline_bound_mm


def linear_passes(
    passes: Sequence[Pass], drop_z_mm: float, budgets_mm: Array, fine: Digits, most_decimals: int
) -> list[PassText]:
    """Every polyline with the fewest decimals of X and Y, and of Z, that keep its path within `budgets_mm`.

    The ends of passes have `fine` (passes,) decimals. Vertices that fall together are dropped.
    """
    points = [in_work(one.plane, _shape(one).points, drop_z_mm) for one in passes]
    still = [is_constant(one.plane) for one in passes]
    least, most = (np.tile(np.minimum(fine + margin, most_decimals)[:, None], 2) for margin in (0, 1))
    ends = fine.tolist()

    def bound_mm(digits: Digits) -> Array:
        rounded = (
            rounded_mm(vertices, _decimals(len(vertices), of_pass, is_still, end))
            for vertices, of_pass, is_still, end in zip(points, digits, still, ends, strict=True)
        )
        return np.array([polyline_bound_mm(exact, near) for exact, near in zip(points, rounded, strict=True)])

    digits, bounds = fewest_digits(least, most, np.array([1.0, 1.1]), bound_mm, budgets_mm)
    return [
        _pass_text(vertices, _decimals(len(vertices), of_pass, is_still, end), end, bound)
        for vertices, of_pass, is_still, end, bound in zip(points, digits, still, ends, bounds.tolist(), strict=True)
    ]


def _shape(one: Pass) -> Polyline:
    assert isinstance(one.shape, Polyline)
    return one.shape


def _decimals(count: int, of_pass: Digits, is_still: np.ndarray, fine: int) -> Digits:
    decimals = np.tile(np.array([of_pass[0], of_pass[0], of_pass[1]]), (count, 1))
    decimals[[0, -1]] = fine
    decimals[:, is_still] = fine
    return decimals


def _pass_text(points: Array, decimals: Digits, fine: int, bound_mm: float) -> PassText:
    texts = [
        [decimal_text(unit, place) for unit, place in zip(row, places, strict=True)]
        for row, places in zip(to_units(points, decimals).tolist(), decimals.tolist(), strict=True)
    ]
    blocks = tuple(moved_words(texts, before) for before, texts in pairwise(texts) if texts != before)
    return PassText(Point.of(points[0], fine), Point.of(points[-1], fine), blocks, bound_mm)
