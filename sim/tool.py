"""Cutters as the verdict sees them: solids of revolution about +Z, reaching up without end (the shank).

The reference of a position is the centre of the ball (of the corner torus for a bull-nose, of the end face for a flat
end mill). A tool of corner radius r and flat radius f is every point within r of the horizontal disc of radius f at the
reference or of the upright half-line cylinder above it: a convex solid, so that a straight sweep of it is convex too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from sim.errors import InputRejected
from sim.nominal import CutterData


class Tool(Protocol):
    """What the verdict asks of a cutter: `corner_mm` is the radius of its edge, `flat_mm` of the disc it surrounds."""

    @property
    def corner_mm(self) -> float:
        """Radius of the rounded edge: R for a ball, 0 for a flat end mill."""
        ...

    @property
    def flat_mm(self) -> float:
        """Radius of the flat end inside the rounded edge: 0 for a ball."""
        ...


@dataclass(frozen=True, slots=True)
class BallTool:
    """Ball-end mill of radius R; its shank has the same radius."""

    radius_mm: float

    @property
    def corner_mm(self) -> float:
        """The ball's radius."""
        return self.radius_mm

    @property
    def flat_mm(self) -> float:
        """A ball has no flat end."""
        return 0.0


@dataclass(frozen=True, slots=True)
class BluntTool:
    """Bull-nose or flat end mill: a flat end of radius `flat_mm` inside a rounded edge of `corner_mm` (0: sharp)."""

    corner_mm: float
    flat_mm: float


def tool_of(cutter: CutterData) -> Tool:
    """The cutter of a job; raises InputRejected for a corner radius that its diameter cannot have."""
    if cutter.kind == "ball":
        return BallTool(cutter.radius_mm)
    if cutter.kind == "bull" and not 0 < cutter.corner_mm < cutter.radius_mm:
        raise InputRejected(
            f"a bull-nose cutter of radius {cutter.radius_mm:g} mm with corner_radius_mm = {cutter.corner_mm:g}",
            remedy="give a corner radius above 0 and below half the diameter",
        )
    return BluntTool(cutter.corner_mm, cutter.radius_mm - cutter.corner_mm)
