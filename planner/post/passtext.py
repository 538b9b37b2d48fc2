"""What a way of writing curves hands to a post: the text of one pass, without head, moves and feed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.gcode.words import decimal_text
from planner.path.model import Array, DrivingPlane
from planner.post.numbers import to_units

AXES = ("X", "Y", "Z")


@dataclass(frozen=True, slots=True)
class Point:
    """A written point: integers of 10^-decimals mm for X, Y, Z."""

    units: tuple[int, int, int]
    decimals: int

    @classmethod
    def of(cls, point_mm: Array, decimals: int) -> Point:
        """The point (3,), mm, rounded to these decimals."""
        x, y, z = to_units(point_mm, decimals).tolist()
        return cls((x, y, z), decimals)

    @property
    def mm(self) -> tuple[float, float, float]:
        """The point as the control reads it, mm."""
        scale = 10**self.decimals
        x, y, z = (unit / scale for unit in self.units)
        return x, y, z

    def text(self, axis: int) -> str:
        """One coordinate, such as 12.5."""
        return decimal_text(self.units[axis], self.decimals)

    def word(self, axis: int) -> str:
        """One coordinate as a word, such as X12.5."""
        return AXES[axis] + self.text(axis)


@dataclass(frozen=True, slots=True)
class PassText:
    """One pass as written: its first and last point, its cutting blocks, what rounding moved at most."""

    start: Point
    end: Point
    blocks: tuple[str, ...]
    rounding_mm: float


def is_constant(plane: DrivingPlane, still: float = 1e-12) -> NDArray[np.bool_]:
    """Which of X, Y, Z stand still in this driving plane, shape (3,): the cosine of 90 degrees is not quite zero."""
    return np.append(np.abs(plane.direction[:2]) < still, False)


def moved_words(texts: list[str], before: list[str]) -> str:
    """The words of the coordinates that change, without blanks.

    >>> moved_words(["1.5", ".002", "0"], ["1.5", "0", "0"])
    'Y.002'
    """
    return "".join(AXES[axis] + texts[axis] for axis in range(3) if texts[axis] != before[axis])
