"""Exact plane curves with the interface of a traced curve: the permanent stand-ins for fitting and bounding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

Array = NDArray[np.float64]
Derivatives = Callable[[Array], tuple[Array, Array, Array]]


@dataclass(frozen=True)
class Values:
    points: Array
    tangents: Array
    curvatures: Array


class AnalyticCurve:
    """A parametric curve given with two derivatives, walked by arc length (Gauss quadrature, then Newton)."""

    def __init__(self, derivatives: Derivatives, start: float, end: float, pitch_mm: float = 0.5) -> None:
        self._derivatives = derivatives
        self._grid = np.linspace(start, end, 4001)
        nodes, weights = leggauss(6)
        self._nodes, self._weights = (nodes + 1) / 2, weights / 2
        step = self._grid[1] - self._grid[0]
        inner = self._grid[:-1, None] + step * self._nodes
        speeds = self._speed(inner.ravel()).reshape(inner.shape)
        self._arc = np.concatenate([[0.0], np.cumsum(step * speeds @ self._weights)])
        count = max(int(np.ceil(self._arc[-1] / pitch_mm)) + 1, 9)
        self.arc_mm = np.linspace(0.0, self._arc[-1], count)
        values = self.refine(self.arc_mm)
        self.points, self.tangents, self.curvatures = values.points, values.tangents, values.curvatures

    def _speed(self, parameters: Array) -> Array:
        first = self._derivatives(parameters)[1]
        return np.hypot(first[:, 0], first[:, 1])

    def refine(self, arc_mm: Array) -> Values:
        cell = np.clip(np.searchsorted(self._arc, arc_mm, side="right") - 1, 0, self._grid.size - 2)
        base = self._grid[cell]
        wanted = arc_mm - self._arc[cell]
        length = self._arc[cell + 1] - self._arc[cell]
        parameters = base + (self._grid[cell + 1] - base) * wanted / length
        for _ in range(2):
            width = parameters - base
            inner = base[:, None] + width[:, None] * self._nodes
            walked = width * (self._speed(inner.ravel()).reshape(inner.shape) @ self._weights)
            parameters = parameters - (walked - wanted) / self._speed(parameters)
        points, first, second = self._derivatives(parameters)
        speed = np.hypot(first[:, 0], first[:, 1])
        curvatures = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3
        return Values(points, first / speed[:, None], curvatures)


def graph(height: Callable[[Array, int], Array], start: float, end: float, pitch_mm: float = 0.5) -> AnalyticCurve:
    """z = height(w, 0), with derivatives height(w, 1), height(w, 2)."""

    def derivatives(w: Array) -> tuple[Array, Array, Array]:
        one, zero = np.ones_like(w), np.zeros_like(w)
        return (
            np.stack([w, height(w, 0)], axis=1),
            np.stack([one, height(w, 1)], axis=1),
            np.stack([zero, height(w, 2)], axis=1),
        )

    return AnalyticCurve(derivatives, start, end, pitch_mm)


def offset_graph(
    height: Callable[[Array, int], Array], radius_mm: float, start: float, end: float, pitch_mm: float = 0.5
) -> AnalyticCurve:
    """The offset of a graph by a ball of this radius, above it; `height` must give four derivatives."""

    def derivatives(w: Array) -> tuple[Array, Array, Array]:
        f, f1, f2, f3 = (height(w, k) for k in range(4))
        q = np.sqrt(1 + f1**2)
        # N = (-f1, 1) / q; N' = -f2 / q^3 (1, f1); N'' follows by the product rule.
        a = -f2 / q**3
        a1 = -f3 / q**3 + 3 * f1 * f2**2 / q**5
        points = np.stack([w - radius_mm * f1 / q, f + radius_mm / q], axis=1)
        first = np.stack([1 + radius_mm * a, f1 + radius_mm * a * f1], axis=1)
        second = np.stack([radius_mm * a1, f2 + radius_mm * (a1 * f1 + a * f2)], axis=1)
        return points, first, second

    return AnalyticCurve(derivatives, start, end, pitch_mm)


def sine(amplitude: float, scale_mm: float) -> Callable[[Array, int], Array]:
    """amplitude sin(w / scale) and its derivatives."""
    return lambda w, k: amplitude * np.sin(w / scale_mm + k * np.pi / 2) / scale_mm**k


def wave_pass(amplitude: float = 5.0, pitch_mm: float = 0.5, length_mm: float = 300.0) -> AnalyticCurve:
    """A pass over z = amplitude sin(x / 20), ball R 4."""
    return offset_graph(sine(amplitude, 20.0), 4.0, 0.0, length_mm, pitch_mm)


def arc(radius_mm: float, start_rad: float, end_rad: float, pitch_mm: float = 0.5) -> AnalyticCurve:
    """A circular arc about the origin, counter-clockwise."""

    def derivatives(t: Array) -> tuple[Array, Array, Array]:
        c, s = np.cos(t), np.sin(t)
        return (
            radius_mm * np.stack([c, s], axis=1),
            radius_mm * np.stack([-s, c], axis=1),
            radius_mm * np.stack([-c, -s], axis=1),
        )

    return AnalyticCurve(derivatives, start_rad, end_rad, pitch_mm)


def random_graph(seed: int, length_mm: float = 50.0, pitch_mm: float = 0.5) -> AnalyticCurve:
    """A sum of a few sines, rolled over by a ball of R 4: smooth, with curvature below 1/4."""
    rng = np.random.default_rng(seed)
    waves = np.arange(1, 7)
    amplitudes = rng.normal(size=6) * length_mm * 0.02 / waves**2
    phases = rng.uniform(0, 2 * np.pi, 6)
    slope = rng.normal() * 0.3

    def height(w: Array, k: int) -> Array:
        factor = waves * np.pi / length_mm
        terms = amplitudes * factor**k * np.sin(np.multiply.outer(w, factor) + phases + k * np.pi / 2)
        line = slope * w if k == 0 else np.full_like(w, slope if k == 1 else 0.0)
        return np.asarray(terms.sum(axis=-1) + line)

    return offset_graph(height, 4.0, 0.0, length_mm, pitch_mm)
