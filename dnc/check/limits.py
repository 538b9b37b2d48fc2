"""What a program is checked against: the machine's profile, and of the job what the program does not say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from dnc.profile import MachineProfile
from planner.job import Job
from sim.interpreter import canon

Box = tuple[canon.Vector, canon.Vector]


@dataclass(frozen=True, slots=True)
class Limits:
    """What a program is checked against; heights, stock and tool radii are known only where a job was given.

    Heights that differ by less than `touch_mm` are one: sums of offsets leave a last digit.
    """

    profile: MachineProfile
    clearance_z_mm: float | None = None
    stock_box_mm: Box | None = None
    tool_radii_mm: Mapping[int, float] = field(default_factory=dict)
    touch_mm: float = 1e-6

    @property
    def usual_feeds_mm_min(self) -> tuple[float, float]:
        """The slowest cut and the speed of the fastest axis; a feed outside is a mistake."""
        return 1.0, max(axis.rapid_mm_min for axis in self.profile.axes.values())

    def reach_mm(self, axis: str, is_zero_shifted: bool) -> tuple[float, float]:
        """The least and the greatest position that an axis can take.

        Without a work offset that is its travel. With one it is what a zero point anywhere in the travel leaves.
        """
        travel = self.profile.axes[axis]  # type: ignore[index]
        if not is_zero_shifted:
            return travel.min_mm, travel.max_mm
        return travel.min_mm - travel.max_mm, travel.max_mm - travel.min_mm


def limits_of(profile: MachineProfile, job: Job | None) -> Limits:
    """The limits of a machine, with those of the job where there is one."""
    if job is None:
        return Limits(profile)
    return Limits(profile, job.setup.clearance_z_mm, job.setup.stock_box_mm, job.tool_radii_mm)
