"""The feed in force in a block, ready for a path of any length."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from sim.interpreter.canon import Vector


@dataclass(frozen=True, slots=True)
class PathFeed:
    """mm/min along the path, or 1/min where `is_inverse_time` (the whole move takes 1/value minutes).

    `axes` are those of FGROUP, None for all; they stand still where they move by less than `same_place_mm`.
    """

    value: float
    is_inverse_time: bool
    axes: tuple[int, ...] | None
    same_place_mm: float

    @property
    def depends_on_path(self) -> bool:
        """Whether the speed along the path is not F itself."""
        return self.is_inverse_time or self.axes is not None

    def along(self, points: Sequence[Vector], length_mm: float | None = None) -> float:
        """Path speed mm/min over a path through these points, of `length_mm` where that is known better.

        F counts along the axes of FGROUP where they move; over a curve that is the mean.
        """
        if not self.depends_on_path:
            return self.value
        chords_mm = _length(points, (0, 1, 2))
        if self.is_inverse_time:
            return self.value * (chords_mm if length_mm is None else length_mm)
        assert self.axes is not None
        group_mm = _length(points, self.axes)
        return self.value if group_mm < self.same_place_mm else self.value * chords_mm / group_mm


def _length(points: Sequence[Vector], axes: tuple[int, ...]) -> float:
    return sum(math.sqrt(sum((b[axis] - a[axis]) ** 2 for axis in axes)) for a, b in pairwise(points))
