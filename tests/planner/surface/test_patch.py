"""Patch evaluation against an independent evaluator and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import NdBSpline

from planner.surface.bspline import span_basis
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import clamped, cylinder_patch, sphere_patch, thesis_patch, wavy_patch

ORDERS = {(0, 0): "point", (1, 0): "du", (0, 1): "dv", (2, 0): "duu", (1, 1): "duv", (0, 2): "dvv"}


@pytest.mark.parametrize("seed", range(5))
def test_values_and_derivatives_equal_scipy(seed: int) -> None:
    """(1.2) Random degrees, multiple knots: six arrays against scipy's NdBSpline, 5,000 points (three blocks)."""
    rng = np.random.default_rng(seed)
    degrees = rng.integers(1, 5, 2)
    knots = [np.sort(np.concatenate([clamped(7, p), rng.choice([0.3, 0.3, 0.61], 2)])) for p in degrees]
    shape = [len(knot) - p - 1 for knot, p in zip(knots, degrees, strict=True)]
    points = rng.random((*shape, 3)) * 50
    patch = NurbsPatch(int(degrees[0]), int(degrees[1]), *knots, points)
    u, v = rng.random((2, 5000))
    found, oracle = patch.evaluate(u, v), NdBSpline(tuple(knots), points, tuple(int(p) for p in degrees))
    for orders, name in ORDERS.items():
        if any(order > degree for order, degree in zip(orders, degrees, strict=True)):
            assert np.abs(getattr(found, name)).max() == 0
            continue
        wanted = oracle(np.stack([u, v], axis=1), nu=orders).T
        scale = max(np.abs(wanted).max(), 1.0)
        assert np.abs(getattr(found, name) - wanted).max() <= 1e-11 * scale


def test_basis_sums_to_one() -> None:
    """Partition of unity in every span, for uneven and multiple knots."""
    basis = span_basis(np.array([0.0, 0, 0, 0, 0.2, 0.3, 0.3, 0.7, 1, 1, 1, 1]), 3)
    sums = basis.powers.sum(axis=1)
    assert np.allclose(sums[:, 0], 1, atol=1e-13)
    assert np.abs(sums[:, 1:]).max() < 1e-11


@pytest.mark.parametrize("name", ["du", "dv"])
def test_second_derivatives_are_slopes_of_the_first(name: str) -> None:
    """Rational quotient rule against central differences on a sphere."""
    patch, step = sphere_patch(), 1e-5
    rng = np.random.default_rng(1)
    u, v = rng.uniform(0.1, 0.9, (2, 50))
    found = patch.evaluate(u, v)
    for along, second in (("u", "duu" if name == "du" else "duv"), ("v", "duv" if name == "du" else "dvv")):
        ahead, back = ((u + s, v) if along == "u" else (u, v + s) for s in (step, -step))
        slope = (getattr(patch.evaluate(*ahead), name) - getattr(patch.evaluate(*back), name)) / (2 * step)
        assert np.abs(slope - getattr(found, second)).max() < 1e-6


def test_rational_patches_are_exact_quadrics() -> None:
    rng = np.random.default_rng(2)
    u, v = rng.random((2, 1000))
    sphere = sphere_patch(25.0).evaluate(u, v).point
    assert np.abs(np.linalg.norm(sphere, axis=0) - 25).max() < 1e-12
    cylinder = cylinder_patch(30.0).evaluate(u, v).point
    assert np.abs(np.hypot(cylinder[1], cylinder[2]) - 30).max() < 1e-12


def test_end_polynomials_go_on_beyond_the_domain() -> None:
    patch = thesis_patch()
    inside = patch.evaluate(np.array([0.1, 0.2, 0.3, 0.4]), np.full(4, 0.5)).point
    cubic = np.polynomial.polynomial.polyfit([0.1, 0.2, 0.3, 0.4], inside.T, 3)
    beyond = patch.evaluate(np.array([-0.05, 1.05]), np.full(2, 0.5)).point
    assert np.abs(np.polynomial.polynomial.polyval(np.array([-0.05, 1.05]), cubic) - beyond).max() < 1e-10


def test_turned_patch_is_the_patch_turned() -> None:
    patch = wavy_patch()
    turned = patch.turned(np.radians(90)).evaluate(np.array([0.3]), np.array([0.4])).point[:, 0]
    x, y, z = patch.evaluate(np.array([0.3]), np.array([0.4])).point[:, 0]
    assert np.allclose(turned, [y, -x, z], atol=1e-12)
