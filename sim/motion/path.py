"""From canonical motions to pieces with limits: the control's preparation.

Each motion becomes one piece if it is straight, several if it is curved, with a rounding piece before it where the
path mode asks for one. The last motion's end stays open: whether it is a corner, a rounding or a stop shows when the
next motion arrives; until then the time law must be able to stop there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import Line, Motion, PathMode, Rapid, Vector
from sim.motion.blend import round_corner
from sim.motion.limits import OVERRIDE_TOP, AxisLimits, PieceLimits, Shares, bend_speed, curved_limits, straight_limits
from sim.motion.pieces import Pieces
from sim.motion.shapes import LineShape, Shape, shape_of
from sim.motion.values import Rounding, StopReason

Array = NDArray[np.float64]

SAME_PLACE_MM = 1e-7
"""Ends nearer than this are one point; far below any control's resolution."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """A motion with what was modal when it was prepared; `is_after_stop`: something before it makes the axes stop."""

    motion: Motion
    mode: PathMode
    tolerance_mm: float
    is_jerk_limited: bool
    is_after_stop: bool
    is_exact_stop: bool


@dataclass(slots=True)
class _Tail:
    """The last motion, whose end is still open."""

    prepared: Prepared
    shape: Shape
    ordinal: int
    first_piece: int
    path_start_mm: float
    trim_mm: float


class Path:
    """The whole path of a run, as far as it is known."""

    def __init__(self, axes: AxisLimits, overload: float, speed_error: float) -> None:
        self._soft = axes
        self._brisk = AxisLimits(axes.speed, axes.acceleration, axes.acceleration / axes.cycle_s, axes.cycle_s)
        self._overload = overload
        self._speed_error = speed_error
        self.pieces = Pieces()
        self.shapes: list[Shape] = []
        self.motions: list[Motion] = []
        self.trims: list[tuple[float, float]] = []
        self.blends: dict[int, Shape] = {}
        self.roundings: list[Rounding] = []
        self.reasons: dict[int, StopReason] = {}
        self._tail: _Tail | None = None

    def add(self, batch: Sequence[Prepared], committed_mm: float) -> int:
        """Append motions; returns the first piece that changed.

        The path up to `committed_mm` (where the machine can stop now) is not altered: a corner that comes too late to
        be rounded becomes a stop.
        """
        first = self.pieces.count if self._tail is None else self._tail.first_piece
        for prepared in batch:
            self._add(prepared, committed_mm)
        return first

    def stop_at_end(self) -> int:
        """Make the open end a stop; returns the first piece that changed."""
        if self._tail is None or self.pieces.count == 0:
            return self.pieces.count
        self.pieces.stops[self.pieces.count - 1] = 1
        self._tail = None
        return self.pieces.count - 1

    def _add(self, prepared: Prepared, committed_mm: float) -> None:
        shape = shape_of(prepared.motion, self._speed_error)
        tail, trim = self._tail, 0.0
        start = self.pieces.ends[self.pieces.count - 1] if self.pieces.count else 0.0
        if tail is not None:
            trim = self._join(tail, prepared, shape, committed_mm)
            start = self.pieces.ends[self.pieces.count - 1]
        ordinal = len(self.motions)
        self.motions.append(prepared.motion)
        self.trims.append((trim, 0.0))
        self._tail = _Tail(prepared, shape, ordinal, self.pieces.count, float(start), trim)
        self._lay(shape, trim, shape.length_mm, prepared, ordinal, float(start), shape.length_mm)
        if prepared.is_exact_stop or prepared.mode is PathMode.EXACT_STOP:
            self.reasons[ordinal] = StopReason.EXACT_STOP
            self.stop_at_end()

    def _join(self, tail: _Tail, after: Prepared, shape: Shape, committed_mm: float) -> float:
        """Settle the open corner before `after`; returns how much of its beginning the rounding takes."""
        last = self.pieces.count - 1
        before = tail.shape
        axes = self._soft if after.is_jerk_limited else self._brisk
        t1, k1, _ = before.derivatives(np.array([before.length_mm]))
        t0, k0, _ = shape.derivatives(np.array([0.0]))
        gap = np.linalg.norm(np.array(after.motion.start) - np.array(tail.prepared.motion.end))
        is_switch = after.is_jerk_limited is not tail.prepared.is_jerk_limited
        if after.is_after_stop or gap > SAME_PLACE_MM:
            return self._stop(tail, StopReason.EXACT_STOP)
        is_rapid = isinstance(after.motion, Rapid) or isinstance(tail.prepared.motion, Rapid)
        rounds = after.mode in (PathMode.ROUNDING_DISTANCE, PathMode.ROUNDING_TOLERANCE) and not is_switch
        if after.mode is PathMode.ROUNDING_DISTANCE and is_rapid:
            rounds = False
        overload = self._overload * axes.acceleration * axes.cycle_s
        if not rounds:
            self.pieces.knots[last] = bend_speed(t0 - t1, k0 - k1, axes, overload)[0]
            return 0.0
        smooth = 0.1 * axes.jerk * axes.cycle_s**2
        knee = bend_speed(t0 - t1, k0 - k1, axes, smooth)[0]
        fastest = OVERRIDE_TOP * min(self.pieces.feeds[last], _feed_mm_s(after.motion), float(np.max(axes.speed)))
        bend_only = bend_speed(t0 - t1, np.zeros((1, 3)), axes, smooth)[0]
        if bend_only >= min(fastest, self.pieces.caps[last]):
            self.pieces.knots[last] = knee
            return 0.0
        rounding = round_corner(
            before,
            shape,
            tail.trim_mm,
            after.tolerance_mm,
            after.mode is PathMode.ROUNDING_TOLERANCE,
            self._speed_error,
        )
        end_mm = tail.path_start_mm + before.length_mm - tail.trim_mm
        if rounding is None:
            return self._stop(tail, StopReason.CORNER)
        if end_mm - rounding.reach_mm < committed_mm:
            return self._stop(tail, StopReason.LATE)
        kept = before.length_mm - rounding.reach_mm
        self.pieces.cut(tail.first_piece)
        self._lay(before, tail.trim_mm, kept, tail.prepared, tail.ordinal, tail.path_start_mm, before.length_mm)
        self.trims[-1] = (tail.trim_mm, rounding.reach_mm)
        ordinal = len(self.motions)
        start = float(self.pieces.ends[self.pieces.count - 1]) if self.pieces.count else tail.path_start_mm
        lead = Prepared(rounding.motion(after.motion), after.mode, 0.0, after.is_jerk_limited, False, False)
        self._lay(rounding.shape, 0.0, rounding.shape.length_mm, lead, ordinal, start, np.inf)
        self.blends[ordinal] = rounding.shape
        self.roundings.append(
            Rounding(rounding.deviation_mm, after.motion.start, after.motion.line, after.motion.block)
        )
        return rounding.reach_mm

    def _stop(self, tail: _Tail, reason: StopReason) -> float:
        """The corner is a stop for this reason; nothing of the next motion is taken."""
        self.pieces.stops[self.pieces.count - 1] = 1
        self.reasons[tail.ordinal] = reason
        return 0.0

    def _lay(
        self,
        shape: Shape,
        from_mm: float,
        to_mm: float,
        prepared: Prepared,
        ordinal: int,
        path_mm: float,
        block_mm: float,
    ) -> None:
        """Pieces for this stretch of the shape, beginning at `path_mm` of the path."""
        if to_mm <= from_mm:
            return
        axes = self._soft if prepared.is_jerk_limited else self._brisk
        feed = _feed_mm_s(prepared.motion)
        block_cap = 0.9 * block_mm / axes.cycle_s
        if isinstance(shape, LineShape):
            direction = shape.derivatives(np.zeros(1))[0]
            edges = np.array([from_mm, to_mm])
            limits = straight_limits(direction, axes)
            index, origin = -1, shape.points(np.array([from_mm]))
        else:
            edges, limits = _curved(shape, from_mm, to_mm, feed, axes)
            index, origin, direction = len(self.shapes), np.zeros((1, 3)), np.zeros((1, 3))
            self.shapes.append(shape)
        self.pieces.append(
            len(edges) - 1,
            starts=path_mm + edges[:-1] - from_mm,
            ends=path_mm + edges[1:] - from_mm,
            offsets=edges[:-1] if index >= 0 else 0.0,
            caps=np.minimum(limits.speed, block_cap),
            feeds=feed,
            knots=np.inf,
            accs=limits.acceleration,
            jerks=limits.jerk,
            stops=0,
            ordinals=ordinal,
            shapes=index,
            origins=origin,
            directions=direction,
        )

    def positions(self, path_mm: Array, piece: NDArray[np.int64]) -> Array:
        """Points (n, 3), mm, at these path lengths on these pieces."""
        rows = self.pieces
        local = path_mm - rows.starts[piece]
        points = rows.origins[piece] + local[:, None] * rows.directions[piece]
        curve = rows.shapes[piece]
        for index in np.unique(curve[curve >= 0]):
            here = curve == index
            points[here] = self.shapes[index].points(rows.offsets[piece[here]] + local[here])
        return np.asarray(points)

    def travelled(self, ordinal: int, path_mm: float, piece: int) -> list[Motion]:
        """What was really cut: every motion before `ordinal`, and the part of it before `path_mm`, roundings included."""
        done: list[Motion] = []
        for k in range(min(ordinal + 1, len(self.motions))):
            motion = self.motions[k]
            first, last = self.trims[k]
            stretches: list[tuple[Shape, float, float]] = []
            if k in self.blends:
                stretches.append((self.blends[k], 0.0, self.blends[k].length_mm))
            if k < ordinal and first == 0.0 and last == 0.0 and not stretches:
                done.append(motion)
                continue
            shape = shape_of(motion, self._speed_error)
            stretches.append((shape, first, shape.length_mm - last))
            if k == ordinal:
                stretches = self._so_far(stretches, path_mm, piece)
            done.extend(shape.part(low, high) for shape, low, high in stretches if high > low)
        return done

    def _so_far(
        self, stretches: list[tuple[Shape, float, float]], path_mm: float, piece: int
    ) -> list[tuple[Shape, float, float]]:
        """The part of one motion's stretches that lies before this place."""
        rows = self.pieces
        first = int(np.searchsorted(rows.ordinals[: rows.count], rows.ordinals[piece]))
        left = path_mm - rows.starts[first]
        result = []
        for shape, low, high in stretches:
            reach = min(high, low + left)
            left -= high - low
            result.append((shape, low, reach))
        return result


def _curved(
    shape: Shape, from_mm: float, to_mm: float, feed_mm_s: float, axes: AxisLimits
) -> tuple[Array, PieceLimits]:
    """Edges of the pieces of a curve, and their limits: as few as the limits need."""
    count, inner, margin = 16, 4, 1.02
    at = np.linspace(from_mm, to_mm, count * inner + 1)
    bounds = []
    for derivative in shape.derivatives(at):
        size = np.abs(derivative)
        bounds.append(margin * np.max([size[k : len(at) - inner + k : inner] for k in range(inner + 1)], axis=0))
    feed = np.full(count, min(feed_mm_s, float(np.max(axes.speed))))
    limits = curved_limits(bounds[0], bounds[1], bounds[2], feed, axes, Shares())
    edges = at[::inner]
    is_even = np.min(limits.speed) >= OVERRIDE_TOP * feed[0] or np.ptp(limits.speed) < 0.05 * np.max(limits.speed)
    if is_even and np.min(limits.acceleration) > 0.8 * np.max(limits.acceleration):
        one = PieceLimits(
            np.min(limits.speed, keepdims=True),
            np.min(limits.acceleration, keepdims=True),
            np.min(limits.jerk, keepdims=True),
        )
        return edges[[0, -1]], one
    return edges, limits


def _feed_mm_s(motion: Motion) -> float:
    return np.inf if isinstance(motion, Rapid) else motion.feed_mm_min / 60.0


def is_standing(motion: Motion) -> bool:
    """Whether a straight motion goes nowhere."""
    return isinstance(motion, Line | Rapid) and _distance(motion.start, motion.end) <= SAME_PLACE_MM


def _distance(a: Vector, b: Vector) -> float:
    return float(np.linalg.norm(np.subtract(a, b)))
