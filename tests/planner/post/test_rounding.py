"""Bounds of rounding against dense sampling."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from planner.path.model import PlaneSpline
from planner.post.rounding import curve_bound_mm, poly_error
from planner.post.spans import bezier_points, power_form, raised_to_cubic

P = np.linspace(0.0, 1.0, 401)


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_bound_is_above_every_sample_and_near(seed: int) -> None:
    """The bound of an error curve is never exceeded, and at most 1.3 times its maximum (4.3, 6.9)."""
    random = np.random.default_rng(seed)
    e0, e1, d2, d3 = random.uniform(-1.0, 1.0, (4, 1, 3)) * random.choice([0.0, 1.0], (4, 1, 3))
    if not any(part.any() for part in (e0, e1, d2, d3)):
        return
    bound = curve_bound_mm(poly_error(e0, e1, d2, d3))[0]
    p = P[:, None]
    curve = e0 * (1 - p) + e1 * p + d2 * (p**2 - p) + d3 * (p**3 - p)
    worst = np.linalg.norm(curve, axis=1).max()
    assert worst <= bound * (1 + 1e-12)
    assert bound <= 1.3 * worst


@given(st.integers(0, 2**32 - 1), st.integers(1, 3), st.integers(0, 4))
@settings(max_examples=100, deadline=None)
def test_spans_trace_the_spline(seed: int, degree: int, inner: int) -> None:
    """Power forms against scipy's evaluation, double knots included (6.9)."""
    random = np.random.default_rng(seed)
    breaks = np.repeat(np.sort(random.uniform(1.0, 9.0, inner)), random.integers(1, degree + 1, inner))
    knots = np.concatenate([np.zeros(degree + 1), breaks, np.full(degree + 1, 10.0)])
    spline = PlaneSpline(degree, knots, random.uniform(-50, 50, (len(knots) - degree - 1, 2)))
    power = power_form(raised_to_cubic(bezier_points(spline)))
    distinct = np.unique(knots)
    assert len(power) == len(distinct) - 1
    reference = BSpline(knots, spline.control_points, degree)
    for coefficients, low, high in zip(power, distinct, distinct[1:], strict=False):
        p = np.linspace(0.0, 1.0, 11)
        points = sum(coefficients[k] * p[:, None] ** k for k in range(4))
        assert np.allclose(points, reference(low + p * (high - low)), atol=1e-9)
