"""What the machine profile and the operator's options say about talking: characters, and how long each wait may be."""

from __future__ import annotations

import math
from dataclasses import dataclass

_TRAILER_WAIT_S = 2.0


@dataclass(frozen=True, slots=True)
class Rules:
    """The rules of one job; 0 s means without limit."""

    xon: int = 0x11
    xoff: int = 0x13
    hears_xoff: bool = True
    is_driver_asked: bool = False
    waits_for_xon: bool = False
    start_timeout_s: float = 60.0
    hold_timeout_s: float = 0.0
    hold_warning_s: float = 120.0

    @property
    def trailer_wait_s(self) -> float:
        """How long a trailer is offered to a control that holds; less where the operator gives it less."""
        return min(_TRAILER_WAIT_S, self.hold_timeout_s or _TRAILER_WAIT_S)

    def next_limit_s(self, is_warned: bool, is_trailer_left: bool) -> float:
        """How long a hold may last until something must be done or said; infinite where nothing must."""
        waits = [limit for limit in (self.hold_timeout_s,) if limit > 0]
        if self.hold_warning_s > 0 and not is_warned:
            waits.append(self.hold_warning_s)
        if is_trailer_left:
            waits.append(self.trailer_wait_s)
        return min(waits, default=math.inf)
