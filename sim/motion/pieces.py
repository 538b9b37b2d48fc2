"""The known path as columns of numbers: one row a piece, grown and cut back at its end, read by the time law."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.motion.columns import with_room

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_FLOATS = ("ends", "starts", "offsets", "caps", "feeds", "knots", "speeds", "nodes", "accs", "jerks")
_WHOLES = ("stops", "ordinals", "shapes")
_VECTORS = ("origins", "directions")

STRAIGHT = -1
"""In the column `shapes`: no curve but a straight piece; numbers below it count the roundings of straight moves."""


class Pieces:
    """Rows 0 to `count` - 1 of each column; the columns may be longer than that.

    Row q runs from `starts` to `ends`, mm of path, on motion `ordinals`; `shapes` is the index of its curve or
    STRAIGHT, from `origins` along `directions`; `offsets` is the curve's arc length at the row's start. `caps`
    mm/s (axes, curvature, block cycle), `feeds` mm/s (as programmed), `knots` mm/s (what the join at its end allows),
    `accs` mm/s2, `jerks` mm/s3, `stops` 1 where the path stops at its end. `speeds` and `nodes` follow from these and
    the override.
    """

    ends: Array
    starts: Array
    offsets: Array
    caps: Array
    feeds: Array
    knots: Array
    speeds: Array
    nodes: Array
    accs: Array
    jerks: Array
    stops: Indices
    ordinals: Indices
    shapes: Indices
    origins: Array
    directions: Array

    def __init__(self) -> None:
        self.count = 0
        for name in _FLOATS:
            setattr(self, name, np.zeros(64))
        for name in _WHOLES:
            setattr(self, name, np.zeros(64, dtype=np.int64))
        for name in _VECTORS:
            setattr(self, name, np.zeros((64, 3)))

    def append(self, rows: int, **columns: Array | Indices | float) -> None:
        """Add rows; every column but `speeds` and `nodes` is given, as an array (rows, ...) or one value for all."""
        stop = self.count + rows
        if stop > len(self.ends):
            for name in (*_FLOATS, *_WHOLES, *_VECTORS):
                setattr(self, name, with_room(getattr(self, name), self.count, stop))
        for name, value in columns.items():
            getattr(self, name)[self.count : stop] = value
        self.count = stop

    def cut(self, count: int) -> None:
        """Forget the rows from `count` on."""
        self.count = count

    def limit(self, override: float, first: int) -> None:
        """Speeds and nodes of the rows from `first` on, for this override (1.0 as programmed)."""
        stop = self.count
        speeds = np.minimum(self.caps[first:stop], self.feeds[first:stop] * override)
        self.speeds[first:stop] = speeds
        nodes = np.minimum(self.knots[first:stop], speeds)
        nodes[:-1] = np.minimum(nodes[:-1], speeds[1:])
        self.nodes[first:stop] = np.where(self.stops[first:stop] != 0, 0.0, nodes)
