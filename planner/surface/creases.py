"""Where the normal of a patch jumps: across knots as often repeated as its degree, which leave the tangent free."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from planner.surface.curvature import span_places
from planner.surface.patch import NurbsPatch

Array = NDArray[np.float64]


def normals_across(patch: NurbsPatch) -> Iterator[tuple[int, float, Array, Array]]:
    """Each knot that may be a crease: its axis (0: u), its value, and unit normals (3, m) along it on both sides."""
    for axis, (knots, degree) in enumerate(((patch.knots_u, patch.degree_u), (patch.knots_v, patch.degree_v))):
        places = span_places((patch.basis_v, patch.basis_u)[axis], 4)
        low, high = patch.domain[axis]
        values, repeats = np.unique(knots[(knots > low) & (knots < high)], return_counts=True)
        for knot in values[repeats >= degree]:
            sides = []
            for value in (np.nextafter(knot, low), knot):
                held = np.full_like(places, value)
                found = patch.evaluate(*((held, places) if axis == 0 else (places, held)))
                normal = np.cross(found.du, found.dv, axis=0)
                sides.append(normal / np.linalg.norm(normal, axis=0))
            yield axis, float(knot), sides[0], sides[1]


def largest_turn_rad(patch: NurbsPatch) -> float:
    """How far a pass y = const may turn where it crosses a crease: more than the normal on ground that climbs."""
    largest = 0.0
    for _, _, before, after in normals_across(patch):
        along = np.minimum(np.hypot(before[0], before[2]), np.hypot(after[0], after[2]))
        largest = max(largest, float((np.linalg.norm(after - before, axis=0) / along).max()))
    return largest
