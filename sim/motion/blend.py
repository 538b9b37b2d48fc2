"""Rounding a corner: a polynomial that leaves one motion and joins the next with position, direction and curvature.

Between two straight moves it is C + d(-u1 a(t) + u2 a(1 - t)), a = 1 - 2t + 2t^3 - t^4, whose acceleration never
changes direction and whose distance from the corner is 0.375 d sin(theta/2); curved neighbours bend its ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import Motion, Polynomial, Rapid
from sim.motion.shapes import PolynomialShape, Shape

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Corner:
    """A rounded corner: its curve, what it takes of each neighbour, and how far it stays from the sharp one."""

    shape: PolynomialShape
    reach_mm: float
    deviation_mm: float

    def shape_for(self, after: Motion) -> PolynomialShape:
        """The rounding's shape with the source and the feed of the motion after the corner."""
        feed = 0.0 if isinstance(after, Rapid) else after.feed_mm_min
        curve = msgspec.structs.replace(self.shape.motion, line=after.line, block=after.block, feed_mm_min=feed)
        return self.shape.renamed(curve)


def round_corner(
    before: Shape, after: Shape, used_mm: float, reach_mm: float, tolerance_mm: float, speed_error: float
) -> Corner | None:
    """The rounding between two shapes, or None where there is no room.

    `used_mm` of `before` already belongs to the rounding at its other end. It begins `reach_mm` before the corner, or
    as much nearer as room and tolerance want it: `tolerance_mm` bounds the distance from the programmed path.
    """
    reach = min(reach_mm, before.length_mm / 2.0, before.length_mm - used_mm, after.length_mm / 2.0)
    if reach <= 0.0:
        return None
    for _ in range(8):
        shape = PolynomialShape(_between(before, after, reach), speed_error)
        deviation = _deviation(shape, before, after, reach)
        if deviation <= tolerance_mm * (1.0 + 1e-9):
            return Corner(shape, reach, deviation)
        reach *= 0.95 * tolerance_mm / deviation
    return None


def _between(before: Shape, after: Shape, reach_mm: float) -> Polynomial:
    """The quintic with the neighbours' points, directions and curvatures, its speed 2 reach at both ends."""
    a = np.array([before.length_mm - reach_mm])
    b = np.array([reach_mm])
    p0, p1 = before.points(a)[0], after.points(b)[0]
    t0, k0, _ = (row[0] for row in before.derivatives(a))
    t1, k1, _ = (row[0] for row in after.derivatives(b))
    speed = 2.0 * reach_mm
    v0, v1, a0, a1 = speed * t0, speed * t1, speed**2 * k0, speed**2 * k1
    rise = p1 - p0
    rows = np.array(
        [
            p0,
            v0,
            a0 / 2.0,
            10.0 * rise - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1,
            -15.0 * rise + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1,
            6.0 * rise - 3.0 * (v0 + v1) - 0.5 * (a0 - a1),
        ]
    )
    vectors = tuple((float(x), float(y), float(z)) for x, y, z in rows)
    end = (float(p1[0]), float(p1[1]), float(p1[2]))
    return Polynomial(0, None, vectors[0], end, vectors, (1.0,), 1.0, 0.0)


def _deviation(shape: PolynomialShape, before: Shape, after: Shape, reach_mm: float) -> float:
    """Largest distance between rounding and sharp path: 33 points to 65 on each neighbour, and the corner itself."""
    rounded = shape.points(np.linspace(0.0, shape.length_mm, 33))
    sharp = np.concatenate(
        [
            before.points(np.linspace(before.length_mm - reach_mm, before.length_mm, 65)),
            after.points(np.linspace(0.0, reach_mm, 65)),
        ]
    )
    low, step = sharp[:-1], np.diff(sharp, axis=0)
    square = np.maximum(np.sum(step**2, axis=1), 1e-300)
    share = np.clip(np.sum((rounded[:, None] - low) * step, axis=2) / square, 0.0, 1.0)
    gap = rounded[:, None] - low - share[:, :, None] * step
    corner = np.min(np.sum((rounded - sharp[64]) ** 2, axis=1))
    return float(np.sqrt(max(np.max(np.min(np.sum(gap**2, axis=2), axis=1)), corner)))
