"""How fast the curvature of exact curves can change between two places: proved where possible, else from samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from planner.path.curve import ExactCurve
from planner.path.model import Array, Method
from planner.path.plane_spline import Index


class SlopeSource(Protocol):
    """Bounds on d(curvature)/d(arc length) of several curves."""

    method: Method

    def enclose(self, rows: Index, left_mm: Array, right_mm: Array) -> tuple[Array, Array]:
        """Lower and upper bounds (k,), 1/mm2, on curve rows[i] between arc lengths left_mm[i] and right_mm[i]."""


@runtime_checkable
class EnclosedCurve(Protocol):
    """A curve that can bound the change of its own curvature."""

    def slope_range(self, left_mm: Array, right_mm: Array) -> tuple[Array, Array]:
        """Lower and upper bounds (k,) of d(curvature)/d(arc length) between these arc lengths, 1/mm2."""


def slope_source(curves: Sequence[ExactCurve]) -> SlopeSource:
    """The best source for these curves."""
    own = [curve for curve in curves if isinstance(curve, EnclosedCurve)]
    if len(own) == len(curves):
        return OwnSlopes(own)
    return SampledSlopes(curves)


class OwnSlopes:
    """Curves that bound themselves: the bound is proved as far as theirs is."""

    method = Method.PROVED

    def __init__(self, curves: Sequence[EnclosedCurve]) -> None:
        self._curves = curves

    def enclose(self, rows: Index, left_mm: Array, right_mm: Array) -> tuple[Array, Array]:
        """Each curve's own bounds."""
        low, high = np.empty(len(rows)), np.empty(len(rows))
        for row in np.unique(rows):
            at = rows == row
            low[at], high[at] = self._curves[row].slope_range(left_mm[at], right_mm[at])
        return low, high


class SampledSlopes:
    """The slopes between the samples themselves, widened by how much they differ from their neighbours'."""

    method = Method.SAMPLED

    def __init__(self, curves: Sequence[ExactCurve]) -> None:
        lengths = np.array([curve.arc_mm[-1] for curve in curves])
        self._base = np.cumsum(lengths + 1.0) - lengths
        self._keys = np.concatenate([curve.arc_mm + base for curve, base in zip(curves, self._base, strict=True)])
        low, high = [], []
        for curve in curves:
            slope = np.diff(curve.curvatures) / np.diff(curve.arc_mm)
            near = np.pad(slope, 1, mode="edge")
            least = np.minimum(np.minimum(near[:-2], near[2:]), slope)
            most = np.maximum(np.maximum(near[:-2], near[2:]), slope)
            spread = most - least
            # The gap after a curve belongs to its last interval.
            low.append(np.append(least - spread, (least - spread)[-1]))
            high.append(np.append(most + spread, (most + spread)[-1]))
        self._low, self._high = np.concatenate(low), np.concatenate(high)

    def enclose(self, rows: Index, left_mm: Array, right_mm: Array) -> tuple[Array, Array]:
        """The widened slopes of the sampled interval in which the middle lies."""
        at = np.searchsorted(self._keys, 0.5 * (left_mm + right_mm) + self._base[rows], side="right") - 1
        return self._low[at], self._high[at]
