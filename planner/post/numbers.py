"""Numbers of head and tail as text, and arrays rounded to decimals."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from planner.gcode.words import decimal_text, rounded_units
from planner.path.model import Array

Decimals = NDArray[np.int64] | int


def plain(value: float, decimals: int = 4) -> str:
    """A number of head or tail, rounded to so many decimals.

    >>> plain(250.0), plain(-0.5), plain(0.0)
    ('250', '-.5', '0')
    """
    return decimal_text(rounded_units(value, decimals), decimals)


def to_units(values_mm: Array, decimals: Decimals) -> NDArray[np.int64]:
    """Values of any shape, mm, as the nearest integers of 10^-decimals mm."""
    return np.asarray(np.rint(values_mm * 10.0**decimals), dtype=np.int64)


def rounded_mm(values_mm: Array, decimals: Decimals) -> Array:
    """Values of any shape, mm, as a control reads them when written with these decimals."""
    scale = 10.0**decimals
    return np.asarray(np.rint(values_mm * scale) / scale)


def decimals_within(budgets_mm: Array) -> NDArray[np.int64]:
    """The fewest decimals at which a point (two rounded coordinates) moves by at most 0.75 of each budget.

    >>> decimals_within(np.array([0.0001, 0.001, 20.0])).tolist()
    [4, 3, 0]
    """
    decimals = np.ceil(-np.log10(1.5 / math.sqrt(2.0) * budgets_mm))
    return np.asarray(np.maximum(decimals, 0), dtype=np.int64)
