"""What the machine's axes can reach: the part before anything is planned, the program when its heights are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from planner.errors import InputRejected
from planner.job import Job
from planner.path.model import Array, ToolPath
from planner.path.moves import corners_of
from planner.surface.curvature import survey
from planner.surface.patch import NurbsPatch

Travel = tuple[float, float, float]  # how far the axes X, Y, Z go, mm


def check_part(patch: NurbsPatch, radius_mm: float, travel_mm: Travel, path: Path) -> None:
    """Raises InputRejected where the patch is longer than an axis, and the ball of this radius, could ever reach.

    A part too large by far would take time and memory by the gigabyte before its program showed it.
    """
    contact = survey(patch).points.point
    # A centre is a radius from its place on the patch, and a border may be reached from as far inside.
    spans_mm = np.ptp(contact, axis=1)[:2] - 4.0 * radius_mm
    for axis, span_mm, most_mm in zip("XY", spans_mm.tolist(), travel_mm, strict=False):
        if span_mm > most_mm:
            whole_mm = span_mm + 4.0 * radius_mm
            what = f"{patch.name} is {whole_mm:.4g} mm long along {axis}, the machine goes over {most_mm:g}"
            raise InputRejected(what, path=path, remedy="cut the part in pieces")


def check_program(job: Job, tool_path: ToolPath, travel_mm: Travel, path: Path) -> None:
    """Raises InputRejected where the program reaches further along an axis than the machine goes."""
    points: list[Array] = [one.plane.to_work(corners_of(one.shape)) for one in tool_path.passes]
    low, high = np.concatenate(points).min(axis=0), np.concatenate(points).max(axis=0)
    # Centres of the ball so far; a programmed tip stands lower.
    high[2] = job.setup.safe_z_mm + (tool_path.radius_mm if job.post.reference == "tip" else 0.0)
    for axis, span_mm, most_mm in zip("XYZ", high - low, travel_mm, strict=True):
        if span_mm > most_mm:
            what = f"the program reaches over {span_mm:.4g} mm along {axis}, the machine over {most_mm:g}"
            remedy = "lower safe_z_mm and clearance_z_mm" if axis == "Z" else "cut the part in pieces"
            raise InputRejected(what, path=path, remedy=remedy, key=("setup", "safe_z_mm") if axis == "Z" else ())
