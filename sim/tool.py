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


def tool_of(cutter: CutterData) -> Tool:
    """The cutter of a job; raises InputRejected for a kind that cannot be measured yet."""
    if cutter.kind != "ball":
        raise InputRejected(f"a {cutter.kind} cutter is not measured yet", remedy="measure with a ball-end mill")
    return BallTool(cutter.radius_mm)
