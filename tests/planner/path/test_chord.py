"""Lartigue's break points and the spline through them."""

from __future__ import annotations

import numpy as np
import pytest

from planner.path.chord import EndRule, paper_break_points, paper_spline
from planner.path.spline_table import SplineTable
from tests.planner.path.curves import arc, random_graph


def test_step_is_thirty_tolerances_off_the_circle() -> None:
    """(4.4) On a circle every full step has a sag of 30 tolerances."""
    curve = arc(50.0, 0.0, 2.0)
    places = paper_break_points(curve, tolerance_mm=0.001, radius_mm=4.0)
    chords = np.hypot(*np.diff(curve.refine(places).points, axis=0).T)
    sags = 50.0 - np.sqrt(50.0**2 - chords**2 / 4)
    np.testing.assert_allclose(sags[:-1], 0.03, rtol=1e-9)


def test_step_is_at_most_four_radii() -> None:
    """(4.4) A nearly straight curve is stepped by 4 R."""
    places = paper_break_points(arc(1e5, 0.0, 1e-3), tolerance_mm=0.1, radius_mm=4.0)
    assert np.diff(places)[0] == pytest.approx(16.0)


@pytest.mark.parametrize("ends", list(EndRule))
def test_spline_runs_through_the_break_points(ends: EndRule) -> None:
    """(4.4) The spline interpolates, and obeys its end rule."""
    curve = random_graph(2)
    fitted, break_points = paper_spline(curve, 0.001, 4.0, ends)
    places = fitted.spline.knots[3:-3]
    points, first, second = SplineTable([fitted.spline]).evaluate(np.zeros(len(places), np.intp), places)
    np.testing.assert_allclose(points, break_points, atol=1e-10)
    if ends is EndRule.TANGENT:
        np.testing.assert_allclose(first[[0, -1]], curve.tangents[[0, -1]], atol=1e-9)
    else:
        np.testing.assert_allclose(second[[0, -1]], 0.0, atol=1e-9)
