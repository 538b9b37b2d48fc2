"""What a way of writing curves hands to a post: the text of one pass, without head, moves and feed."""

from __future__ import annotations

from dataclasses import dataclass

from planner.path.model import Array
from planner.post.numbers import decimal_text

AXES = ("X", "Y", "Z")


@dataclass(frozen=True, slots=True)
class Point:
    """A written point: integers of 10^-decimals mm for X, Y, Z."""

    units: tuple[int, int, int]
    decimals: int

    @property
    def mm(self) -> tuple[float, float, float]:
        """The point as the control reads it, mm."""
        scale = 10**self.decimals
        x, y, z = (unit / scale for unit in self.units)
        return x, y, z

    def word(self, axis: int) -> str:
        """One coordinate as a word, such as X12.5."""
        return AXES[axis] + decimal_text(self.units[axis], self.decimals)


@dataclass(frozen=True, slots=True)
class PassText:
    """One pass as written: its first and last point, its cutting blocks, what rounding moved at most."""

    start: Point
    end: Point
    blocks: tuple[str, ...]
    rounding_mm: float


def moved_words(units: Array | tuple[int, ...], before: Array | tuple[int, ...], decimals: int) -> str:
    """The words of the coordinates that change, without blanks.

    >>> moved_words((1500, 2, 0), (1500, 0, 0), 3)
    'Y.002'
    """
    return "".join(
        AXES[axis] + decimal_text(int(units[axis]), decimals)
        for axis in range(3)
        if int(units[axis]) != int(before[axis])
    )
