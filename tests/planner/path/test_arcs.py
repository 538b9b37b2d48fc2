"""Arc chains: inside the tolerance, joined, far fewer than straight moves."""

from __future__ import annotations

import numpy as np
import pytest

from planner.path.arcs import arc_chain
from planner.path.polyline import lean_polyline
from tests.planner.path.curves import arc, graph, random_graph, wave_pass
from tests.planner.path.distances import farthest_mm, walked

CURVES = {"random 1": random_graph(1), "random 5": random_graph(5), "arc": arc(4.0, 0.0, 2.5), "wave": wave_pass()}


@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize("tolerance_mm", [0.01, 0.001])
def test_keeps_the_tolerance_both_ways(name: str, tolerance_mm: float) -> None:
    """(4.4) Dense points of curve and arcs lie within the stated distance of each other; the ends are the curve's."""
    curve = CURVES[name]
    chain, deviation_mm = arc_chain(curve, tolerance_mm)
    exact = curve.refine(np.linspace(0.0, curve.arc_mm[-1], 20001)).points
    dense = walked(chain)
    assert deviation_mm <= tolerance_mm
    assert farthest_mm(exact[::100], dense) <= deviation_mm
    assert farthest_mm(dense[::50], exact) <= deviation_mm
    np.testing.assert_allclose(chain.points[[0, -1]], exact[[0, -1]], atol=1e-9)


def test_far_fewer_than_straight_moves_on_the_wave() -> None:
    """(4.4) On a 300 mm pass at 1 um arcs are less than a quarter of the fewest straight moves."""
    curve = wave_pass()
    assert 4 * len(arc_chain(curve, 0.001)[0].turns) < len(lean_polyline(curve, 0.001)[0].points)


def test_an_arc_is_one_arc_and_a_line_one_line() -> None:
    """(4.4) What is an arc already stays one; a straight curve is a line, with turn 0."""
    chain, _ = arc_chain(arc(4.0, 0.0, 2.5), 0.001)
    assert chain.turns.tolist() == [1]
    np.testing.assert_allclose(chain.centres[0], 0.0, atol=2e-3)
    line = graph(lambda w, k: 0.1 * w if k == 0 else np.full_like(w, 0.1 * (k == 1)), 0.0, 40.0)
    assert arc_chain(line, 0.001)[0].turns.tolist() == [0]
