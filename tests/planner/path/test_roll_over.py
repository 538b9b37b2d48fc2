"""`edge = "roll-over"`: the ball rolls over the edge of a patch, against spheres about densely sampled edges."""

from __future__ import annotations

import numpy as np
import pytest

from planner.errors import InputRejected
from planner.path.gouge import tool_side
from planner.path.model import Method, PlaneSpline
from planner.path.offset import OffsetSurface, dot
from planner.path.roll import RolledSurface, rolled
from planner.path.spans import bezier_points
from planner.path.strategy.parallel import Layout, Wishes, lay_parallel
from planner.shapes import Kind, shape_layout
from planner.surface.curvature import survey
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import cylinder_patch, plane_patch, slope_patch, sphere_patch, thesis_patch, wavy_patch

R = 4.0
PATCHES = {
    "thesis": thesis_patch(),
    "wavy": wavy_patch(1, size_mm=40.0, height_mm=0.9),
    "45 degrees": slope_patch(),
    "cylinder": cylinder_patch(),
    "sphere": sphere_patch(),
}


def rolling(patch: NurbsPatch, stock_mm: float = 0.0) -> RolledSurface:
    return rolled(OffsetSurface(patch, R, tool_side(survey(patch)), stock_mm), out_mm=1.5)


def laid(name: str, scallop_mm: float | None = 0.08, angle_deg: float = 0.0, feed_mm: float | None = None) -> Layout:
    wishes = Wishes(R, np.radians(angle_deg), scallop_mm, feed_mm, rolls_over=True)
    return lay_parallel(PATCHES[name], wishes, accuracy_mm=1e-7)


def edge_points(patch: NurbsPatch, count: int) -> np.ndarray:
    """Points (3, 4 count) of the four sides."""
    (u_low, u_high), (v_low, v_high) = patch.domain
    u, v = np.linspace(u_low, u_high, count), np.linspace(v_low, v_high, count)
    sides = [(u, np.full(count, v_low)), (u, np.full(count, v_high)), (np.full(count, u_low), v)]
    sides.append((np.full(count, u_high), v))
    return np.concatenate([patch.evaluate(*side).point for side in sides], axis=1)


def ball_height(points: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """How high (k,) a ball that comes down at XY (k, 2) stands on the points (3, m)."""
    away = ((points[:2, :, None] - xy.T[:, None]) ** 2).sum(axis=0)
    return np.asarray((points[2, :, None] + np.sqrt(np.maximum(R * R - away, 0)) - 1e9 * (away > R * R)).max(axis=0))


@pytest.mark.parametrize("name", ["thesis", "wavy", "45 degrees"])
@pytest.mark.parametrize("stock_mm", [0.0, 0.3])
def test_derivatives_beyond_the_border_are_those_of_differences(name: str, stock_mm: float) -> None:
    """(4.2) Contact, centre and normal beside edges and past corners; the normal is a unit one and square to both."""
    surface, step = rolling(PATCHES[name], stock_mm), 1e-6
    rng = np.random.default_rng(3)
    at = np.stack([rng.uniform(*ends, 3000) for ends in surface.rim])
    found = surface.evaluate(*at)
    for axis, name_by in enumerate("uv"):
        move = step * np.eye(2)[:, axis, None]
        ahead, back = surface.evaluate(*(at + move)), surface.evaluate(*(at - move))
        for what in ("contact", "centre", "normal"):
            slope = (getattr(ahead, what) - getattr(back, what)) / (2 * step)
            off = np.abs(slope - getattr(found, f"{what}_{name_by}")).max(axis=0)
            assert np.sort(off)[-5] < 1e-5, "at most a few differences straddle the border"
    assert np.abs(dot(found.normal, found.normal) - 1).max() < 1e-14
    assert max(np.abs(dot(found.normal, by)).max() for by in (found.centre_u, found.centre_v)) < 1e-12


@pytest.mark.parametrize(("name", "angle_deg"), [(name, angle) for name in PATCHES for angle in (0.0, 30.0)])
def test_a_ball_beyond_the_border_rests_on_the_edge(name: str, angle_deg: float) -> None:
    """(4.2) Where a ball let down on a dense copy of the edge comes to rest, there the pass has its centre."""
    layout = laid(name, 0.08, angle_deg)
    beyond = [curve for curve in layout.curves if isinstance(curve.surface, RolledSurface)]
    assert len(beyond) >= 2 * (layout.pass_of[-1] - 2), "nearly every pass rolls over both its ends"
    centres = np.concatenate([curve.plane.to_work(curve.points) for curve in beyond[::7]])
    rest_mm = ball_height(edge_points(PATCHES[name], 4001), centres[:, :2])
    assert np.abs(rest_mm - centres[:, 2]).max() < 2e-5


@pytest.mark.parametrize("name", PATCHES)
@pytest.mark.parametrize(("angle_deg", "scallop_mm", "feed_mm"), [(0.0, 0.08, None), (45.0, None, 1.0)])
def test_nothing_stands_over_the_edge_or_close_outside_it(
    name: str, angle_deg: float, scallop_mm: float | None, feed_mm: float | None
) -> None:
    """(4.2) Of everything in a strip outside the edge no more is left standing over it than the scallop.

    To the border alone the walls beside the passes stay.
    """
    allowed_mm = 0.08 if feed_mm is None else R - np.sqrt(R * R - feed_mm**2)
    layout = laid(name, scallop_mm, angle_deg, feed_mm)
    edge = edge_points(PATCHES[name], 300)
    along = np.concatenate([np.gradient(side, axis=1) for side in np.split(edge[:2], 4, axis=1)], axis=1)
    across = np.stack([-along[1], along[0]]) / np.linalg.norm(along, axis=0)
    across *= np.sign(((edge[:2] - edge[:2].mean(axis=1, keepdims=True)) * across).sum(axis=0))
    outside = edge[:2] + 0.2 * across

    def left_over_mm(layout: Layout) -> float:
        centres = np.concatenate([one.plane.to_work(one.halved().halved().points) for one in layout.curves])
        away = ((outside[:, :, None] - centres[:, :2].T[:, None]) ** 2).sum(axis=0)
        floor = np.where(away < R * R, centres[:, 2] - np.sqrt(np.maximum(R * R - away, 0)), np.inf).min(axis=1)
        return float((floor - edge[2]).max())

    assert left_over_mm(layout) <= allowed_mm
    to_border = Wishes(R, np.radians(angle_deg), scallop_mm, feed_mm)
    within = lay_parallel(PATCHES[name], to_border, accuracy_mm=1e-7)
    assert left_over_mm(layout) < left_over_mm(within)


def test_over_a_level_edge_the_tip_goes_four_scallops_deep_at_most() -> None:
    """(4.2) One pick feed p outside the edge, about p^2 / 2 R below it; outside a corner up to twice as deep."""
    layout = lay_parallel(plane_patch(20.0), Wishes(R, 0.0, 0.08, None, rolls_over=True), accuracy_mm=1e-7)
    tips = np.concatenate([curve.plane.to_work(curve.points)[:, 2] - R for curve in layout.curves])
    sides = np.concatenate([curve.points[:, 1] - R for curve in layout.curves if 0 < curve.plane.offset_mm < 20])
    depth_mm = R - np.sqrt(R * R - 4 * 0.08 * (2 * R - 0.08))
    assert depth_mm == pytest.approx(4 * 0.08, rel=0.04)
    assert sides.min() == pytest.approx(-depth_mm, abs=1e-9)
    assert tips.min() >= -2 * depth_mm


@pytest.mark.parametrize("kind", ["free", "arcs", "linear"])
@pytest.mark.parametrize("name", ["thesis", "45 degrees"])
def test_pieces_of_a_pass_become_one_shape_within_its_bound(name: str, kind: Kind) -> None:
    """(4.3) Pieces join where patch and edge meet, and the whole stays within path_mm of the exact curves."""
    layout = laid(name)
    passes = shape_layout(layout, kind, 0.001)
    assert len(passes) == layout.pass_of[-1] + 1
    assert max(one.deviation_mm for one in passes) <= 0.0009 + 1e-12
    assert all(one.method is Method.SAMPLED for one in passes) or kind == "free"
    for number in (0, len(passes) // 2):
        exact = [curve for curve, one in zip(layout.curves, layout.pass_of, strict=True) if one == number]
        dense = np.concatenate([curve.refine(np.linspace(0, curve.length_mm, 2000)).points for curve in exact])
        if isinstance(passes[number].shape, PlaneSpline):
            share = np.linspace(0, 1, 200)[:, None]
            weights = np.stack([(1 - share) ** 3, 3 * share * (1 - share) ** 2, 3 * share**2 * (1 - share), share**3])
            points = np.einsum("kst,jkd->jsd", weights, bezier_points([passes[number].shape])).reshape(-1, 2)
            assert distance_mm(points, dense) <= 0.0009 + 1e-6
            assert distance_mm(dense, points) <= 0.0009 + 1e-5


def distance_mm(points: np.ndarray, dense: np.ndarray) -> float:
    """The largest distance of points (k, 2) from the dense polyline (m, 2)."""
    steps = np.diff(dense, axis=0)
    long = np.maximum((steps**2).sum(axis=1), 1e-300)
    worst = 0.0
    for part in np.array_split(points, max(len(points) // 100, 1)):
        gap = part[:, None] - dense[None, :-1]
        share = np.clip((gap * steps).sum(axis=2) / long, 0, 1)[..., None]
        worst = max(worst, float(np.sqrt(((gap - share * steps) ** 2).sum(axis=2).min(axis=1)).max()))
    return worst


def test_a_patch_that_climbs_to_its_edge_too_steeply_is_refused() -> None:
    """(4.7) The ball would turn its back on the patch; the sentence names the patch and the place."""
    with pytest.raises(InputRejected, match=r"patch 1 climbs too steeply to its edge at \(u, v\) = \("):
        lay_parallel(slope_patch(70.0), Wishes(1.0, 0.0, 0.01, None, rolls_over=True), accuracy_mm=1e-7)


def test_a_fixed_pick_feed_goes_on_as_it_is() -> None:
    """(4.2) All planes 0.9 mm apart, the outermost outside the edge by less than that."""
    layout = lay_parallel(plane_patch(20.0), Wishes(R, 0.0, None, 0.9, rolls_over=True), accuracy_mm=1e-7)
    assert np.abs(np.diff(layout.planes_mm) - 0.9).max() < 1e-9
    assert -0.9 < layout.planes_mm[0] < 0.0
    assert 20.0 < layout.planes_mm[-1] < 20.9


def left_along_normals_mm(layout: Layout, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """What the balls of all passes leave over these points along their normals (3, m), from samples of the passes."""
    curves = [one.halved().halved() for one in layout.curves]
    centres = np.concatenate([one.plane.to_work(one.points) for one in curves]).T
    left = np.full(points.shape[1], np.inf)
    for at, (point, normal) in enumerate(zip(points.T, normals.T, strict=True)):
        away = centres - point[:, None]
        ahead, square = normal @ away, (away**2).sum(axis=0) - R * R
        left[at] = np.min(ahead - np.sqrt(np.maximum(ahead**2 - square, 0)), where=ahead**2 > square, initial=np.inf)
    return left


@pytest.mark.parametrize("angle_deg", [3.0, 175.0])
def test_an_edge_that_the_patch_falls_to_is_kept_between_the_passes(angle_deg: float) -> None:
    """(4.1, 4.2) Where the normal leans outward the swing was short, and passes nearly along the edge left it early."""
    patch = plane_patch(20.0, slope_y=-1.3)
    wishes = Wishes(R, np.radians(angle_deg), 0.04, None, rolls_over=True)
    layout = lay_parallel(patch, wishes, accuracy_mm=1e-7)
    places = np.linspace(0.0, 1.0, 301)
    edge = patch.evaluate(np.ones_like(places), places).point
    normals = np.tile(np.array([[0.0], [1.3], [1.0]]) / np.hypot(1.3, 1.0), len(places))
    assert left_along_normals_mm(layout, edge, normals).max() <= 0.04 + 1e-5
