"""How long the present hold, pause or wait for the first XON has lasted, and what its length calls for. No clock."""

from __future__ import annotations

import math

from dnc import alarms
from dnc.rules import Rules


class Wait:
    """The wait since `since_s`; a hold is warned of once."""

    __slots__ = ("_is_warned", "_rules", "since_s")

    def __init__(self, rules: Rules) -> None:
        self._rules = rules
        self.since_s = -math.inf
        self._is_warned = False

    def begin(self, now_s: float) -> None:
        """A wait begins that is no new hold of the control: nothing is warned of twice."""
        self.since_s = now_s

    def begin_hold(self, now_s: float) -> None:
        """The control stopped us, and nothing was said of it yet."""
        self.since_s = now_s
        self._is_warned = False

    def hold_limit_at_s(self, *, is_trailer_left: bool) -> float:
        """When something must be done or said about a hold; infinite where nothing must."""
        return self.since_s + self._rules.next_limit_s(self._is_warned, is_trailer_left)

    @property
    def start_limit_at_s(self) -> float:
        """When the first XON must have come; infinite where it may take as long as it likes."""
        timeout_s = self._rules.start_timeout_s
        return self.since_s + timeout_s if timeout_s > 0 else math.inf

    def is_start_over(self, now_s: float) -> bool:
        """Whether the first XON has not come in time."""
        return 0 < self._rules.start_timeout_s <= now_s - self.since_s

    def due(self, held_s: float) -> alarms.Kind | None:
        """What a hold of this length calls for: the time-out, one warning, or nothing."""
        rules = self._rules
        if 0 < rules.hold_timeout_s <= held_s:
            return alarms.HOLD_TIMEOUT
        if 0 < rules.hold_warning_s <= held_s and not self._is_warned:
            self._is_warned = True
            return alarms.LONG_HOLD
        return None
