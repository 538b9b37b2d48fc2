"""Surfaces of the tests: the thesis's patch in both readings, closed forms, and seeded free forms."""

from __future__ import annotations

import numpy as np

from planner.path.strategy.parallel import Wishes
from planner.surface.patch import NurbsPatch

BEZIER = np.array([0.0, 0, 0, 0, 1, 1, 1, 1])
THESIS = [
    [[1, 1, 2], [10, 1, 1.5], [20, 1, 2], [50, 1, 3]],
    [[1, 12, 1], [8, 15, 3], [30, 20, 1.5], [50, 10, 2]],
    [[1, 25, 0], [15, 30, 1], [25, 35, 3], [50, 35, 1]],
    [[1, 50, 2], [10, 50, 2], [20, 50, 1.5], [50, 50, 2]],
]


def thesis_patch(p22_y: float = 35.0) -> NurbsPatch:
    points = np.array(THESIS, dtype=np.float64)
    points[2, 2, 1] = p22_y
    return NurbsPatch(3, 3, BEZIER, BEZIER, points)


def clamped(count: int, degree: int = 3) -> np.ndarray:
    return np.concatenate([np.zeros(degree), np.linspace(0, 1, count - degree + 1), np.ones(degree)])


def wavy_patch(seed: int = 0, size_mm: float = 60.0, height_mm: float = 1.2) -> NurbsPatch:
    """A 9 x 9 bicubic with random heights; u runs along y."""
    rng = np.random.default_rng(seed)
    places = np.linspace(0, size_mm, 9)
    y, x = np.meshgrid(places, places, indexing="ij")
    points = np.stack([x, y, height_mm * rng.standard_normal((9, 9))], axis=2)
    return NurbsPatch(3, 3, clamped(9), clamped(9), points)


def uneven_patch(seed: int) -> NurbsPatch:
    """Of degree 2 in u, along x, with knots close together: the curvature of a pass jumps and changes fast."""
    heights = 0.1 * np.random.default_rng(seed).standard_normal((6, 5))
    x, y = np.meshgrid(np.linspace(0, 25, 6), np.linspace(0, 20, 5), indexing="ij")
    knots = np.array([0, 0, 0, 0.38, 0.42, 0.84, 1, 1, 1])
    return NurbsPatch(2, 3, knots, clamped(5), np.stack([x, y, heights], axis=2))


def slope_patch(steepest_deg: float = 45.0, size_mm: float = 40.0) -> NurbsPatch:
    """A bicubic that rises along y and dips along x, up to about this steep."""
    rise = np.tan(np.radians(steepest_deg)) * size_mm / 3
    heights = np.array([0.0, 0.0, 0.5, 1.5])[:, None] * rise + np.array([2.0, 0.0, 0.0, 2.0])[None, :]
    y, x = np.meshgrid(np.linspace(0, size_mm, 4), np.linspace(0, size_mm, 4), indexing="ij")
    return NurbsPatch(3, 3, BEZIER, BEZIER, np.stack([x, y, heights], axis=2))


def plane_patch(size_mm: float = 20.0, slope_y: float = 0.0) -> NurbsPatch:
    y, x = np.meshgrid([0.0, size_mm], [0.0, size_mm], indexing="ij")
    knots = np.array([0.0, 0, 1, 1])
    return NurbsPatch(1, 1, knots, knots, np.stack([x, y, slope_y * y], axis=2))


def cylinder_patch(radius_mm: float = 30.0, length_mm: float = 20.0, half_angle_deg: float = 30.0) -> NurbsPatch:
    """A convex arc about an axis along x: rational quadratic in u (across), linear in v (along the axis)."""
    half = np.radians(half_angle_deg)
    arc = radius_mm * np.array([[-np.sin(half), np.cos(half)], [0.0, 1 / np.cos(half)], [np.sin(half), np.cos(half)]])
    points = np.array([[[x, y, z] for x in (0.0, length_mm)] for y, z in arc])
    weights = np.array([[1.0, 1.0], [np.cos(half)] * 2, [1.0, 1.0]])
    return NurbsPatch(2, 1, np.array([0.0, 0, 0, 1, 1, 1]), np.array([0.0, 0, 1, 1]), points, weights)


def sphere_patch(radius_mm: float = 25.0, reach: float = 0.25) -> NurbsPatch:
    """A cap about the north pole by stereographic projection: biquadratic rational, |s|, |t| <= reach."""
    ends = np.array([-reach, reach])

    def blossom(square: float, line: float, constant: float) -> np.ndarray:
        a, b = ends
        return square * np.array([a * a, a * b, b * b]) + line * np.array([a, (a + b) / 2, b]) + constant

    one, line, square = blossom(0, 0, 1), blossom(0, 1, 0), blossom(1, 0, 0)
    weights = np.outer(one, one) + np.outer(square, one) + np.outer(one, square)
    x = 2 * radius_mm * np.outer(one, line)
    y = 2 * radius_mm * np.outer(line, one)
    z = radius_mm * (np.outer(one, one) - np.outer(square, one) - np.outer(one, square))
    points = np.stack([x, y, z], axis=2) / weights[..., None]
    knots = np.array([0.0, 0, 0, 1, 1, 1])
    return NurbsPatch(2, 2, knots, knots, points, weights)


def cone_patch(inner_mm: float = 9.0, outer_mm: float = 16.0, drop_mm: float = 7.0) -> NurbsPatch:
    """A whole ring of a cone that closes upon itself at y = 0, x > 0: rational quadratic in u, around it."""
    half = np.sqrt(0.5)
    ring = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
    weights = np.array([1, half, 1, half, 1, half, 1, half, 1])
    sides = [np.column_stack([radius * ring, np.full(9, z)]) for radius, z in ((outer_mm, -drop_mm), (inner_mm, 0.0))]
    knots = np.array([0.0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4])
    points, linear = np.stack(sides, axis=1), np.array([0.0, 0, 1, 1])
    return NurbsPatch(2, 1, knots, linear, points, np.stack([weights, weights], axis=1))


def random_patch(seed: int) -> tuple[NurbsPatch, Wishes]:
    """A smooth bicubic patch of 20 to 60 mm with random heights that a ball can follow, and what to cut it with."""
    rng = np.random.default_rng(seed)
    rows, columns = (int(rng.integers(5, 11)) for _ in range(2))
    knots = [np.r_[[0.0] * 4, np.linspace(0, 1, count - 2)[1:-1], [1.0] * 4] for count in (rows, columns)]
    places = [np.array([k[i + 1 : i + 4].mean() for i in range(len(k) - 4)]) for k in knots]
    size = rng.uniform(20, 60, 2)
    x, y = np.meshgrid(places[0] * size[0], places[1] * size[1], indexing="ij")
    cell_mm = min(size[0] / (rows - 3), size[1] / (columns - 3))
    radius_mm = float(rng.choice([2, 3, 4]))
    z = rng.normal(size=x.shape) * rng.choice([0.3, 0.6, 1.0]) * cell_mm**2 / radius_mm / 16
    weights = np.exp(rng.normal(size=x.shape) * 0.2) if rng.random() < 0.3 else None
    scallop_mm: float | None = float(rng.choice([0.08, 0.02, 0.005]))
    angle_deg = float(rng.uniform(0, 180)) if rng.random() < 0.6 else float(rng.choice([0, 45, 90]))
    feed_mm = None
    if rng.random() < 0.25:
        scallop_mm, feed_mm = None, float(radius_mm * rng.choice([0.25, 0.5, 1]))
    patch = NurbsPatch(3, 3, knots[0], knots[1], np.stack([x, y, z], axis=2), weights)
    return patch, Wishes(radius_mm, float(np.radians(angle_deg)), scallop_mm, feed_mm, 0.0, bool(rng.random() < 0.25))
