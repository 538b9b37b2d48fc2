"""The change of curvature along passes of a patch much longer than wide: bounded, and never too narrowly."""

from __future__ import annotations

from functools import cache

import numpy as np

from planner.path.bound import certify_all
from planner.path.model import DrivingPlane, Method
from planner.path.slope_range import slope_source
from planner.path.spline import fit_heights
from planner.path.strategy.parallel import Wishes, prepare
from planner.path.trace import TracedCurve, trace
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import clamped

LONG_MM, WIDE_MM, PITCH_MM = 4800.0, 60.0, 5.0


@cache
def long_passes() -> tuple[TracedCurve, ...]:
    """Three passes along waves of 4800 x 60 mm."""
    counts = [round(size / PITCH_MM) for size in (WIDE_MM, LONG_MM)]
    u, v = (clamped(count) for count in counts)
    y, x = np.meshgrid(
        *(
            size * np.array([knots[i + 1 : i + 4].mean() for i in range(count)])
            for size, knots, count in zip((WIDE_MM, LONG_MM), (u, v), counts, strict=True)
        ),
        indexing="ij",
    )
    patch = NurbsPatch(3, 3, u, v, np.stack([x, y, 5 * np.sin(x / 20) * np.cos(y / 15)], axis=2))
    ground = prepare(patch, Wishes(4.0, 0.0, None, 1.0))
    planes = [DrivingPlane(0.0, plane) for plane in (8.0, 30.0, 47.0)]
    runs = np.tile([2.0, LONG_MM - 2.0], (3, 1))
    return tuple(trace(ground.surface, ground.seeds, planes, runs, spacing_mm=2.0, accuracy_mm=1e-5))


def test_a_long_patch_bounds_its_passes_between_all_nodes() -> None:
    """(4.3, 4.5) Boxes as narrow as a step's share of 4800 mm were left sideways, and nothing was bounded there."""
    curves = long_passes()
    source = slope_source(curves)
    rows = np.repeat(np.arange(3), [curve.arc_mm.size - 1 for curve in curves])
    left, right = (np.concatenate([curve.arc_mm[part] for curve in curves]) for part in (slice(-1), slice(1, None)))
    low, high, _ = source.enclose(rows, left, right)
    assert np.isfinite(high - low).all()


def test_its_bounds_hold_what_the_passes_do() -> None:
    """(4.3) Difference quotients of the curvature lie between them, also over small parts of a node's interval."""
    curves = long_passes()
    source = slope_source(curves)
    for row, curve in enumerate(curves):
        arc = np.linspace(0.5, curve.length_mm - 0.5, 5000)
        one, other = curve.refine(arc), curve.refine(arc + 1e-3)
        slope = (other.curvatures - one.curvatures) / 1e-3
        # The middle decides which interval between nodes is meant: places that a node parts are left out.
        is_one = np.searchsorted(curve.arc_mm, arc) == np.searchsorted(curve.arc_mm, arc + 1e-3)
        low, high, _ = source.enclose(np.full(arc.size, row), arc, arc + 1e-3)
        assert (slope >= low - 1e-7)[is_one].all()
        assert (slope <= high + 1e-7)[is_one].all()


def test_splines_over_a_long_patch_are_proved() -> None:
    """(4.3) They were bounded by samples only, after a search among 300,000 nodes."""
    curves = long_passes()
    fits = fit_heights(curves, 0.001)
    assert [fit.method for fit in fits if fit] == [Method.PROVED] * 3
    bounds = certify_all(curves, [fit.spline for fit in fits if fit])
    assert max(bound_mm for bound_mm, _ in bounds) <= 0.001
