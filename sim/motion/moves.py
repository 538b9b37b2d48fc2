"""The motions of a path by number: values and whole runs of straight cuts, kept as they came."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import LineRun, Motion
from sim.motion.columns import with_room

Indices = NDArray[np.int64]

NO_BLOCK = -1
"""Stands for "no block number" where block numbers are an array."""


class Moves:
    """Motions 0 to n - 1, and the source of each as arrays."""

    def __init__(self) -> None:
        self._count = 0
        self._parts: list[Sequence[Motion] | LineRun] = []
        self._firsts: list[int] = []
        self._lines = np.zeros(64, dtype=np.int64)
        self._blocks = np.zeros(64, dtype=np.int64)

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, ordinal: int) -> Motion:
        part = bisect_right(self._firsts, ordinal) - 1
        motions, place = self._parts[part], ordinal - self._firsts[part]
        return motions.cut(place) if isinstance(motions, LineRun) else motions[place]

    def append(self, motions: Sequence[Motion] | LineRun) -> None:
        """Add these, at least one, at the end."""
        first, count = self._count, self._count + len(motions)
        self._parts.append(motions)
        self._firsts.append(first)
        self._lines = with_room(self._lines, first, count)
        self._blocks = with_room(self._blocks, first, count)
        if isinstance(motions, LineRun):
            self._lines[first:count], self._blocks[first:count] = motions.lines, motions.blocks
        else:
            self._lines[first:count] = [motion.line for motion in motions]
            self._blocks[first:count] = [NO_BLOCK if motion.block is None else motion.block for motion in motions]
        self._count = count

    def sources(self, ordinals: Indices) -> tuple[Indices, Indices]:
        """Lines and block numbers (n,) of the motions of these numbers."""
        return self._lines[ordinals], self._blocks[ordinals]
