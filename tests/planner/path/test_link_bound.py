"""The bound on straight moves and arcs: never below what dense sampling finds, close to it, broken by a moved end."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from planner.path import link_bound
from planner.path.arcs import arc_chain
from planner.path.curve import exact_at
from planner.path.link_bound import bound_links, seen_gaps
from planner.path.model import ArcChain, Method, Polyline
from planner.path.polyline import lean_polyline
from planner.path.slope_range import patch_table
from planner.path.strategy.parallel import Wishes, lay_parallel
from planner.path.trace import TracedCurve
from planner.shapes import FIT_SHARE, shape_passes
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import (
    cylinder_patch,
    plane_patch,
    random_patch,
    slope_patch,
    sphere_patch,
    thesis_patch,
    uneven_patch,
    wavy_patch,
)

PATCHES = {
    "thesis": thesis_patch(),
    "wavy": wavy_patch(1, size_mm=40.0, height_mm=0.5),
    "45 degrees": slope_patch(),
    "cylinder": cylinder_patch(),
    "sphere": sphere_patch(),
}


def curves_over(patch: NurbsPatch, path_mm: float) -> list[TracedCurve]:
    """A few passes at an odd angle."""
    wishes = Wishes(4.0, 0.5, None, 7.0)
    return list(lay_parallel(patch, wishes, accuracy_mm=1e-4 * path_mm, reading_mm=1e-2 * path_mm).curves)


def sampled_mm(curve: TracedCurve, shape: Polyline | ArcChain) -> float:
    """The largest distance found of dense points of the curve from the nearest link."""
    points = curve.refine(np.linspace(0.0, curve.length_mm, 3001)).points
    nearest = np.full(len(points), np.inf)
    for link in range(len(shape.points) - 1):
        begin, end = shape.points[link], shape.points[link + 1]
        run = end - begin
        share = ((points - begin) @ run) / (run @ run)
        away = np.hypot(*(points - begin - np.clip(share, 0, 1)[:, None] * run).T)
        if isinstance(shape, ArcChain) and shape.turns[link]:
            centre = shape.centres[link]
            round_ = np.abs(np.hypot(*(points - centre).T) - np.hypot(*(begin - centre)))
            away = np.where((share >= 0) & (share <= 1), round_, np.minimum(away, np.hypot(*(points - end).T)))
        nearest = np.minimum(nearest, away)
    return float(nearest.max())


@pytest.mark.parametrize("name", PATCHES)
@pytest.mark.parametrize("path_mm", [0.01, 0.001])
@pytest.mark.parametrize("make", [lean_polyline, arc_chain])
def test_the_bound_holds_and_is_close(name: str, path_mm: float, make: object) -> None:
    """(4.3) At most 1.5 times what 3000 samples a pass find, never below it, and within a fiftieth of the asked."""
    curves = curves_over(PATCHES[name], path_mm)
    shapes = [(lean_polyline if make is lean_polyline else arc_chain)(curve, path_mm)[0] for curve in curves]
    table = patch_table(curves)
    assert table is not None
    bounds = bound_links(curves, shapes, table)
    for curve, shape, bound_mm in zip(curves, shapes, bounds.tolist(), strict=True):
        true_mm = sampled_mm(curve, shape)
        assert true_mm <= bound_mm <= max(1.5 * true_mm, 0.05 * path_mm)
        assert bound_mm <= 1.02 * path_mm


@pytest.mark.parametrize("kind", ["arcs", "linear"])
def test_passes_of_arcs_and_of_straight_moves_are_proved(kind: str) -> None:
    """(4.3)"""
    for one in shape_passes(curves_over(thesis_patch(), 0.001), "arcs" if kind == "arcs" else "linear", 0.001, 4.0):
        assert one.method is Method.PROVED
        assert one.deviation_mm <= 0.0009


@pytest.mark.parametrize("seed", [0, 9, 12])
@pytest.mark.parametrize("kind", ["arcs", "linear"])
def test_sections_come_closer_where_the_curvature_changes_fast(seed: int, kind: Literal["arcs", "linear"]) -> None:
    """(4.3) Arcs left such curves by up to 1.6 times the tolerance between two sections, and were written so."""
    wishes = Wishes(4.0, 0.0, None, 2.0)
    curves = lay_parallel(uneven_patch(seed), wishes, accuracy_mm=2.5e-7, reading_mm=2.5e-5).curves
    for curve, one in zip(curves, shape_passes(curves, kind, 0.0025, 4.0), strict=True):
        assert one.deviation_mm <= FIT_SHARE * 0.0025
        assert isinstance(one.shape, Polyline | ArcChain)
        assert sampled_mm(curve, one.shape) <= one.deviation_mm


@pytest.mark.parametrize(("seed", "halvings"), [(20, 1), (19, 2)])
@pytest.mark.parametrize("make", [lean_polyline, arc_chain])
def test_nodes_too_far_apart_to_enclose_the_curvature_are_halved(seed: int, halvings: int, make: object) -> None:
    """(4.3) Before it some passes over these patches have no bound; after it all have one, above dense sampling."""
    patch, wishes = random_patch(seed)
    wishes = replace(wishes, scallop_mm=None, pick_feed_mm=1.5 * wishes.radius_mm, rolls_over=False)
    curves = lay_parallel(patch, wishes, accuracy_mm=1e-6, reading_mm=1e-4).curves
    shapes = [(lean_polyline if make is lean_polyline else arc_chain)(curve, 0.009)[0] for curve in curves]
    table = patch_table(curves)
    assert table is not None
    fewer = bound_links(curves, shapes, table, halvings=halvings - 1)
    bounds = bound_links(curves, shapes, table)
    late = np.flatnonzero(np.isinf(fewer))
    assert len(late) > 0
    assert np.isfinite(bounds).all()
    assert (bounds[np.isfinite(fewer)] == fewer[np.isfinite(fewer)]).all()
    for row in late.tolist():
        true_mm = sampled_mm(curves[row], shapes[row])
        assert true_mm <= bounds[row] <= max(1.5 * true_mm, 0.05 * 0.009)


@pytest.mark.parametrize("vertex", [0, 3, -1])
def test_a_vertex_moved_breaks_it(vertex: int) -> None:
    """(4.3) Moved by two tolerances across the pass."""
    curves = curves_over(thesis_patch(), 0.001)
    table = patch_table(curves)
    assert table is not None
    for make in (lean_polyline, arc_chain):
        shape, _ = make(curves[2], 0.001)
        points = shape.points.copy()
        points[vertex % len(points)] += np.array([0.0, 0.002])
        assert bound_links([curves[2]], [replace(shape, points=points)], table)[0] > 0.001


@pytest.mark.parametrize("name", PATCHES)
def test_what_is_seen_of_straight_moves_is_their_largest_distance(name: str) -> None:
    """(4.3) Where no bound is known the report tells samples: they stand at corners too, where moves are far off."""
    curves = curves_over(PATCHES[name], 0.001)
    shapes = [lean_polyline(curve, 0.001)[0] for curve in curves]
    for curve, shape, seen_mm in zip(curves, shapes, seen_gaps(curves, shapes), strict=True):
        dense_mm = sampled_mm(curve, shape)
        assert 0.997 * dense_mm <= seen_mm <= 1.003 * dense_mm


def test_straight_passes_are_bounded_at_few_places(monkeypatch: pytest.MonkeyPatch) -> None:
    """(4.5) No share of no distance is small enough: halved again and again, a U with flat arms took 4 minutes."""
    curves = curves_over(plane_patch(30.0, 0.2), 0.001)
    lines = [Polyline(curve.points[[0, -1]] + [0.0, off_mm]) for curve in curves for off_mm in (0.0, 1e-9)]
    table = patch_table(curves)
    assert table is not None
    asked = []
    monkeypatch.setattr(link_bound, "exact_at", lambda *given: asked.append(len(given[2])) or exact_at(*given))
    assert bound_links([curve for curve in curves for _ in range(2)], lines, table).max() < 1e-7
    assert max(asked) <= 3 * sum(len(curve.arc_mm) for curve in curves)
