"""A section of the cut surface across the passes, through one place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.deviation import Place, Verdict
from sim.refine import Refiner

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Section:
    """Deviation (n,), mm, at distances (n,), mm, from a place, on the design, square to the way of the cutter there."""

    distance_mm: Floats
    deviation_mm: Floats


def section_at(verdict: Verdict, place: Place, half_width_mm: float, count: int) -> Section:
    """The section through a place, `half_width_mm` to either side; nan beyond the border of the patch."""
    patch = verdict.maps[place.patch].net.patch
    refiner = Refiner(patch, verdict.probes, 1.0)
    at = np.array([place.uv])
    _, across = refiner.directions(at)
    distance = np.linspace(-half_width_mm, half_width_mm, count)
    uv = at + distance[:, None] * across
    found = refiner.measured(uv).found.height_mm
    is_inside = (uv == patch.clipped(uv)).all(axis=1) & np.isfinite(found)
    return Section(distance, np.where(is_inside, found, np.nan))
