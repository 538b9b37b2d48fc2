"""Cusps against closed forms and against a search over dense points of the passes."""

from __future__ import annotations

import numpy as np
import pytest

from planner.path.coverage import inner_cusps
from planner.path.peaks import survey
from planner.path.scallop import Reaches, solve_reaches
from planner.path.strategy.parallel import Layout, Wishes, lay_parallel, prepare
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import cylinder_patch, plane_patch, slope_patch, sphere_patch, thesis_patch, wavy_patch

R = 4.0


def fixed(patch: NurbsPatch, pick_feed_mm: float, angle_deg: float = 0.0) -> Layout:
    return lay_parallel(patch, Wishes(R, np.radians(angle_deg), None, pick_feed_mm), accuracy_mm=1e-9)


@pytest.mark.parametrize("angle_deg", [0.0, 90.0, 33.0])
def test_on_a_plane(angle_deg: float) -> None:
    """(4.1) h = R - sqrt(R^2 - p^2 / 4)."""
    layout = fixed(plane_patch(), 1.0, angle_deg)
    inner = layout.peaks.height_mm[layout.peaks.height_mm > 0]
    assert len(inner) > 10
    assert np.abs(inner - (R - np.sqrt(R**2 - 0.25))).max() < 1e-9


def test_on_an_inclined_plane_the_distance_on_the_slope_counts() -> None:
    """(4.1) p becomes p / cos a where the plane climbs across the passes."""
    slope = np.tan(np.radians(40))
    layout = fixed(plane_patch(20.0, slope), 0.8)
    wanted = R - np.sqrt(R**2 - (0.4 / np.cos(np.radians(40))) ** 2)
    inner = layout.peaks.height_mm[layout.peaks.height_mm > 0]
    assert np.abs(inner - wanted).max() < 1e-9


def test_along_a_cylinder() -> None:
    """(4.1) Passes along the axis at angles f1, f2 leave (r + R) cos s - sqrt(R^2 - ((r + R) sin s)^2) - r, s half."""
    radius_mm = 30.0
    layout = fixed(cylinder_patch(radius_mm), 1.3)
    half = np.diff(np.arcsin(layout.planes_mm[1:-1] / (radius_mm + R))) / 2
    reach = radius_mm + R
    wanted = reach * np.cos(half) - np.sqrt(R**2 - (reach * np.sin(half)) ** 2) - radius_mm
    assert np.abs(layout.peaks.height_mm[1:-1] - wanted).max() < 1e-9


@pytest.mark.parametrize("name", ["thesis", "wavy", "slope", "sphere", "turned"])
def test_every_cusp_is_the_lowest_a_dense_search_finds(name: str) -> None:
    """(4.1) At the worst place of each gap both passes leave the same height, and it is the one found by search."""
    patch = {"wavy": wavy_patch(), "slope": slope_patch(), "sphere": sphere_patch()}.get(name, thesis_patch())
    layout = fixed(patch, 1.1, 25.0 if name == "turned" else 0.0)
    gaps = np.flatnonzero(layout.peaks.height_mm > 0)[:: max(len(layout.planes_mm) // 4, 1)]
    for gap in gaps:
        u, v = layout.peaks.foot[:, gap]
        found = [searched_height(layout, plane, u, v) for plane in layout.planes_mm[gap : gap + 2]]
        assert max(abs(height - layout.peaks.height_mm[gap]) for height in found) < 1e-8


def test_nothing_between_two_passes_stands_higher_than_the_peak() -> None:
    """(4.1) Random places of the patch: the lower of all passes never leaves more than the peak of the gap."""
    layout = fixed(thesis_patch(), 1.5)
    rng = np.random.default_rng(3)
    top = max(layout.peaks.height_mm.max(), layout.peaks.first_mm, layout.peaks.last_mm)
    surface = layout.ground.surface
    for u, v in rng.random((12, 2)):
        y = surface.evaluate(np.array([u]), np.array([v])).centre[1, 0]
        near = np.argsort(np.abs(layout.planes_mm - y))[:3]
        assert min(searched_height(layout, layout.planes_mm[k], u, v) for k in near) <= top + 1e-9


def test_the_change_of_a_peak_with_its_planes_is_its_difference_quotient() -> None:
    """(4.1) `by_a` and `by_b`, which steer the chain, against central differences."""
    layout = fixed(thesis_patch(), 1.5)
    gap, step = 7, 1e-4
    for which, slope in ((gap, layout.peaks.by_a[gap]), (gap + 1, layout.peaks.by_b[gap])):
        heights = []
        for sign in (1, -1):
            planes = layout.planes_mm.copy()
            planes[which] += sign * step
            heights.append(survey(layout.ground, planes, 0.05)[0].height_mm[gap])
        assert abs((heights[0] - heights[1]) / (2 * step) - slope) < 1e-4 * abs(slope)


def test_the_change_of_a_cusp_along_its_line_is_its_difference_quotient() -> None:
    """(4.1) `slope`, whose zeros are the maxima, against central differences, where lines climb and where they fall."""
    layout = fixed(wavy_patch(), 1.5)
    gap, step = np.full(9, 12, dtype=np.intp), 1e-3
    x = np.linspace(10.0, 50.0, 9)
    seeds, surface = layout.ground.seeds, layout.ground.surface
    middle, before, after = (
        inner_cusps(surface, seeds, layout.planes_mm, gap, x + away, 0.05).cusps for away in (0.0, -step, step)
    )
    slopes = (after.height_mm - before.height_mm) / (2 * step)
    assert slopes.min() < -1e-4 < 1e-4 < slopes.max()
    assert np.abs(middle.slope - slopes).max() < 1e-3 * np.abs(slopes).max()


def test_the_changes_of_a_height_are_its_difference_quotients() -> None:
    """(4.1) What one pass leaves: `along` by u and v of the place, `by_plane`, against differences, on steep ground."""
    surface = prepare(slope_patch(), Wishes(R, 0.0, None, 1.5)).surface
    at, step = np.array([[0.4, 0.7, 0.9], [0.3, 0.6, 0.8]]), 1e-6
    plane_mm = surface.evaluate(*at).centre[1] + [-1.0, 0.8, 1.1]

    def height_mm(by_u: float = 0.0, by_v: float = 0.0, by_plane: float = 0.0) -> Reaches:
        under = surface.evaluate(*np.add(at, [[by_u], [by_v]]))
        return solve_reaches(surface, under, plane_mm + by_plane, at)

    found = height_mm()
    assert found.is_found.all()
    for wanted, *steps in ((found.along[0], 1, 0, 0), (found.along[1], 0, 1, 0), (found.by_plane, 0, 0, 1)):
        ahead, behind = (height_mm(*(sign * step * np.array(steps))).height_mm for sign in (1, -1))
        assert (ahead - behind) / (2 * step) == pytest.approx(wanted, rel=1e-4, abs=1e-6)


def searched_height(layout: Layout, plane_mm: float, u: float, v: float) -> float:
    """Height over Q(u, v) along N under one pass: the lowest entry into any ball of the pass, by repeated zoom."""
    surface, seeds = layout.ground.surface, layout.ground.seeds
    under = surface.evaluate(np.array([u]), np.array([v]))
    low, high = under.centre[0, 0] - 3.0, under.centre[0, 0] + 3.0
    best = np.inf
    for _ in range(12):
        x = np.linspace(low, high, 41)
        target = np.stack([x, np.full_like(x, plane_mm)])
        centres = located(layout, target, seeds.near(target))
        toward = centres - under.contact
        along = (toward * under.normal).sum(axis=0)
        inside = R**2 - (toward**2).sum(axis=0) + along**2
        entry = np.where(inside > 0, along - np.sqrt(np.maximum(inside, 0)), np.inf)
        at = int(np.argmin(entry))
        best = float(entry[at])
        low, high = x[max(at - 1, 0)], x[min(at + 1, 40)]
    return best


def located(layout: Layout, target: np.ndarray, guess: np.ndarray) -> np.ndarray:
    from planner.path.newton import locate

    return locate(layout.ground.surface, target, guess, residual_mm=1e-11, steps=40)[1].centre
