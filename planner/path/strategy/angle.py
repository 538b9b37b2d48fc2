"""The direction of passes that needs the least of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planner.path.offset import OffsetSurface
from planner.path.pick_feed import local_pick_feed
from planner.path.seeds import sow
from planner.surface.patch import NurbsPatch

Array = NDArray[np.float64]


def best_angle_rad(
    patch: NurbsPatch, side: int, radius_mm: float, scallop_mm: float | None, *, step_deg: float = 5.0
) -> float:
    """The angle in [0, pi) whose passes promise to be shortest by local pick feeds, eq. (15), in steps of `step_deg`.

    The length is estimated strip by strip: the area of a strip, stretched by the slope along the pass (7), over the
    least pick feed in it. Directions that differ by less than a per cent may stand in the wrong order. With a fixed
    pick feed all directions cut the same area, so the one with the fewest passes is taken.
    """
    angles = np.radians(np.arange(0.0, 180.0, step_deg))
    costs = [_cost(OffsetSurface(patch.turned(float(angle)), radius_mm, side), scallop_mm) for angle in angles]
    return float(angles[int(np.argmin(costs))])


def _cost(surface: OffsetSurface, scallop_mm: float | None, strips: int = 32) -> float:
    """Estimated length of all passes, mm, or the width across them where the pick feed is fixed."""
    places = sow(surface, reach_mm=0.0, a_span=8).within(surface.patch.domain)
    found = surface.evaluate(places[0], places[1])
    y = found.centre[1]
    if scallop_mm is None:
        return float(np.ptp(y))
    area = np.abs(found.centre_u[0] * found.centre_v[1] - found.centre_u[1] * found.centre_v[0])
    area *= np.hypot(found.normal[0], found.normal[2]) / found.normal[2]
    strip = np.clip(((y - y.min()) / max(float(np.ptp(y)), 1e-12) * strips).astype(np.intp), 0, strips - 1)
    least = np.full(strips, np.inf)
    np.minimum.at(least, strip, local_pick_feed(surface, places, scallop_mm))
    passes = float(np.ptp(y)) / strips * float(np.sum(1.0 / least))
    # Where all directions cut the same, the one with the fewest passes has the shortest way in the air.
    return float(np.sum(np.bincount(strip, area, strips) / least)) + 2.0 * surface.radius_mm * max(passes, 1.0)
