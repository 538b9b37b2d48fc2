"""The path as the time law reads it, and the law's state: which number stands where, and how one step goes along it.

Plain functions of numbers and arrays: `sim.motion.fast` compiles this very text.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

END, SPEED, NODE, CAP, KNOT, ACC, JERK, STOP = range(8)
ROW_SIZE = 8
"""Places in a row, one a piece: path length at its end mm; greatest speed on it and at its end, mm/s, override
included, and the same as the machine allows at any override; acceleration mm/s2 and jerk mm/s3 along the path; 1.0
where the path stops at its end."""

S, V, A, PIECE, HORIZON, LANDING_LEFT, LANDING_STEPS, ALPHA, BETA, GAMMA, LANDING_END = range(11)
PROVED, WAY_AT, WAY_END, WAY_REST = range(11, 15)
STATE_SIZE = 15
"""Places in the state: path length, speed, acceleration; the piece, the last piece known; a landing is (alpha, beta,
gamma) over its steps, towards LANDING_END. The last piece that the proved way to standstill reckons with; where it was
written down, its next jerk, how many there are, and the path length where it ends."""


def piece_at(s: float, piece: int, last: int, rows: Array) -> int:
    """Index of the piece that holds path length s, from `piece` on."""
    while piece < last and rows[piece, END] <= s:
        piece += 1
    return piece


def step_to(s: float, v: float, a: float, j: float, piece: int, last: int, rows: Array) -> int:
    """The piece that holds s, if a step with jerk j from `piece` that ends at (s, v, a) breaks no limit; else -1."""
    acceleration, jerk, top = rows[piece, ACC], rows[piece, JERK], rows[piece, CAP]
    while rows[piece, END] <= s:
        if piece == last or rows[piece, STOP] != 0.0:
            return -1
        top = min(top, rows[piece, KNOT], rows[piece + 1, CAP])
        piece += 1
        acceleration, jerk = min(acceleration, rows[piece, ACC]), min(jerk, rows[piece, JERK])
    if v > top * (1.0 + 1e-9) or v < -1e-9 or abs(a) > acceleration * (1.0 + 1e-9) or abs(j) > jerk * (1.0 + 1e-9):
        return -1
    return piece
