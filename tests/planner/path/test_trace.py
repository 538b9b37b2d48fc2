"""Traced curves lie on plane and offset surface, at any arc length, and end where the border wants them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from planner.path.curve import CurveTable
from planner.path.strategy.parallel import Wishes, lay_parallel
from planner.surface.load import load_surface
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import (
    clamped,
    cone_patch,
    cylinder_patch,
    plane_patch,
    slope_patch,
    sphere_patch,
    thesis_patch,
    wavy_patch,
)

PATCHES = {
    "thesis 35": thesis_patch(),
    "thesis 30": thesis_patch(30),
    "wavy": wavy_patch(),
    "45 degrees": slope_patch(),
    "plane": plane_patch(),
    "cylinder": cylinder_patch(),
    "sphere": sphere_patch(),
    "cone": cone_patch(),
}


@pytest.mark.parametrize("angle_deg", [0.0, 37.0, 90.0])
@pytest.mark.parametrize("name", PATCHES)
def test_every_point_is_the_ball_touching_the_surface_in_the_plane(name: str, angle_deg: float) -> None:
    """(1.2) |CL - CC| = R along the normal, CL in the plane, tangent and curvature as the points themselves say."""
    patch = PATCHES[name]
    layout = lay_parallel(patch, Wishes(4.0, np.radians(angle_deg), None, 3.0), accuracy_mm=1e-7)
    for curve in layout.curves[:: max(len(layout.curves) // 3, 1)]:
        arc = np.linspace(0, curve.length_mm, 3000)
        samples = curve.refine(arc)
        contact = patch.evaluate(*samples.parameters.T)
        centres = curve.plane.to_work(samples.points).T
        normal = np.cross(contact.du, contact.dv, axis=0)
        normal *= np.sign(normal[2]) / np.linalg.norm(normal, axis=0)
        assert np.abs(contact.point + 4.0 * normal - centres).max() < 2e-10
        step = np.diff(samples.points, axis=0)
        chord = np.hypot(*step.T)
        assert abs(chord.sum() - curve.length_mm) < 1e-4 * curve.length_mm
        middle = (samples.tangents[1:] + samples.tangents[:-1]) / 2
        assert np.abs(step / chord[:, None] - middle / np.hypot(*middle.T)[:, None]).max() < 1e-4
        turn = np.diff(np.arctan2(samples.tangents[:, 1], samples.tangents[:, 0])) / chord
        assert np.abs(turn - (samples.curvatures[1:] + samples.curvatures[:-1]) / 2).max() < 2e-3


def test_refine_returns_the_nodes_at_their_arc_lengths() -> None:
    layout = lay_parallel(thesis_patch(), Wishes(4.0, 0.0, None, 5.0), accuracy_mm=1e-7)
    curve = layout.curves[2]
    again = curve.refine(curve.arc_mm)
    assert np.abs(again.points - curve.points).max() < 1e-10
    assert np.abs(again.curvatures - curve.curvatures).max() < 1e-8


@pytest.mark.parametrize("reading_mm", [1e-5, 5e-6])
def test_nodes_stand_close_enough_to_read_sharp_bends_between_them(reading_mm: float) -> None:
    """(4.3) On a steep wavy patch passes are read between nodes about as exactly as asked, arc lengths to 1e-4.

    Evenly spaced nodes were 1.5 um off here, and so was the program made from what was read.
    """
    wishes = Wishes(4.0, 0.0, None, 12.0)
    layout = lay_parallel(wavy_patch(1, size_mm=60.0, height_mm=1.6), wishes, accuracy_mm=1e-7, reading_mm=reading_mm)
    table = CurveTable(layout.curves)
    for row, curve in enumerate(layout.curves):
        for share in (0.25, 0.5, 0.75):
            arc = curve.arc_mm[:-1] + share * np.diff(curve.arc_mm)
            exact = curve.refine(arc)
            away = table.read(np.array([row]), arc[:, None])[0][:, :, 0].T - exact.points
            off = away[:, 1] * exact.tangents[:, 0] - away[:, 0] * exact.tangents[:, 1]
            assert np.abs(off).max() < 4 * reading_mm
        fine = curve.refine((curve.arc_mm[:-1, None] + np.diff(curve.arc_mm)[:, None] * np.linspace(0, 1, 65)).ravel())
        chords = np.hypot(*np.diff(fine.points.reshape(-1, 65, 2), axis=1).transpose(2, 0, 1)).sum(axis=1)
        assert np.abs(chords / np.diff(curve.arc_mm) - 1).max() < 1e-4


def test_a_plane_is_traced_as_its_parallel() -> None:
    """Closed form: over z = y tan a the CL plane is R / cos a higher; the pass is straight."""
    slope = np.tan(np.radians(30))
    layout = lay_parallel(plane_patch(20.0, slope), Wishes(4.0, 0.0, None, 2.0), accuracy_mm=1e-7)
    for curve in layout.curves:
        height = slope * curve.plane.offset_mm + 4.0 / np.cos(np.radians(30))
        assert np.abs(curve.points[:, 1] - height).max() < 1e-10
        assert np.abs(curve.curvatures).max() < 1e-10


def test_a_horseshoe_is_cut_in_two_branches_a_plane() -> None:
    """Planes that meet the patch twice give two passes; none crosses the hole."""
    layout = lay_parallel(horseshoe(), Wishes(2.0, 0.0, None, 1.5), accuracy_mm=1e-7)
    ends = [(curve.plane.offset_mm, curve.points[0, 0], curve.points[-1, 0]) for curve in layout.curves]
    low = [end for end in ends if end[0] < 15]
    assert len(low) == 2 * len({end[0] for end in low})
    for _, start, stop in low:
        assert stop < -9.9 or start > 9.9
    assert len([end for end in ends if end[0] > 21]) == len({end[0] for end in ends if end[0] > 21})


def horseshoe() -> NurbsPatch:
    """A flat half ring, radii 20 and 30 about (0, 0), y >= 0, with straight legs: a rational patch, z = 0."""
    half = np.sqrt(0.5)
    ring = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0]], dtype=float)
    weights = np.array([1, half, 1, half, 1])
    points = np.stack([np.column_stack([radius * ring, np.zeros(5)]) for radius in (20.0, 30.0)])
    knots = np.array([0, 0, 0, 1, 1, 2, 2, 2], dtype=float)
    return NurbsPatch(1, 2, np.array([0.0, 0, 1, 1]), knots, points, np.stack([weights, weights]))


def test_a_pass_stays_on_its_fold_behind_the_border() -> None:
    """(4.7) Carried on beyond its border this patch folds over; nodes found on another fold ended the plan."""
    (patch,) = load_surface(Path(__file__).parents[1] / "data/folds-behind.toml")
    curves = lay_parallel(patch, Wishes(4.0, 0.0, 0.08 - 0.04 / 3.92, None), accuracy_mm=1e-6, reading_mm=1e-4).curves
    sizes = np.ptp(patch.domain, axis=1)
    for curve in curves:
        steps = np.abs(np.diff(curve.parameters, axis=0)) / sizes
        assert steps.max() < 0.2
        assert np.abs(np.diff(curve.points[:, 1])).max() < 1.5 * np.diff(curve.points[:, 0]).max()


@pytest.mark.parametrize("rise_mm", [0.0, 6.0])
def test_no_pass_crosses_the_slot_between_two_legs(rise_mm: float) -> None:
    """(4.7) Across a U whose legs end 6 mm apart: level legs were joined over whatever stands there, others refused."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, 7)
    rows = []
    for radius in (12.0, 22.0):
        legs = [[-x, radius - 9 * (x - 8) / 42] for x in np.linspace(8, 50, 6)]
        rows.append([[x, -y] for x, y in legs[::-1]] + [[radius * np.cos(a), radius * np.sin(a)] for a in turn] + legs)
    climb = np.concatenate([np.zeros(6), np.arange(7.0) / 6, np.ones(6)])
    heights = np.broadcast_to(rise_mm * climb, (2, 19))
    points = np.concatenate([np.array(rows), heights[..., None]], axis=2)
    patch = NurbsPatch(1, 3, np.array([0.0, 0, 1, 1]), clamped(19), points)
    curves = lay_parallel(patch, Wishes(2.0, np.pi / 2, None, 3.9), accuracy_mm=1e-7).curves
    assert len(curves) > 30
    for curve in curves:
        assert np.abs(np.diff(curve.parameters[:, 1])).max() < 0.2


def test_a_pass_goes_on_over_the_seam_of_a_closed_patch() -> None:
    """A flat ring that closes upon itself at y = 0, x > 0: passes across the seam are not cut in two there."""
    half = np.sqrt(0.5)
    ring = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
    weights = np.tile([1, half, 1, half, 1, half, 1, half, 1], (2, 1))
    points = np.stack([np.column_stack([radius * ring, np.zeros(9)]) for radius in (10.0, 25.0)])
    knots = np.array([0.0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4])
    patch = NurbsPatch(1, 2, np.array([0.0, 0, 1, 1]), knots, points, weights)
    curves = lay_parallel(patch, Wishes(2.0, np.pi / 2, None, 2.0), accuracy_mm=1e-7).curves
    over = [curve for curve in curves if 12 < abs(curve.plane.offset_mm) < 23]
    assert len(over) == len({curve.plane.offset_mm for curve in over})


def test_a_pass_goes_on_over_a_hollow_of_the_border() -> None:
    """A plate with one side hollowed 2 mm deep: the extended patch lies in the hollow, so passes are not cut there."""
    x, y = np.meshgrid(np.linspace(0.0, 40, 7), np.linspace(0.0, 30, 4))
    y[0, 2:5] += [2.0, 3.0, 2.0]
    patch = NurbsPatch(3, 3, clamped(4), clamped(7), np.stack([x, y, np.zeros_like(x)], axis=2))
    curves = lay_parallel(patch, Wishes(2.0, 0.0, None, 3.0), accuracy_mm=1e-7).curves
    assert len(curves) == len({curve.plane.offset_mm for curve in curves})
