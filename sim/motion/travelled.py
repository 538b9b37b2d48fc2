"""The motions as the axes made them, roundings included: what the cutter is swept along."""

from __future__ import annotations

import numpy as np

from sim.interpreter.canon import Line, Motion, Polynomial, Rapid, Vector
from sim.motion.pieces import STRAIGHT
from sim.motion.track import Track


def travelled(track: Track, path_mm: float) -> list[Motion]:
    """The motions up to this path length, in order, each beginning where the one before it ends."""
    rows = track.pieces
    count = int(np.searchsorted(rows.starts[: rows.count], path_mm, side="left"))
    if count == 0:
        return []
    shapes = rows.shapes[: rows.count]
    is_rounding = np.append((shapes < STRAIGHT) | np.isin(shapes, list(track.corners)), False)
    first = np.flatnonzero(np.append(True, (shapes[1:count] != shapes[: count - 1]) | (shapes[1:count] < 0)))
    last = np.append(first[1:], count) - 1
    low = rows.offsets[first]
    high = np.minimum(path_mm, rows.ends[last]) - rows.starts[last] + rows.offsets[last]
    starts = rows.origins[first]
    ends = (starts + (high - low)[:, None] * rows.directions[first]).tolist()
    is_cut_short = (is_rounding[last + 1] | (rows.ends[last] > path_mm)).tolist()
    is_bow = shapes[first] < STRAIGHT
    bows = iter(track.bows.parts(STRAIGHT - 1 - shapes[first[is_bow]], high[is_bow]))
    made: list[Motion] = []
    for k, (shape, ordinal) in enumerate(zip(shapes[first].tolist(), rows.ordinals[first].tolist(), strict=True)):
        motion = track.moves[ordinal]
        if shape == STRAIGHT:
            start = motion.start if low[k] == 0.0 else _vector(starts[k].tolist())
            made.append(_straight(motion, start, _vector(ends[k]) if is_cut_short[k] else motion.end))
        elif shape < STRAIGHT:
            made.append(_rounding(motion, *next(bows)))
        else:
            part = track.shapes[shape].part(float(low[k]), float(high[k]))
            made.append(_straight(motion, part.start, part.end) if isinstance(motion, Rapid) else part)
    return made


def _straight(motion: Motion, start: Vector, end: Vector) -> Motion:
    """The stretch of a straight motion between these points."""
    if start == motion.start and end == motion.end:
        return motion
    if isinstance(motion, Rapid):
        return Rapid(motion.line, motion.block, start, end)
    assert isinstance(motion, Line)
    return Line(motion.line, motion.block, start, end, motion.feed_mm_min)


def _rounding(after: Motion, coefficients: list[list[float]], length: float, end: list[float]) -> Motion:
    """A rounding, or its beginning, as the motion after the corner: a polynomial, or a rapid from end to end."""
    rows = tuple(_vector(row) for row in coefficients)
    if isinstance(after, Rapid):
        return Rapid(after.line, after.block, rows[0], _vector(end))
    return Polynomial(after.line, after.block, rows[0], _vector(end), rows, (1.0,), length, after.feed_mm_min)


def _vector(row: list[float]) -> Vector:
    return (row[0], row[1], row[2])
