"""Where a ball cannot go: patches that are singular, face away, or are tighter than the ball.

Checked over the whole patch before anything is traced, each complaint with patch and (u, v).
"""

from __future__ import annotations

import numpy as np

from planner.errors import InputRejected
from planner.surface.curvature import Survey, least_curvature, lowest, regularity, upwardness


def tool_side(survey: Survey, *, steepest_deg: float = 85.0, least_area: float = 1e-6) -> int:
    """+1 if Qu x Qv points up over the whole patch, -1 if down.

    Raises InputRejected where the patch is singular (a parameter cell shrinks to `least_area` of the mean one) or
    steeper than `steepest_deg`, where a ball held along +Z cannot follow it.
    """
    name = survey.patch.name
    mean_area = float(np.mean(regularity(survey.points)))
    least = lowest(survey, regularity, rounds=3)
    if not least.value > least_area * mean_area:
        what = f"{name} is singular at {least.place}"
        raise InputRejected(what, remedy="move the control points apart or trim the patch before that place")
    side = 1 if float(np.mean(upwardness(survey.points))) >= 0 else -1
    steepest = lowest(survey, lambda points: side * upwardness(points), rounds=3)
    if steepest.value < np.cos(np.radians(steepest_deg)):
        angle_deg = float(np.degrees(np.arccos(np.clip(steepest.value, -1.0, 1.0))))
        what = f"{name} is {angle_deg:.1f} degrees steep at {steepest.place}"
        raise InputRejected(what, remedy=f"turn the part so that it stays below {steepest_deg:g} degrees")
    return side


def check_radius(survey: Survey, side: int, radius_mm: float) -> None:
    """Raises InputRejected where the patch is concave with a radius at or below the ball's: the ball would gouge."""
    tightest = lowest(survey, lambda points: least_curvature(points, side), rounds=4)
    if tightest.value * radius_mm <= -1.0:
        concave_mm = -1 / tightest.value
        what = f"{survey.patch.name} has a concave radius of {concave_mm:.3f} mm at {tightest.place}"
        remedy = f"the ball's is {radius_mm:g} mm: use a tool of less than {2 * concave_mm:.3f} mm diameter"
        raise InputRejected(what, remedy=remedy)
