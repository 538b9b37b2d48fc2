"""How the control takes blocks out of its ring: byte by byte into the place of the next block, until that has its end.

I/O-free. What was read of a block that has not ended yet makes room in the ring; else a ring that says DC1 when it is
empty would never say it, with half a block left in it.
"""

from __future__ import annotations

_BLOCK_BYTES = 4096
"""What the control holds of a block that has not ended, beside its ring."""


class BlockReader:
    """The bytes that have come and are no blocks yet; `read_bytes` at their head have left the ring."""

    def __init__(self) -> None:
        self._tape = bytearray()
        self._read_bytes = 0
        self._taken_bytes = 0

    @property
    def ring_bytes(self) -> int:
        """How many bytes still wait in the ring."""
        return len(self._tape) - self._read_bytes

    def hear(self, data: bytes) -> None:
        """These bytes have come into the ring."""
        self._tape += data

    def block(self) -> bytes | None:
        """The next block without its LF; None if its end has not come, and what there is of it is then read."""
        end = self._tape.find(b"\n")
        if end < 0:
            self._read_up_to(min(len(self._tape), _BLOCK_BYTES))
            return None
        self._read_up_to(end + 1)
        raw = bytes(self._tape[:end])
        self._cut(end + 1)
        return raw

    def skip_nuls(self) -> None:
        """NULs before a block are blank tape: a control that reads passes them over, however many they are."""
        count = len(self._tape) - len(self._tape.lstrip(b"\0"))
        self._read_up_to(count)
        self._cut(count)

    def skip_all(self) -> None:
        """Let everything go by that has come."""
        self._read_up_to(len(self._tape))
        self._cut(len(self._tape))

    def forget(self) -> None:
        """Reset: the ring is emptied by the interface itself."""
        self._tape.clear()
        self._read_bytes = self._taken_bytes = 0

    def taken(self) -> int:
        """How many bytes have left the ring since the last call."""
        count, self._taken_bytes = self._taken_bytes, 0
        return count

    def _read_up_to(self, count: int) -> None:
        if count > self._read_bytes:
            self._taken_bytes += count - self._read_bytes
            self._read_bytes = count

    def _cut(self, count: int) -> None:
        del self._tape[:count]
        self._read_bytes = max(0, self._read_bytes - count)
