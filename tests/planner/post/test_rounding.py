"""Bounds of rounding against dense sampling."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from planner.path.model import PlaneSpline
from planner.path.spans import bezier_points, joints_of, power_form, raised_to_cubic
from planner.post.rounding import SpanChain, curve_bound_mm, path_bound_mm, polyline_bound_mm
from tests.planner.post.paths import distance_mm, spline

P = np.linspace(0.0, 1.0, 401)
SEED = st.integers(0, 2**32 - 1)


@settings(max_examples=200, deadline=None)
@given(SEED)
def test_bound_is_above_every_sample_and_near(seed: int) -> None:
    """The bound of an error curve is never exceeded, and at most 1.5 times its maximum (4.3, 6.9)."""
    error = np.random.default_rng(seed).uniform(-1.0, 1.0, (1, 4, 3))
    worst = np.linalg.norm(sum(error[:, k] * P[:, None] ** k for k in range(4)), axis=1).max()
    assert worst <= curve_bound_mm(error)[0] * (1 + 1e-12)
    assert curve_bound_mm(error)[0] <= 1.5 * worst


@given(SEED, st.integers(1, 3), st.integers(0, 4))
@settings(max_examples=100, deadline=None)
def test_spans_trace_the_spline(seed: int, degree: int, inner: int) -> None:
    """Power forms against scipy's evaluation, double knots included (6.9)."""
    random = np.random.default_rng(seed)
    breaks = np.repeat(np.sort(random.uniform(1.0, 9.0, inner)), random.integers(1, degree + 1, inner))
    knots = np.concatenate([np.zeros(degree + 1), breaks, np.full(degree + 1, 10.0)])
    made = PlaneSpline(degree, knots, random.uniform(-50, 50, (len(knots) - degree - 1, 2)))
    power = power_form(raised_to_cubic(bezier_points([made])))
    distinct = np.unique(knots)
    assert len(power) == len(distinct) - 1
    assert np.allclose(np.diff(joints_of(made)), np.diff(distinct))
    reference = BSpline(knots, made.control_points, degree)
    for coefficients, low, high in zip(power, distinct, distinct[1:], strict=False):
        p = np.linspace(0.0, 1.0, 11)
        points = sum(coefficients[k] * p[:, None] ** k for k in range(4))
        assert np.allclose(points, reference(low + p * (high - low)), atol=1e-9)


def _chain(seed: int, inner: int) -> SpanChain:
    made = spline(seed, inner=inner)
    bezier = bezier_points([made])
    work = np.concatenate([bezier[..., :1], np.zeros_like(bezier[..., :1]), bezier[..., 1:]], axis=2)
    number = np.arange(len(work))
    return SpanChain.of(power_form(work), np.diff(joints_of(made)), number == 0, number == len(work) - 1)


def _samples(power: np.ndarray, count: int) -> np.ndarray:
    p = np.linspace(0.0, 1.0, count)
    powers = p[:, None] ** np.arange(4)
    return np.einsum("sk,mkd->msd", powers, power)


@settings(max_examples=60, deadline=None)
@given(SEED, st.integers(0, 4), st.sampled_from([1e-2, 1e-3, 1e-4]))
def test_path_bound_holds_both_ways(seed: int, inner: int, step_mm: float) -> None:
    """Written spans with sliding joints: dense distances both ways stay below the bound (4.3, 6.9)."""
    exact = _chain(seed, inner)
    random = np.random.default_rng(seed)
    written = exact.power + random.uniform(-step_mm, step_mm, exact.power.shape) / 4
    for before, after in pairwise(written):
        after[0] = before.sum(axis=0)
    bound = path_bound_mm(exact, written).max()
    for ours, theirs in ((written, exact.power), (exact.power, written)):
        distance = distance_mm(_samples(ours, 101).reshape(-1, 3), _samples(theirs, 8001).reshape(-1, 3))
        assert distance <= bound + 2e-6


def test_slide_along_the_path_is_no_deviation_but_ends_are() -> None:
    """A joint that moves along the curve costs nothing, the end of a pass does (4.3)."""
    exact = _chain(5, 1)
    tangent = exact.power[1, 1] / np.linalg.norm(exact.power[1, 1])
    inner, outer = exact.power.copy(), exact.power.copy()
    inner[0, 3] += 1e-3 * tangent
    inner[1, 0] += 1e-3 * tangent
    inner[1, 1] -= 1e-3 * tangent
    outer[1, 1] += 1e-3 * tangent
    assert path_bound_mm(exact, outer).max() >= 0.9e-3
    assert path_bound_mm(exact, inner).max() < 0.1e-3


@settings(max_examples=60, deadline=None)
@given(SEED)
def test_polyline_bound_holds(seed: int) -> None:
    """Polylines moved by rounding: distances both ways stay below the bound (6.9)."""
    random = np.random.default_rng(seed)
    exact = np.cumsum(random.uniform(0.2, 2.0, (12, 3)) * random.choice([1.0, 1.0, -0.5], (12, 3)), axis=0)
    written = exact + random.uniform(-1e-3, 1e-3, exact.shape)
    bound = polyline_bound_mm(exact, written)
    share = np.linspace(0.0, 1.0, 201)[:, None]
    for ours, theirs in ((written, exact), (exact, written)):
        points = np.concatenate([a + share * (b - a) for a, b in pairwise(ours)])
        low, legs = theirs[:-1], np.diff(theirs, axis=0)
        along = np.clip(((points[:, None] - low) * legs).sum(2) / (legs**2).sum(1), 0.0, 1.0)
        distance = np.linalg.norm(points[:, None] - low - along[..., None] * legs, axis=2).min(axis=1)
        assert distance.max() <= bound * (1 + 1e-9)
