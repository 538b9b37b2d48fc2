"""The passes as they are traced, from end to end, leave nothing above what was asked anywhere on the patch."""

from __future__ import annotations

import numpy as np
import pytest

from planner.path.coverage import crossings
from planner.path.strategy.parallel import Layout, Wishes, lay_parallel, prepare
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import clamped, thesis_patch, wavy_patch

R = 4.0


def skewed(lean: float) -> NurbsPatch:
    """A level parallelogram whose sides lean: corners reach far beyond where the first and last pass cross it."""
    y, x = np.meshgrid([0.0, 10.0], [0.0, 30.0], indexing="ij")
    knots = np.array([0.0, 0, 1, 1])
    return NurbsPatch(1, 1, knots, knots, np.stack([x + lean * y, y + 0.04 * x, 0 * x], axis=2))


def lens() -> NurbsPatch:
    """Two round sides that meet in blunt ends, domed: its sides bend away from every pass."""
    share = np.linspace(0.0, 1.0, 7)
    x, y = np.meshgrid(30 * share, np.linspace(-1.0, 1.0, 4))
    half = 2 + 28 * share * (1 - share)
    return NurbsPatch(3, 3, clamped(4), clamped(7), np.stack([x, y * half, -(y**2)], axis=2))


def left_mm(layout: Layout, count: int = 50) -> np.ndarray:
    """Heights over a net of the patch, border and corners included, that the balls of all traced curves leave."""
    (u_low, u_high), (v_low, v_high) = layout.ground.surface.patch.domain
    u, v = (part.ravel() for part in np.meshgrid(np.linspace(u_low, u_high, count), np.linspace(v_low, v_high, count)))
    under = layout.ground.surface.evaluate(u, v)
    lowest = np.full(len(u), np.inf)
    for curve in layout.curves:
        centres = curve.refine(np.linspace(0.0, curve.length_mm, int(curve.length_mm / 0.1) + 2)).points
        near = np.flatnonzero(np.abs(under.centre[1] - curve.plane.offset_mm) < 2.0)
        away = np.stack([centres[:, 0], np.full(len(centres), curve.plane.offset_mm), centres[:, 1]])[:, None]
        away = away - under.contact[:, near, None]
        along = (away * under.normal[:, near, None]).sum(axis=0)
        inside = R**2 - (away**2).sum(axis=0) + along**2
        entry = np.where(inside >= 0, along - np.sqrt(np.maximum(inside, 0.0)), np.inf)
        lowest[near] = np.minimum(lowest[near], entry.min(axis=1))
    return lowest


@pytest.mark.parametrize(
    ("patch", "angle_deg"),
    [(skewed(1.0), 0.0), (skewed(-2.0), 0.0), (lens(), 0.0), (lens(), 70.0), (thesis_patch(), 28.0)],
    ids=["skewed", "skewed more", "lens along", "lens across", "thesis"],
)
def test_nothing_stands_higher_than_asked_up_to_every_corner(patch: NurbsPatch, angle_deg: float) -> None:
    """(4.1) Balls 0.1 mm apart leave up to 0.3 um more than the whole pass."""
    layout = lay_parallel(patch, Wishes(R, np.radians(angle_deg), 0.08, None), accuracy_mm=1e-7)
    assert left_mm(layout).max() < 0.08 + 4e-4


def test_passes_cross_a_round_border_where_it_is() -> None:
    """Not where the chord between two samples is: on a level part at x = 2 - 8 t + 9 t^2, y = 12 t + 8 t^2."""
    ends = np.array([[2.0, -2.0, 3.0], [20.0, 20.0, 20.0]]).T
    points = np.stack([ends, np.stack([[0.0, 6.0, 20.0]] * 2, axis=1), np.zeros((3, 2))], axis=2)
    patch = NurbsPatch(2, 1, np.array([0.0, 0, 0, 1, 1, 1]), np.array([0.0, 0, 1, 1]), points)
    ground = prepare(patch, Wishes(R, 0.0, None, 1.9))
    planes_mm = np.array([1.0, 7.0, 13.3])
    passes, x, parameters = crossings(ground.surface, ground.border, planes_mm)
    t = (np.sqrt(144 + 32 * planes_mm[passes]) - 12) / 16
    assert np.abs(x - np.where(x < 10, 2 - 8 * t + 9 * t**2, 20.0)).max() < 1e-9
    assert np.abs(parameters[0] - t).max() < 1e-9


def test_the_last_pass_is_drawn_back_until_it_just_keeps_the_border() -> None:
    """(4.2) Where no side of the patch lies wholly behind the pass before, the border behind the last is as asked."""
    for patch, angle_deg in ((thesis_patch(), 28.0), (wavy_patch(4, size_mm=40.0, height_mm=0.5), 45.0), (lens(), 0.0)):
        layout = lay_parallel(patch, Wishes(R, np.radians(angle_deg), 0.08, None), accuracy_mm=1e-7)
        assert layout.peaks.last_mm == pytest.approx(0.08, abs=1e-6)
