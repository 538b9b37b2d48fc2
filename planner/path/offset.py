"""The offset surface: where the ball's centre goes when the ball touches the part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.surface.patch import NurbsPatch

Array = NDArray[np.float64]

_NEXT_AXIS = np.array([1, 2, 0])


@dataclass(frozen=True, slots=True)
class OffsetPoints:
    """Points of the offset surface, every array (3, m), components first, mm.

    `contact` is where the ball touches, Q + stock N; `centre` is R further; `normal` is the unit normal N toward the
    tool; `_u` and `_v` are derivatives.
    """

    contact: Array
    contact_u: Array
    contact_v: Array
    centre: Array
    centre_u: Array
    centre_v: Array
    normal: Array
    normal_u: Array
    normal_v: Array

    def take(self, chosen: NDArray[np.intp] | slice) -> OffsetPoints:
        """The chosen points only."""
        return OffsetPoints(*(getattr(self, name)[:, chosen] for name in OffsetPoints.__slots__))


@dataclass(frozen=True, slots=True)
class OffsetSurface:
    """A patch at the distance of the ball's radius on the tool's side, eq. (4).

    `side` is +1 where Qu x Qv points to the tool (up), -1 where it points away; `stock_mm` is left on the part.
    `high_mm` is how far a pass as written may stand from the exact one: heights are then the most that it may leave.
    """

    patch: NurbsPatch
    radius_mm: float
    side: int = 1
    stock_mm: float = 0.0
    high_mm: float = 0.0

    @property
    def reach_mm(self) -> float:
        """How near to a centre a point must lie to be cut surely, eq. (18)."""
        return self.radius_mm - self.high_mm

    def evaluate(self, u: Array, v: Array) -> OffsetPoints:
        """Centres, contacts and first derivatives at parameters u, v (m,)."""
        found = self.patch.evaluate(u, v)
        cross = self.side * cross_product(found.du, found.dv)
        length = np.sqrt(dot(cross, cross))
        normal = cross / length
        bent_u = self.side * (cross_product(found.duu, found.dv) + cross_product(found.du, found.duv))
        bent_v = self.side * (cross_product(found.duv, found.dv) + cross_product(found.du, found.dvv))
        normal_u = (bent_u - dot(bent_u, normal) * normal) / length
        normal_v = (bent_v - dot(bent_v, normal) * normal) / length
        contact, contact_u, contact_v = found.point, found.du, found.dv
        if self.stock_mm:
            contact = contact + self.stock_mm * normal
            contact_u, contact_v = contact_u + self.stock_mm * normal_u, contact_v + self.stock_mm * normal_v
        return OffsetPoints(
            contact=contact,
            contact_u=contact_u,
            contact_v=contact_v,
            centre=contact + self.radius_mm * normal,
            centre_u=contact_u + self.radius_mm * normal_u,
            centre_v=contact_v + self.radius_mm * normal_v,
            normal=normal,
            normal_u=normal_u,
            normal_v=normal_v,
        )


def cross_product(left: Array, right: Array) -> Array:
    """Cross products of columns: (3, m) x (3, m), without the axis shuffling of np.cross."""
    found = left * right.take(_NEXT_AXIS, 0)
    found -= left.take(_NEXT_AXIS, 0) * right
    return found.take(_NEXT_AXIS, 0)


def dot(left: Array, right: Array) -> Array:
    """Scalar products of columns: (3, m), (3, m) -> (m,)."""
    products = left * right
    total: Array = products[0]
    total += products[1]
    total += products[2]
    return total
