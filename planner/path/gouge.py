"""Where a ball cannot go: patches that are singular, face away, or are tighter than the ball.

Checked over the whole patch before anything is traced, each complaint with patch and (u, v).
"""

from __future__ import annotations

import numpy as np

from planner.errors import InputRejected
from planner.surface.curvature import least_curvature, lowest, regularity, upwardness
from planner.surface.patch import NurbsPatch


def tool_side(patch: NurbsPatch, *, steepest_deg: float = 85.0) -> int:
    """+1 if Qu x Qv points up over the whole patch, -1 if down.

    Raises InputRejected where the patch is singular or steeper than `steepest_deg`, where a ball held along +Z cannot
    follow it.
    """
    least, u, v = lowest(patch, lambda u, v: regularity(patch, u, v), a_span=5, rounds=3)
    if not least > 1e-6:
        what = f"{patch.name} is singular at (u, v) = ({u:.4g}, {v:.4g})"
        raise InputRejected(what, remedy="move the control points apart or trim the patch before that place")
    (u_low, u_high), (v_low, v_high) = patch.domain
    middle = np.array([(u_low + u_high) / 2]), np.array([(v_low + v_high) / 2])
    side = 1 if upwardness(patch, *middle)[0] >= 0 else -1
    facing, u, v = lowest(patch, lambda u, v: side * upwardness(patch, u, v), a_span=5, rounds=3)
    if facing < np.cos(np.radians(steepest_deg)):
        angle_deg = np.degrees(np.arccos(np.clip(facing, -1.0, 1.0)))
        what = f"{patch.name} is {angle_deg:.1f} degrees steep at (u, v) = ({u:.4g}, {v:.4g})"
        raise InputRejected(what, remedy=f"turn the part so that it stays below {steepest_deg:g} degrees")
    return side


def check_radius(patch: NurbsPatch, side: int, radius_mm: float) -> None:
    """Raises InputRejected where the patch is concave with a radius at or below the ball's: the ball would gouge."""
    least, u, v = lowest(patch, lambda u, v: least_curvature(patch, side, u, v), a_span=5, rounds=4)
    if least * radius_mm <= -1.0:
        what = f"{patch.name} has a concave radius of {-1 / least:.3f} mm at (u, v) = ({u:.4g}, {v:.4g})"
        remedy = f"the ball's is {radius_mm:g} mm: use a tool of less than {-2 / least:.3f} mm diameter"
        raise InputRejected(what, remedy=remedy)
