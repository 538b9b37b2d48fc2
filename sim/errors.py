"""What the simulated mill complains about: its control's alarms, and input it cannot use."""

from __future__ import annotations

from planner.errors import InputRejected, UserError

__all__ = ["InputRejected", "UserError"]
