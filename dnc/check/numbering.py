"""Block numbers: which the control reads, where a new round of them begins, and which have been seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planner.gcode import SINUMERIK

LARGEST_NUMBER = SINUMERIK.max_block_number
_LEAST_ROUND = 900
"""The smallest last number of a round: CAM systems count to three digits at least."""


def starts_over(last: int, number: int) -> bool:
    """Whether block numbers begin a new round: behind N9990 comes N10, because the CAM system has four digits.

    >>> starts_over(9990, 10), starts_over(99999, 1), starts_over(9990, 9980), starts_over(120, 10)
    (True, True, False, False)
    """
    return last >= _LEAST_ROUND and 10 * number <= last


class NumberSet:
    """Block numbers seen, one bit each: 12.5 MB for all that a control allows; larger ones are not remembered."""

    def __init__(self) -> None:
        self._bits = bytearray()

    def __contains__(self, number: int) -> bool:
        place, bit = divmod(number, 8)
        return place < len(self._bits) and bool(self._bits[place] >> bit & 1)

    def add(self, number: int) -> None:
        """Remember a number, if it is one that a control allows."""
        if number > LARGEST_NUMBER:
            return
        place, bit = divmod(number, 8)
        if place >= len(self._bits):
            self._bits.extend(bytes(max(place + 1 - len(self._bits), len(self._bits))))
        self._bits[place] |= 1 << bit

    def holds(self, numbers: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which of these numbers were added, (n,)."""
        bits = np.frombuffer(self._bits, dtype=np.uint8)
        found = np.zeros(len(numbers), dtype=np.bool_)
        inside = numbers < 8 * len(bits)
        asked = numbers[inside]
        found[inside] = bits[asked >> 3] >> (asked & 7).astype(np.uint8) & 1
        return found

    def add_many(self, numbers: NDArray[np.int64]) -> None:
        """Remember numbers, all of which a control allows."""
        self.add(int(numbers.max()))
        bits = np.frombuffer(self._bits, dtype=np.uint8)
        np.bitwise_or.at(bits, numbers >> 3, np.uint8(1) << (numbers & 7).astype(np.uint8))
