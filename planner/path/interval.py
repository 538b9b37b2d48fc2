"""Arithmetic of ranges: arrays of lower and upper ends, every result containing all that its operands allow.

Ends are not rounded outward; whoever uses a range widens it by more than the rounding of doubles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.path.model import Array


@dataclass(frozen=True, slots=True)
class Range:
    """All numbers from `low` to `high`, element by element."""

    low: Array
    high: Array

    def __add__(self, other: Range) -> Range:
        return Range(self.low + other.low, self.high + other.high)

    def __sub__(self, other: Range) -> Range:
        return Range(self.low - other.high, self.high - other.low)

    def __mul__(self, other: Range) -> Range:
        low = self.low * other.low, self.low * other.high
        high = self.high * other.low, self.high * other.high
        return Range(np.minimum(np.minimum(*low), np.minimum(*high)), np.maximum(np.maximum(*low), np.maximum(*high)))

    def times(self, factor: float) -> Range:
        """Multiplied by a number."""
        ends = self.low * factor, self.high * factor
        return Range(np.minimum(*ends), np.maximum(*ends))

    def square(self) -> Range:
        """Squared, never below 0."""
        ends = self.low**2, self.high**2
        straddles = (self.low < 0) & (self.high > 0)
        return Range(np.where(straddles, 0.0, np.minimum(*ends)), np.maximum(*ends))

    def root(self) -> Range:
        """Square root of what is not below 0."""
        return Range(np.sqrt(np.maximum(self.low, 0.0)), np.sqrt(np.maximum(self.high, 0.0)))

    def inverse(self) -> Range:
        """One over it; all numbers where it may be 0."""
        may_vanish = (self.low <= 0) & (self.high >= 0)
        with np.errstate(divide="ignore"):
            return Range(np.where(may_vanish, -np.inf, 1 / self.high), np.where(may_vanish, np.inf, 1 / self.low))

    def part(self, index: int) -> Range:
        """One component of a vector, components first."""
        return Range(self.low[index], self.high[index])


def stack(parts: list[Range]) -> Range:
    """Components put together into a vector."""
    return Range(np.stack([part.low for part in parts]), np.stack([part.high for part in parts]))


def dot(left: Range, right: Range) -> Range:
    """Scalar product of vectors of three components."""
    product = left * right
    return Range(product.low.sum(axis=0), product.high.sum(axis=0))


def cross(left: Range, right: Range) -> Range:
    """Cross product of vectors of three components."""
    pairs = ((1, 2), (2, 0), (0, 1))
    return stack([left.part(i) * right.part(j) - left.part(j) * right.part(i) for i, j in pairs])
