"""The known path as columns of numbers: one row a piece, grown and cut back at its end, read by the time law."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.motion.columns import with_room
from sim.motion.rows import ACC, CAP, END, JERK, KNOT, NODE, ROW_SIZE, SPEED, STOP

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_PLACES = {"ends": END, "caps": CAP, "knots": KNOT, "accs": ACC, "jerks": JERK, "stops": STOP}

STRAIGHT = -1
"""In the column `shapes`: no curve but a straight piece; numbers below it count the roundings of straight moves."""


class Pieces:
    """Rows 0 to `count` - 1 of each column; the columns may be longer than that.

    `rows` (n, ROW_SIZE) is what the time law reads (`sim.motion.rows`). Piece q runs from `starts` on, mm of path, on
    motion `ordinals`, with `feeds` mm/s as programmed; `shapes` is the index of its curve or STRAIGHT, from `origins`
    along `directions`; `offsets` is the curve's arc length at the piece's start.
    """

    def __init__(self) -> None:
        self.count = 0
        self.rows = np.zeros((64, ROW_SIZE))
        self.starts, self.offsets, self.feeds = np.zeros(64), np.zeros(64), np.zeros(64)
        self.ordinals, self.shapes = np.zeros(64, dtype=np.int64), np.zeros(64, dtype=np.int64)
        self.origins, self.directions = np.zeros((64, 3)), np.zeros((64, 3))

    @property
    def ends(self) -> Array:
        """Path length at the end of each piece, mm."""
        return self.rows[:, END]

    def append(self, count: int, **columns: Array | Indices | float) -> None:
        """Add pieces: every column by name, as an array (count, ...) or one value for all.

        Columns of `rows`: `ends` mm, `caps` mm/s (axes, curvature, block cycle), `knots` mm/s (what the join at its
        end allows), `accs` mm/s2, `jerks` mm/s3, `stops` 1 where the path stops at its end; SPEED and NODE follow.
        """
        stop = self.count + count
        if stop > len(self.starts):
            for name in ("rows", "starts", "offsets", "feeds", "ordinals", "shapes", "origins", "directions"):
                setattr(self, name, with_room(getattr(self, name), self.count, stop))
        for name, value in columns.items():
            if name in _PLACES:
                self.rows[self.count : stop, _PLACES[name]] = value
            else:
                getattr(self, name)[self.count : stop] = value
        self.count = stop

    def cut(self, count: int) -> None:
        """Forget the pieces from `count` on."""
        self.count = count

    def limit(self, override: float, first: int) -> None:
        """Speeds and nodes of the pieces from `first` on, for this override (1.0 as programmed); rapids up to 1.0."""
        rows = self.rows[first : self.count]
        feeds = self.feeds[first : self.count]
        is_rapid = np.isinf(feeds)
        as_set = np.where(is_rapid, rows[:, CAP] * min(override, 1.0), np.where(is_rapid, 0.0, feeds) * override)
        speeds = np.minimum(rows[:, CAP], as_set)
        nodes = np.minimum(rows[:, KNOT], speeds)
        nodes[:-1] = np.minimum(nodes[:-1], speeds[1:])
        rows[:, SPEED] = speeds
        rows[:, NODE] = np.where(rows[:, STOP] != 0.0, 0.0, nodes)
