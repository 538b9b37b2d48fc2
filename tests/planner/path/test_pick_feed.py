"""Pick feeds: the reference numbers, the exact target in every gap, and the paper's own scheme."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import fsolve, minimize_scalar

from planner.errors import InputRejected
from planner.path.coverage import border_heights
from planner.path.model import DrivingPlane
from planner.path.offset import OffsetSurface
from planner.path.peaks import survey
from planner.path.pick_feed import Brackets, _brackets
from planner.path.strategy.parallel import Layout, Wishes, lay_parallel
from planner.path.trace import trace
from planner.surface.load import load_surface
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import cylinder_patch, plane_patch, slope_patch, sphere_patch, thesis_patch, wavy_patch

R = 4.0


def planned(patch: NurbsPatch, scallop_mm: float, angle_deg: float = 0.0) -> Layout:
    return lay_parallel(patch, Wishes(R, np.radians(angle_deg), scallop_mm, None), accuracy_mm=1e-8)


@pytest.mark.parametrize(
    ("scallop_mm", "count", "first", "last", "length_mm"),
    [
        (0.08, 32, (1.7418, 3.2955, 4.8613, 6.4333), 49.6810, 1576.90),
        (0.01, 88, (1.2249, 1.7709, 2.3204, 2.8724), 49.7356, 4337.16),
    ],
)
def test_reference_numbers(
    scallop_mm: float, count: int, first: tuple[float, ...], last: float, length_mm: float
) -> None:
    """(4.2) Thesis surface, R 4, planes y = const: places of the passes, their number and their length, v in [0, 1].

    The reference is printed to 0.1 um of a millimetre's fourth decimal, hence 0.06 um of rounding beside the 1 um.
    """
    layout = planned(thesis_patch(), scallop_mm)
    assert len(layout.planes_mm) == count
    assert np.abs(layout.planes_mm[:4] - first).max() < 1e-4
    assert abs(layout.planes_mm[-1] - last) < 1e-4
    assert abs(length_within_v(layout) - length_mm) < 0.005
    if scallop_mm == 0.08:
        assert abs(np.diff(layout.planes_mm).max() - 1.5808) < 1e-4


@pytest.mark.parametrize("ridge_mm", [1.0, 5.0, 30.0])
def test_passes_that_are_too_high_keep_the_scallop_on_any_ridge(ridge_mm: float) -> None:
    """(4.1) Balls raised by the budget leave on a ridge (a cylinder along the passes) what was asked, and no less.

    Taken as on level ground the budget was too small on a sharp ridge: 80.08 um of 80 at 1 mm.
    """
    high_mm, patch = 0.001, cylinder_patch(ridge_mm, half_angle_deg=60.0)
    layout = lay_parallel(patch, Wishes(R, 0.0, 0.08, None, high_mm=high_mm), accuracy_mm=1e-8)
    half_rad = np.diff(np.arcsin(layout.planes_mm / (ridge_mm + R))) / 2

    def height_mm(too_high_mm: float) -> np.ndarray:
        out_mm = ridge_mm + R + too_high_mm
        return out_mm * np.cos(half_rad) - np.sqrt(R**2 - (out_mm * np.sin(half_rad)) ** 2) - ridge_mm

    assert len(half_rad) >= 2
    assert np.abs(layout.peaks.height_mm - height_mm(0.0)).max() < 1e-7
    assert 0.08 - 0.05 * high_mm < height_mm(high_mm)[:-1].max() <= 0.08 + 1e-7


@pytest.mark.parametrize(("ridge_mm", "half_angle_deg"), [(1.0, 60.0), (1.0, 80.0), (1.5, 80.0)])
def test_a_round_ridge_is_planned_to_its_end(ridge_mm: float, half_angle_deg: float) -> None:
    """(4.7) The last pass was tried beyond the ridge, where no ball touches it, and "did not settle" ended the job."""
    layout = planned(cylinder_patch(ridge_mm, half_angle_deg=half_angle_deg), 0.08)
    assert np.abs(layout.peaks.height_mm[:-1] - 0.08).max() < 1e-7
    assert layout.peaks.height_mm[-1] < 0.08 + 1e-7
    assert max(layout.peaks.first_mm, layout.peaks.last_mm) < 0.08 + 1e-7


SURFACES = {
    "thesis 35": thesis_patch(),
    "thesis 30": thesis_patch(30),
    "wavy": wavy_patch(4, size_mm=40.0, height_mm=0.5),
    "45 degrees": slope_patch(),
    "cylinder": cylinder_patch(),
    "sphere": sphere_patch(),
}


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize(("scallop_mm", "angle_deg"), [(0.08, 0.0), (0.02, 90.0), (0.05, 28.0)])
def test_every_gap_reaches_the_target_and_none_exceeds_it(name: str, scallop_mm: float, angle_deg: float) -> None:
    """(4.1) 99.5 to 100 % of the target between every two neighbours, the last gap less; the border within it too."""
    layout = planned(SURFACES[name], scallop_mm, angle_deg)
    heights = layout.peaks.height_mm
    assert heights.max() <= scallop_mm + 2e-8
    assert layout.peaks.first_mm <= scallop_mm + 2e-8
    assert layout.peaks.last_mm <= scallop_mm + 2e-8
    inner = heights[:-1][heights[:-1] > 0]
    assert len(inner) >= len(heights) - 3, "at most the first and last gaps may miss the patch"
    assert inner.min() >= 0.995 * scallop_mm


@pytest.mark.parametrize(("seed", "scallop_mm", "angle_deg"), [(1, 0.08, 45.0), (1, 0.01, 28.0), (4, 0.08, 28.0)])
def test_no_maximum_hides_between_two_stations(seed: int, scallop_mm: float, angle_deg: float) -> None:
    """(4.1) Ten times as many stations find nothing higher; the first of these once hid 0.53 um."""
    layout = planned(wavy_patch(seed, size_mm=40.0, height_mm=0.5), scallop_mm, angle_deg)
    dense = replace(layout.ground, station_mm=layout.ground.station_mm / 10)
    assert survey(dense, layout.planes_mm, scallop_mm)[0].height_mm.max() <= (1 + 1e-4) * scallop_mm


def test_fine_scallops_on_a_wavy_surface_at_an_odd_angle() -> None:
    """(4.1) 0.005 mm: maxima that outdo each other in turn are all kept in sight."""
    layout = planned(wavy_patch(4, size_mm=40.0, height_mm=0.5), 0.005, 28.0)
    inner = layout.peaks.height_mm[:-1][layout.peaks.height_mm[:-1] > 0]
    assert 0.995 * 0.005 <= inner.min() <= inner.max() <= 0.005 + 2e-8


def test_the_scheme_of_the_paper_gives_the_same_next_pass() -> None:
    """(4.2) Equations 3.25-3.27: the place on pass A where the height is h_tol leads to the next pass's centre."""
    layout = planned(wavy_patch(4, height_mm=0.6), 0.08)
    for gap in np.flatnonzero((layout.peaks.x > 8) & (layout.peaks.x < 52))[[2, 9]]:
        before, after = layout.planes_mm[gap : gap + 2]
        next_plane = paper_next_plane(layout.ground.surface, before, 0.08, layout.peaks.x[gap])
        assert abs(next_plane - after) < 1e-6


@pytest.mark.parametrize("scallop_mm", [0.08, 0.01])
def test_the_scheme_of_the_paper_gives_the_same_list_of_passes(scallop_mm: float) -> None:
    """(4.2) Thesis surface, from the first pass on, each next one placed by (3.25)-(3.27): within 1 um in y.

    Every cusp line is highest at one of its ends here, v = 0 or v = 1; the nearer plane of the two is the next.
    """
    layout = planned(thesis_patch(), scallop_mm)
    plane_mm = float(layout.planes_mm[0])
    for found_mm in layout.planes_mm[1:-1]:
        plane_mm = min(paper_plane_from_border(layout.ground.surface, plane_mm, scallop_mm, v) for v in (0.0, 1.0))
        assert abs(plane_mm - found_mm) < 1e-3


def test_a_floor_that_the_ceiling_comes_down_to_is_given_up() -> None:
    """(4.7) Seen while the lower pass stood a trifle elsewhere, it held a gap at a feed too wide for ever."""
    layout = lay_parallel(plane_patch(20.0), Wishes(R, 0.0, None, 2.0), accuracy_mm=1e-7)
    planes_mm, peaks = layout.planes_mm, layout.peaks
    feeds, open_ = np.diff(planes_mm), np.full(len(planes_mm) - 1, np.inf)
    peaks = replace(peaks, first_mm=0.08)
    assert peaks.height_mm[0] > 0.08
    near, far = (_brackets(Brackets(share * feeds, open_), planes_mm, peaks, 0.08, 1e-7) for share in (1 - 1e-9, 0.9))
    assert (near.floor_mm[0], near.ceiling_mm[0]) == (0.0, feeds[0])
    assert (far.floor_mm[0], far.ceiling_mm[0]) == (0.9 * feeds[0], feeds[0])


@pytest.mark.parametrize("pick_feed_mm", [0.7, 1.0, 3.0, 19.0, 50.0])
def test_fixed_passes_stand_in_the_middle_of_the_patch(pick_feed_mm: float) -> None:
    """As far from one side as from the other, and no further than half a pick feed."""
    planes_mm = lay_parallel(plane_patch(20.0), Wishes(R, 0.0, None, pick_feed_mm), accuracy_mm=1e-7).planes_mm
    assert np.allclose(np.diff(planes_mm), pick_feed_mm)
    assert planes_mm[0] == pytest.approx(20.0 - planes_mm[-1])
    assert planes_mm[0] <= pick_feed_mm / 2 + 1e-9


def test_one_pass_is_enough_for_a_narrow_patch() -> None:
    layout = planned(plane_patch(0.6), 0.05)
    assert len(layout.planes_mm) == 1
    assert max(layout.peaks.first_mm, layout.peaks.last_mm) <= 0.05 + 1e-8


def test_a_cusp_line_that_leaves_the_patch_and_comes_back_is_judged_inside_only() -> None:
    """(4.1) Two stretches of one gap: what lies between them, outside the border, does not count."""
    steep = thesis_patch()
    points = steep.control_points.copy()
    points[2, 2, 2] = -40.0
    layout = planned(NurbsPatch(3, 3, steep.knots_u, steep.knots_v, points), 0.079)
    assert layout.peaks.height_mm.max() <= 0.079 + 2e-8
    assert layout.peaks.foot.min() >= 0
    assert layout.peaks.foot.max() <= 1


def length_within_v(layout: Layout) -> float:
    """Length of all passes between v = 0 and v = 1, on the extended patch where u leaves it."""
    surface, seeds = layout.ground.surface, layout.ground.seeds
    runs = np.array([[x_at(surface, y, 0.0), x_at(surface, y, 1.0)] for y in layout.planes_mm])
    planes = [DrivingPlane(0.0, float(y)) for y in layout.planes_mm]
    return sum(curve.length_mm for curve in trace(surface, seeds, planes, runs, spacing_mm=1.0, accuracy_mm=1e-5))


def test_a_border_that_no_last_pass_finishes_is_refused() -> None:
    """(4.7) Where the patch stands too steep at its end for any pass to bring the border down, one sentence says so."""
    knots = np.array([0.0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 6, 6, 6])
    x, y = np.meshgrid(10.0 * np.arange(9), 10.0 * np.arange(9), indexing="ij")
    patch = NurbsPatch(3, 3, knots, knots, np.stack([x, y, 20 * np.sin(x / 6.5) * np.cos(y / 6.5)], axis=-1))
    with pytest.raises(InputRejected, match="no last pass brings the border behind it down to the asked scallop"):
        lay_parallel(patch, Wishes(3.0, 0.0, 0.05, None), accuracy_mm=5e-8)


def x_at(surface: OffsetSurface, y_mm: float, v: float) -> float:
    u = np.array([y_mm / 50])
    for _ in range(30):
        found = surface.evaluate(u, np.array([v]))
        u = u + (y_mm - found.centre[1]) / found.centre_u[1]
    return float(found.centre[0, 0])


def paper_next_plane(surface: OffsetSurface, plane_mm: float, scallop_mm: float, x_max: float) -> float:
    """The least next plane over all places of pass A near the worst one, solved point by point."""

    def at(u: float, v: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        found = surface.evaluate(np.array([u]), np.array([v]))
        return found.contact[:, 0], found.normal[:, 0], found.centre[:, 0]

    def centre_on(x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        u, v = solved(lambda p: at(*p)[2][:2] - [x, y], [y / 60, x / 60])
        _, normal, centre = at(u, v)
        return centre, np.array([normal[2], 0, -normal[0]]) / np.hypot(normal[0], normal[2])

    def next_plane(x: float) -> float:
        centre, tangent = centre_on(x, plane_mm)
        side = np.array([0.0, 1.0, 0.0])
        down = np.cross(tangent, side)
        down *= -np.sign(down[2])

        def cusp_misses(unknowns: np.ndarray) -> np.ndarray:
            theta, u, v = unknowns
            contact, normal, _ = at(u, v)
            return centre + R * (np.cos(theta) * down + np.sin(theta) * side) - contact - scallop_mm * normal

        theta = solved(cusp_misses, [0.2, plane_mm / 60 + 0.01, x / 60])[0]
        cusp = centre + R * (np.cos(theta) * down + np.sin(theta) * side)

        def ball_misses(parameters: np.ndarray) -> list[float]:
            _, normal, other = at(*parameters)
            away = cusp - other
            return [away @ away - R**2, away[0] * normal[2] - away[2] * normal[0]]

        u, v = solved(ball_misses, [(plane_mm + 1.6) / 60, x / 60])
        return float(at(u, v)[2][1])

    reach = (x_max - 2.0, x_max + 2.0)
    inner = minimize_scalar(next_plane, bounds=reach, method="bounded", options={"xatol": 1e-9})
    return float(inner.fun)


def paper_plane_from_border(surface: OffsetSurface, plane_mm: float, scallop_mm: float, v: float) -> float:
    """The next plane from the point of the border at this v that pass A leaves at the scallop height."""

    def ball(u: float, v: float) -> tuple[np.ndarray, np.ndarray]:
        found = surface.evaluate(np.array([u]), np.array([v]))
        return found.centre[:, 0], found.normal[:, 0]

    def off_the_pipe(cusp: np.ndarray, u: float, v: float) -> tuple[float, float, float]:
        centre, normal = ball(u, v)
        away = cusp - centre
        return away @ away - R**2, away[0] * normal[2] - away[2] * normal[0], centre[1]

    def cusp_at(u: float) -> np.ndarray:
        centre, normal = ball(u, v)
        return centre + (scallop_mm - R) * normal

    def misses_a(unknowns: np.ndarray) -> list[float]:
        distance, foot, y = off_the_pipe(cusp_at(unknowns[0]), *unknowns[1:])
        return [distance, foot, y - plane_mm]

    half = np.sqrt(2 * R * scallop_mm)
    near_u = plane_mm / 50
    u, _, _ = solved(misses_a, [near_u + half / 50, near_u, v])
    cusp = cusp_at(u)
    u, w = solved(lambda p: off_the_pipe(cusp, *p)[:2], [u + half / 50, v])
    return float(ball(u, w)[0][1])


def solved(misses: Callable[[np.ndarray], Any], start: list[float]) -> np.ndarray:
    found, state, _, _ = fsolve(misses, start, xtol=1e-13, full_output=True)
    assert np.abs(state["fvec"]).max() < 1e-9
    return found


@pytest.mark.parametrize(
    ("name", "radius_mm", "scallop_mm", "angle_deg"),
    [("pole-nearby", 3.0, 0.005, 270.0), ("cusps-along-a-side", 4.0, 0.03, 90.0)],
)
def test_what_lies_beyond_the_border_keeps_no_patch_from_being_planned(
    name: str, radius_mm: float, scallop_mm: float, angle_deg: float
) -> None:
    """(4.1, 4.7) Neither a pole of the extended patch nor a place lost in the first wide search."""
    (patch,) = load_surface(Path(__file__).parents[1] / "data" / f"{name}.toml")
    layout = lay_parallel(patch, Wishes(radius_mm, np.radians(angle_deg), scallop_mm, None), accuracy_mm=1e-8)
    assert np.ptp(layout.ground.seeds.centres, axis=1).max() < 60.0
    assert layout.peaks.missed == 0
    assert np.allclose(layout.peaks.height_mm[:-1], scallop_mm, atol=1e-7)


def test_a_border_that_one_pass_alone_reaches_keeps_the_scallop() -> None:
    """(4.1) Behind a side this patch folds over and passes end there: 116 um stood where 80 were asked.

    Every point of the border between two passes, by the pass that leaves less; a cusp line ends where both leave the
    same, so that nothing else of a gap stands higher there.
    """
    (patch,) = load_surface(Path(__file__).parents[1] / "data/folds-over-a-side.toml")
    layout = lay_parallel(patch, Wishes(6.0, np.radians(156.6575912728581), 0.0789, None), accuracy_mm=1e-6)
    heights = border_heights(layout.ground.surface, layout.ground.border, layout.planes_mm)
    is_inner = (heights.gap > 0) & (heights.gap < len(layout.planes_mm))
    least = np.minimum(heights.below, heights.above)[is_inner]
    assert np.isinf(heights.below[is_inner]).sum() > 10
    assert least.max() <= 0.0789 + 2e-6
