"""What rapids between passes must stay above: the patch, and the billet where the job tells it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from planner.errors import InputRejected
from planner.job import Job
from planner.path.strategy.parallel import Layout
from planner.surface.curvature import lowest, survey, upwardness


def check_clearance(job: Job, layout: Layout, path: Path) -> None:
    """Raises InputRejected where a rapid move across at clearance height would meet the patch."""
    surface, border = layout.ground.surface, layout.ground.border
    # A summit may stand between two samples: it is looked for beside the highest of them.
    top = lowest(survey(surface.patch), lambda at: -at.point[2] - surface.stock_mm * np.abs(upwardness(at)), rounds=6)
    top_mm = max(-top.value, float(border.points.contact[2].max()))
    tip_mm = _tip_mm(job)
    if tip_mm <= top_mm:
        asked = f"clearance_z_mm {job.setup.clearance_z_mm:g}"
        asked += f", with the tip at Z{tip_mm:g}," if job.post.reference == "centre" else ""
        what = f"{asked} is not above {surface.patch.name}, which reaches Z{top_mm:.3f}"
        remedy = "give clearance_z_mm and safe_z_mm above the part and its clamps"
        raise InputRejected(what, path=path, remedy=remedy, key=("setup", "clearance_z_mm"))


def stock_warnings(job: Job) -> tuple[str, ...]:
    """A sentence where rapids across run lower than the top of the billet, which may be cut away there or not."""
    box, tip_mm = job.setup.stock_box_mm, _tip_mm(job)
    if box is None or tip_mm >= box[1][2]:
        return ()
    low = f"rapids between passes run with the tip at Z{tip_mm:g}, below the top of the billet at Z{box[1][2]:g}"
    return (f"{low} (stock_box_mm): raise clearance_z_mm, or be sure that the billet is roughed there",)


def _tip_mm(job: Job) -> float:
    """Height of the tip in rapids between passes; where the centre of the ball is programmed, a radius lower."""
    radius_mm = job.tool_of(job.operation[0]).radius_mm
    return job.setup.clearance_z_mm - (radius_mm if job.post.reference == "centre" else 0.0)
