"""What is left of the billet, as a Z-map for pictures: exact at its nodes, never the source of a reported figure.

Between nodes a Z-map misses cusp peaks by up to g h / (4 R), g the pick feed and h the node distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.probe import Probes

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Stock:
    """Heights z_mm[i, j] over x_mm[i], y_mm[j]; `top_mm` is the billet before the cut."""

    x_mm: Floats
    y_mm: Floats
    z_mm: Floats
    top_mm: float


def stock_after(
    probes: Probes, low_mm: tuple[float, float], high_mm: tuple[float, float], top_mm: float, pitch_mm: float
) -> Stock:
    """The billet over a rectangle after the cutter's whole way, by vertical rays down from its top."""
    x, y = (
        np.linspace(low, high, max(2, int(np.ceil((high - low) / pitch_mm)) + 1))
        for low, high in zip(low_mm, high_mm, strict=True)
    )
    plan = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    points = np.concatenate([plan, np.full((len(plan), 1), top_mm)], axis=1)
    depth = probes.measure(points, np.tile([0.0, 0.0, 1.0], (len(plan), 1))).height_mm
    return Stock(x, y, (top_mm + np.minimum(depth, 0.0)).reshape(len(x), len(y)), top_mm)
