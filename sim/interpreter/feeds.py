"""The feed in force in a block, ready for a path of any length."""

from __future__ import annotations

from dataclasses import dataclass

SHORTEST_MM = 1e-9


@dataclass(frozen=True, slots=True)
class PathFeed:
    """mm/min along the path, or 1/min where `is_inverse_time` (the whole move takes 1/value minutes)."""

    value: float
    is_inverse_time: bool

    def along(self, length_mm: float, group_length_mm: float | None = None) -> float:
        """Path speed mm/min over `length_mm`; F counts along the axes of FGROUP where they move."""
        if self.is_inverse_time:
            return self.value * length_mm
        if group_length_mm is None or group_length_mm < SHORTEST_MM:
            return self.value
        return self.value * length_mm / group_length_mm
