"""The search for the fewest digits: every class of numbers gives up its last digit while the bound allows it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from planner.path.model import Array

Digits = NDArray[np.int64]
Bound = Callable[[Digits], Array]


def fewest_digits(least: Digits, most: Digits, uses: Array, bound_mm: Bound, budgets_mm: Array) -> tuple[Digits, Array]:
    """Decimals (passes, classes) that no single class of any pass can lower further, and the bounds (passes,), mm.

    A pass starts at `least` and gets one digit more in every class until it holds its budget (passes,), up to `most`;
    what cannot hold it stays there. Then the classes give up digits in turn, those first that `uses` (classes,) says
    are frequent.
    """
    digits, bounds = _enough(least, most, bound_mm, budgets_mm)
    order = np.argsort(-uses, kind="stable")
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
            accepted = asks & (trial_bounds <= budgets_mm)
            digits[accepted, column] -= 1
            bounds = np.where(accepted, trial_bounds, bounds)
            may_lower[accepted, column] = True
    return digits, bounds


def _enough(least: Digits, most: Digits, bound_mm: Bound, budgets_mm: Array) -> tuple[Digits, Array]:
    digits = np.minimum(least, most)
    while True:
        bounds = bound_mm(digits)
        lacks = (bounds > budgets_mm) & (digits < most).any(axis=1)
        if not lacks.any():
            return digits, bounds
        digits[lacks] = np.minimum(digits[lacks] + 1, most[lacks])
