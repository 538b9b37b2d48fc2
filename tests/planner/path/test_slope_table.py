"""Ranges over boxes of cells against looking at every cell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planner.path.interval import Range
from planner.path.offset import OffsetSurface
from planner.path.slope_table import SlopeTable, slope_table
from tests.planner.surfaces import sphere_patch


@pytest.mark.parametrize("seed", range(6))
def test_a_box_has_the_range_of_its_cells_however_many(seed: int) -> None:
    """(4.3, 4.5) Boxes inside one cell, over all of them, and beyond them."""
    rng = np.random.default_rng(seed)
    edges = [np.sort(rng.random(count)) for count in rng.integers(2, 40, 2)]
    shape = (len(edges[0]) - 1, len(edges[1]) - 1)
    least = rng.standard_normal((2, *shape))
    speeds = Range(least, least + rng.random((2, *shape)))
    some, none = Range(least[0], least[0]), [np.zeros(len(edge), dtype=np.intp) for edge in edges]
    table = SlopeTable(edges[0], edges[1], some, some, speeds, none[0], none[1], 0.0)
    low = rng.random((2, 60))
    high = np.minimum(low + rng.random((2, 60)) * rng.choice([0.02, 0.3, 1.0], 60), 1.05)
    found = table.over(speeds, low, high)
    for box in range(60):
        is_inside = all(edges[k][0] < low[k, box] and high[k, box] < edges[k][-1] for k in (0, 1))
        if not is_inside:
            assert np.isinf(found.low[:, box]).all()
            assert np.isinf(found.high[:, box]).all()
            continue
        rows, columns = (
            (edges[k][1:] >= low[k, box]) & (edges[k][:-1] <= high[k, box]) for k in (0, 1)
        )  # those that the box touches
        cells = np.ix_([True, True], rows, columns)
        assert found.low[:, box] == pytest.approx(speeds.low[cells].min(axis=(1, 2)), abs=0)
        assert found.high[:, box] == pytest.approx(speeds.high[cells].max(axis=(1, 2)), abs=0)


def test_a_table_is_made_once_for_all_ways_of_writing_its_passes() -> None:
    """(4.5) Splines, arcs and straight moves made it anew each: most of the time on a rational patch."""
    surface = OffsetSurface(sphere_patch(), 4.0)
    assert slope_table(surface, 2) is slope_table(replace(surface), 2)
    assert slope_table(surface, 2) is not slope_table(replace(surface, radius_mm=3.0), 2)
    assert slope_table(surface, 2) is not slope_table(OffsetSurface(sphere_patch(), 4.0), 2)
