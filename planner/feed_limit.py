"""How fast a program may be cut through a serial line: the feed at which some stretch of it would starve.

A pure function of block sizes and lengths; it knows neither the language nor the port.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def feed_limit_mm_min(
    block_bytes: Array, cut_mm: Array, other_s: Array, *, bytes_per_s: float, override: float, window_s: float = 2.0
) -> float:
    """The highest programmed feed, mm/min, at which the line keeps up with every window of the program, eq. (17).

    Block i has `block_bytes[i]` bytes, cuts `cut_mm[i]` at the feed and takes `other_s[i]` besides (plunges, dwells;
    both at this override already). In no window of `window_s` seconds of machine time that begins with a cutting block
    may more bytes fall due than the line brings; a block falls due when it begins. Infinite where nothing starves.

    >>> one = np.ones(1000)
    >>> round(feed_limit_mm_min(20 * one, one, 0 * one, bytes_per_s=960, override=1.0), 1)
    2880.0
    """
    cuts = np.flatnonzero(cut_mm > 0)
    before = np.append(0.0, np.cumsum(block_bytes))
    room = bytes_per_s * window_s

    def starves(feed_mm_s: float) -> bool:
        start_s = np.append(0.0, np.cumsum(cut_mm / (feed_mm_s * override) + other_s))[:-1]
        beyond = np.searchsorted(start_s, start_s[cuts] + window_s - 1e-9 * window_s)
        return bool(np.any(before[beyond] - before[cuts] > room * (1 + 1e-12)))

    low, high = 1e-3, 1e6
    if not starves(high):
        return float("inf")
    if starves(low):
        return 0.0
    while high - low > 1e-6 * low:
        middle = np.sqrt(low * high)
        low, high = (low, middle) if starves(middle) else (middle, high)
    return 60.0 * float(low)
