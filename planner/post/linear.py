"""Polylines as straight moves: one block a vertex, only the coordinates that change."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from planner.path.model import Array, Pass, Polyline
from planner.post.numbers import to_units
from planner.post.passtext import PassText, Point, moved_words
from planner.post.spans import in_work


def linear_pass(one: Pass, drop_z_mm: float, budget_mm: float, most_decimals: int) -> PassText:
    """A polyline with the fewest decimals whose vertices move by at most `budget_mm`.

    Between two vertices the error is linear, so the worst vertex bounds it. Vertices that fall together are dropped.
    """
    assert isinstance(one.shape, Polyline)
    points = in_work(one.plane, one.shape.points, drop_z_mm)
    for decimals in range(most_decimals + 1):
        units = to_units(points, decimals)
        error_mm = _worst(points, units, decimals)
        if error_mm <= budget_mm:
            break
    rows = units.tolist()
    kept = [rows[0], *(row for before, row in pairwise(rows) if row != before)]
    blocks = tuple(moved_words(row, before, decimals) for before, row in pairwise(kept))
    return PassText(_point(kept[0], decimals), _point(kept[-1], decimals), blocks, error_mm)


def _worst(points: Array, units: np.ndarray, decimals: int) -> float:
    return float(np.sqrt(((units / 10.0**decimals - points) ** 2).sum(axis=1).max()))


def _point(row: list[int], decimals: int) -> Point:
    return Point((row[0], row[1], row[2]), decimals)
