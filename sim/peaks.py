"""Peak acceleration and jerk of a motion log, from differences of its positions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def peaks(t_s: Floats, position_mm: Floats) -> tuple[float, float]:
    """(acceleration mm/s2, jerk mm/s3), the largest of any axis, from times (n,) and positions (n, 3).

    Differences are taken only over samples at equal steps, so a wait in the log makes no false peak.

    >>> t = np.arange(6.0)
    >>> peaks(t, np.stack([t**3, 0 * t, 0 * t], axis=1))
    (24.0, 6.0)
    """
    result = []
    for order in (2, 3):
        if len(t_s) <= order:
            result.append(0.0)
            continue
        steps = np.diff(t_s)
        windows = np.lib.stride_tricks.sliding_window_view(steps, order)
        step = windows.mean(axis=1)
        is_even = np.ptp(windows, axis=1) < 1e-3 * step
        change = np.abs(np.diff(position_mm, order, axis=0)) / step[:, None] ** order
        result.append(float(change[is_even].max(initial=0.0)))
    return result[0], result[1]
