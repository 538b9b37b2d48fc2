"""Columns of numbers that grow at their end."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Kind = TypeVar("Kind", np.float64, np.int64)


def with_room(column: NDArray[Kind], used: int, needed: int) -> NDArray[Kind]:
    """The column itself if it has `needed` rows, else a copy of its first `used` rows with room for twice as many."""
    if needed <= len(column):
        return column
    longer = np.zeros((max(2 * len(column), needed), *column.shape[1:]), dtype=column.dtype)
    longer[:used] = column[:used]
    return longer
