"""Damped Gauss-Newton for a batch of fits: who goes on, who has arrived, who gains too little; (F8)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, Self, TypeVar

import numpy as np

from planner.path.model import Array
from planner.path.plane_spline import Index


class Batch(Protocol):
    """Fits of several curves, one a row; `errors_mm` (p,) is the largest distance of each."""

    @property
    def errors_mm(self) -> Array:
        """Largest distances (p,), mm."""

    def take(self, rows: Index) -> Self:
        """These rows only; they rise."""

    def put(self, rows: Index, other: Self) -> None:
        """Overwrite these rows, which rise, by the other's."""


AnyBatch = TypeVar("AnyBatch", bound=Batch)


def improve(
    fit: AnyBatch,
    step: Callable[[Index, AnyBatch, int, Array], tuple[AnyBatch, Array]],
    *,
    powers: Array,
    targets_mm: Array,
    patience: int,
) -> AnyBatch:
    """The best of a damped step for every power of `powers`: 2 is least squares, more nears minimax.

    `step` takes rows, their fit, the power and the damping (p,), and gives the fit moved, where that was better, and
    the new damping. A row stops when it reaches its target of `targets_mm` (p,), or when it is far from it and has
    gained less than a tenth in `patience` steps.
    """
    best = fit.take(np.arange(len(targets_mm)))
    live = np.flatnonzero(fit.errors_mm > targets_mm)
    fit, damping = fit.take(live), np.full(len(live), 1e-4)
    history: list[Array] = []
    for power in powers:
        if not len(live):
            break
        fit, damping = step(live, fit, int(power), damping)
        is_better = np.flatnonzero(fit.errors_mm < best.errors_mm[live])
        best.put(live[is_better], fit.take(is_better))
        reached = best.errors_mm[live]
        history.append(reached)
        is_open = reached > targets_mm[live]
        if len(history) > patience:
            gain = history[-1 - patience] / reached
            is_open &= (gain**2 > reached / targets_mm[live]) | (gain > 1.1)
        if not is_open.all():
            kept = np.flatnonzero(is_open)
            live, fit, damping = live[kept], fit.take(kept), damping[kept]
            history = [values[kept] for values in history]
    return best


def whole_power(values: Array, power: int) -> Array:
    """Whole powers by multiplication, which every processor rounds alike."""
    total, factor = np.ones_like(values), values
    while power:
        if power & 1:
            total = total * factor
        factor, power = factor * factor, power >> 1
    return total
