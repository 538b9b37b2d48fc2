"""What comes through where a driver or a chip is asked to keep XOFF and XON to itself. No I/O."""

from __future__ import annotations

from dnc.handshake import Signal, signal_behind_xoff
from dnc.rules import Rules


class Overhearing:
    """Remembers a SYN or NAK that may have followed an XOFF which the driver swallowed."""

    __slots__ = ("_broken_off", "_rules")

    def __init__(self, rules: Rules) -> None:
        self._rules = rules
        self._broken_off: tuple[Signal, int] | None = None

    def is_driver_deaf(self, data: bytes) -> bool:
        """Whether an XOFF came through, with bit 7 or without: a driver that obeys it keeps it to itself."""
        return bool({self._rules.xoff, self._rules.xoff ^ 0x80} & set(data))

    def note(self, data: bytes, offset_bytes: int) -> None:
        """These bytes came through when so much of the tape had left."""
        broken = signal_behind_xoff(data[-1])
        self._broken_off = None if broken is None else (broken, offset_bytes)

    def broken_off(self, offset_bytes: int, most_bytes: int) -> tuple[Signal | None, int]:
        """What the byte remembered says, told once, and how many bytes have left since; None if it says nothing.

        Where more left after it than can be held back, nothing stopped the driver then.
        """
        if self._broken_off is None:
            return None, 0
        (signal, at_bytes), self._broken_off = self._broken_off, None
        behind_bytes = offset_bytes - at_bytes
        return (None if behind_bytes > most_bytes else signal), behind_bytes
