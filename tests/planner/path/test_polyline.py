"""The leanest polyline: inside the tolerance, and no link more than the tube needs."""

from __future__ import annotations

import numpy as np
import pytest

from planner.path.polyline import lean_polyline
from tests.planner.path.curves import AnalyticCurve, arc, graph, random_graph, wave_pass
from tests.planner.path.distances import farthest_mm

CURVES = {"random 1": random_graph(1), "random 5": random_graph(5), "arc": arc(4.0, 0.0, 2.5), "wave": wave_pass()}


@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize("tolerance_mm", [0.01, 0.001])
def test_keeps_the_tolerance_both_ways(name: str, tolerance_mm: float) -> None:
    """(4.4) Dense points of curve and polyline lie within the stated distance of each other."""
    curve = CURVES[name]
    polyline, deviation_mm = lean_polyline(curve, tolerance_mm)
    exact = curve.refine(np.linspace(0.0, curve.arc_mm[-1], 20001)).points
    assert deviation_mm <= tolerance_mm * (1 + 1e-9)
    assert farthest_mm(exact[::100], polyline.points) <= deviation_mm
    assert farthest_mm(polyline.points, exact) <= deviation_mm


def test_circle_takes_the_links_its_tube_allows() -> None:
    """(4.4) The longest line between the circles R - t and R + t spans 2 acos((R - t) / (R + t))."""
    radius_mm, tolerance_mm, turn_rad = 50.0, 0.001, 0.9
    polyline, _ = lean_polyline(arc(radius_mm, 0.0, turn_rad), tolerance_mm)
    link_rad = 2 * np.arccos((radius_mm - tolerance_mm) / (radius_mm + tolerance_mm))
    fewest = int(np.ceil(turn_rad / link_rad))
    assert fewest <= len(polyline.points) - 1 <= fewest * 1.03 + 1


def test_straight_line_is_one_link() -> None:
    """(4.4) Nothing is cut that need not be."""
    line = graph(lambda w, k: 0.1 * w if k == 0 else np.full_like(w, 0.1 * (k == 1)), 0.0, 40.0)
    assert isinstance(line, AnalyticCurve)
    assert len(lean_polyline(line, 0.001)[0].points) == 2
