"""The search for the fewest digits: every class of numbers gives up its last digit while the bound allows it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from planner.path.model import Array

Digits = NDArray[np.int64]
Bound = Callable[[Digits], Array]


def fewest_digits(start: Digits, uses: Array, bound_mm: Bound, budget_mm: float) -> tuple[Digits, Array]:
    """Decimals (passes, classes) that no single class of any pass can lower further, and the bounds (passes,), mm.

    `uses` (classes,) says how many numbers a pass has of each class. Two orders of giving up are tried, the frequent
    classes first and last, and each pass keeps the shorter. `start` must hold the budget where it can be held at all;
    passes that exceed it keep their start.
    """
    order = np.argsort(-uses, kind="stable")
    digits, bounds = _lowered(start, order, bound_mm, budget_mm)
    other, other_bounds = _lowered(start, order[::-1], bound_mm, budget_mm)
    is_shorter = other @ uses < digits @ uses
    return np.where(is_shorter[:, None], other, digits), np.where(is_shorter, other_bounds, bounds)


def _lowered(start: Digits, order: NDArray[np.intp], bound_mm: Bound, budget_mm: float) -> tuple[Digits, Array]:
    digits, bounds = start.copy(), bound_mm(start)
    may_lower = np.ones_like(digits, dtype=bool)
    while may_lower.any():
        for column in order:
            asks = may_lower[:, column] & (digits[:, column] > 0)
            may_lower[:, column] = False
            if not asks.any():
                continue
            trial = digits.copy()
            trial[asks, column] -= 1
            trial_bounds = bound_mm(trial)
            accepted = asks & (trial_bounds <= budget_mm)
            digits[accepted, column] -= 1
            bounds = np.where(accepted, trial_bounds, bounds)
            may_lower[accepted, column] = True
    return digits, bounds
