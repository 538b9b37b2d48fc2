"""Decimal numbers as a control reads them, in the fewest bytes; values are integers of the last digit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def decimal_text(units: int, decimals: int, *, point: bool = False) -> str:
    """`units` x 10^-decimals without superfluous zeros; with `point`, whole numbers end in a decimal point.

    >>> decimal_text(-1250, 3), decimal_text(500, 3), decimal_text(20000, 3), decimal_text(7, 0, point=True)
    ('-1.25', '.5', '20', '7.')
    """
    sign, digits = ("-", str(-units)) if units < 0 else ("", str(units))
    whole, part = digits, ""
    if decimals > 0:
        digits = digits.rjust(decimals + 1, "0")
        whole, part = digits[:-decimals], digits[-decimals:].rstrip("0")
    if part:
        return f"{sign}{'' if whole == '0' else whole}.{part}"
    return f"{sign}{whole}." if point else f"{sign}{whole}"


def plain(value: float, decimals: int = 4) -> str:
    """A number of head or tail, rounded to so many decimals.

    >>> plain(250.0), plain(-0.5), plain(0.0)
    ('250', '-.5', '0')
    """
    return decimal_text(round(value * 10**decimals), decimals)


def to_units(values_mm: NDArray[np.float64], decimals: int) -> NDArray[np.int64]:
    """Values of any shape, mm, as the nearest integers of 10^-decimals mm."""
    return np.rint(values_mm * 10.0**decimals).astype(np.int64)
