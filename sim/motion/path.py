"""From canonical motions to pieces with limits: the control's preparation.

A straight motion becomes one piece, a curved one several where its limits vary, with a rounding before it where the
path mode asks for one. The last motion's end stays open: whether it is a corner, a rounding or a stop shows when the
next motion arrives; until then the time law must be able to stop there. A corner is passed as the mode of the block
before it says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import Line, Motion, PathMode, Rapid
from sim.motion.blend import round_corner
from sim.motion.bows import Bows
from sim.motion.limits import OVERRIDE_TOP, AxisLimits, Shares, bend_speed, curve_pieces, curved_limits, straight_limits
from sim.motion.pieces import Pieces
from sim.motion.shapes import LineShape, Shape, shape_of
from sim.motion.straight import Legs, Modal, corners_of, feed_mm_s, legs_of
from sim.motion.values import Rounding, StopReason

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_STRAIGHT = -1


@dataclass(frozen=True, slots=True)
class Run:
    """Motions under one modal state: any number of straight ones, or one curve.

    `is_after_stop`: something before the first makes the axes stand; `is_exact_stop`: the last ends with one.
    """

    motions: Sequence[Motion]
    modal: Modal
    is_after_stop: bool
    is_exact_stop: bool


@dataclass(frozen=True, slots=True)
class _Tail:
    """The last motion, whose end is open: rows from `first_piece` on, `trim_mm` of it gone to the rounding before."""

    motion: Motion
    shape: Shape
    modal: Modal
    ordinal: int
    first_piece: int
    trim_mm: float


class Path:
    """The whole path of a run of the program, as far as it is known.

    `same_place_mm`: ends nearer than this are one point, a move shorter than this is none.
    """

    def __init__(self, axes: AxisLimits, overload: float, speed_error: float, same_place_mm: float) -> None:
        self._soft = axes
        self._brisk = AxisLimits(axes.speed, axes.acceleration, axes.acceleration / axes.cycle_s, axes.cycle_s)
        self._overload = overload
        self._speed_error = speed_error
        self._same_place_mm = same_place_mm
        self._is_after_stop = self._is_extra_stop = False
        self._tail: _Tail | None = None
        self._bows = Bows()
        self._shapes: list[Shape] = []
        self._corners: set[int] = set()
        self._roundings: list[tuple[int, float]] = []
        self.pieces = Pieces()
        self.motions: list[Motion] = []
        self.reasons: dict[int, StopReason] = {}

    def add(self, runs: Sequence[Run], committed_mm: float) -> int:
        """Append motions; returns the first piece that changed.

        The path up to `committed_mm` (where the machine can stop now) is not altered: a corner that comes too late to
        be rounded becomes a stop.
        """
        first = self.pieces.count if self._tail is None else self._tail.first_piece
        for run in runs:
            self._is_after_stop |= run.is_after_stop
            if isinstance(run.motions[0], Line | Rapid):
                self._add_legs(run, committed_mm)
            else:
                self._add_curve(run, committed_mm)
            if run.is_exact_stop or run.modal.mode is PathMode.EXACT_STOP:
                self._stop(StopReason.EXACT_STOP)
        return first

    def _add_legs(self, run: Run, committed_mm: float) -> None:
        moves = [motion for motion in run.motions if isinstance(motion, Line | Rapid)]
        legs, goes = legs_of(moves, self._axes(run.modal), self._same_place_mm)
        ordinals = len(self.motions) + np.flatnonzero(goes)
        self.motions.extend(moves)
        if len(ordinals) == 0:
            return
        first, last = self.motions[ordinals[0]], self.motions[ordinals[-1]]
        trim = self._join(first, shape_of(first, self._speed_error), int(ordinals[0]), run.modal, committed_mm)
        before = self._lay_legs(legs, ordinals, run.modal, trim)
        self._tail = _Tail(
            last, shape_of(last, self._speed_error), run.modal, int(ordinals[-1]), self.pieces.count - 1, before
        )

    def _add_curve(self, run: Run, committed_mm: float) -> None:
        motion = run.motions[0]
        shape = shape_of(motion, self._speed_error)
        ordinal = len(self.motions)
        self.motions.append(motion)
        if shape.length_mm <= self._same_place_mm:
            return
        trim = self._join(motion, shape, ordinal, run.modal, committed_mm)
        first_piece = self.pieces.count
        self._lay(shape, (trim, shape.length_mm), ordinal, run.modal, self._own_limit(motion, shape))
        self._tail = _Tail(motion, shape, run.modal, ordinal, first_piece, trim)

    # --- joins

    def _join(self, motion: Motion, shape: Shape, ordinal: int, modal: Modal, committed_mm: float) -> float:
        """Settle the open end before this motion; returns how much of its beginning a rounding takes."""
        tail, is_after_stop = self._tail, self._is_after_stop
        self._is_after_stop = False
        if tail is None:
            return 0.0
        if is_after_stop or np.max(np.abs(np.subtract(motion.start, tail.motion.end))) > self._same_place_mm:
            self._stop(None if is_after_stop else StopReason.EXACT_STOP)
            return 0.0
        if isinstance(shape, LineShape) and isinstance(tail.shape, LineShape):
            return self._join_legs(tail, motion, ordinal, modal, committed_mm)
        return self._join_curves(tail, motion, shape, ordinal, modal, committed_mm)

    def _join_legs(self, tail: _Tail, motion: Motion, ordinal: int, modal: Modal, committed_mm: float) -> float:
        assert isinstance(tail.motion, Line | Rapid)
        assert isinstance(motion, Line | Rapid)
        axes = self._axes(tail.modal)
        legs, _ = legs_of([tail.motion, motion], axes, self._same_place_mm)
        is_switch = modal.is_jerk_limited is not tail.modal.is_jerk_limited
        mode = Modal(PathMode.CONTINUOUS, 0.0, modal.is_jerk_limited) if is_switch else tail.modal
        corners = corners_of(legs, mode, axes, self._overload, self._same_place_mm)
        reach = float(corners.reach[0])
        if corners.are_sharp[0] or self._comes_late(reach, committed_mm):
            self._stop(StopReason.CORNER if corners.are_sharp[0] else StopReason.LATE)
            return 0.0
        if reach == 0.0:
            self.pieces.knots[self.pieces.count - 1] = corners.speed[0]
            return 0.0
        self._shorten(tail, reach)
        length, columns = self._bow_columns(legs, np.zeros(1, dtype=np.int64), corners.reach, axes, np.array([ordinal]))
        start_mm = self._end_mm()
        self.pieces.append(1, starts=start_mm, ends=start_mm + length, **columns)
        return reach

    def _join_curves(
        self, tail: _Tail, motion: Motion, shape: Shape, ordinal: int, modal: Modal, committed_mm: float
    ) -> float:
        last, axes, mode = self.pieces.count - 1, self._axes(tail.modal), tail.modal.mode
        t1, k1, _ = tail.shape.derivatives(np.array([tail.shape.length_mm]))
        t0, k0, _ = shape.derivatives(np.array([0.0]))
        rounds = mode in (PathMode.ROUNDING_DISTANCE, PathMode.ROUNDING_TOLERANCE)
        is_rapid = isinstance(motion, Rapid) or isinstance(tail.motion, Rapid)
        is_switch = modal.is_jerk_limited is not tail.modal.is_jerk_limited
        if not rounds or is_switch or (mode is PathMode.ROUNDING_DISTANCE and is_rapid):
            step = self._overload * axes.acceleration * axes.cycle_s
            self.pieces.knots[last] = bend_speed(t0 - t1, k0 - k1, axes, step)[0]
            return 0.0
        smooth = 0.1 * axes.jerk * axes.cycle_s**2
        fastest = OVERRIDE_TOP * min(feed_mm_s(tail.motion), feed_mm_s(motion))
        if bend_speed(t0 - t1, 0.0 * k0, axes, smooth)[0] >= min(fastest, self.pieces.caps[last]):
            self.pieces.knots[last] = bend_speed(t0 - t1, k0 - k1, axes, smooth)[0]
            return 0.0
        corner = round_corner(
            tail.shape,
            shape,
            tail.trim_mm,
            tail.modal.tolerance_mm,
            mode is PathMode.ROUNDING_TOLERANCE,
            self._speed_error,
        )
        if corner is None or self._comes_late(corner.reach_mm, committed_mm):
            self._stop(StopReason.CORNER if corner is None else StopReason.LATE)
            return 0.0
        self._shorten(tail, corner.reach_mm)
        self._corners.add(len(self._shapes))
        feed = min(feed_mm_s(tail.motion), feed_mm_s(motion))
        self._lay(corner.shape_for(motion), (0.0, corner.shape.length_mm), ordinal, tail.modal, (feed, np.inf))
        self._roundings.append((ordinal, corner.deviation_mm))
        return corner.reach_mm

    def _comes_late(self, reach_mm: float, committed_mm: float) -> bool:
        return reach_mm > 0.0 and self._end_mm() - reach_mm < committed_mm and committed_mm > 0.0

    def _shorten(self, tail: _Tail, reach_mm: float) -> None:
        """Lay the last motion again, without what the rounding after it takes."""
        self.pieces.cut(tail.first_piece)
        stretch = tail.trim_mm, tail.shape.length_mm - reach_mm
        self._lay(tail.shape, stretch, tail.ordinal, tail.modal, self._own_limit(tail.motion, tail.shape))

    def _stop(self, reason: StopReason | None) -> None:
        """The open end is a stop."""
        if self._tail is None:
            return
        self.pieces.stops[self.pieces.count - 1] = 1
        if reason is not None:
            self.reasons[self._tail.ordinal] = reason
        self._tail = None

    # --- rows

    def _lay_legs(self, legs: Legs, ordinals: Indices, modal: Modal, trim_mm: float) -> float:
        """Rows for these legs and the roundings between them; returns what the last rounding takes of the last leg."""
        axes, count = self._axes(modal), len(legs.lengths)
        corners = corners_of(legs, modal, axes, self._overload, self._same_place_mm)
        stops = corners.are_gaps | corners.are_sharp | (modal.mode is PathMode.EXACT_STOP)
        for k in np.flatnonzero(stops):
            self.reasons[int(ordinals[k])] = StopReason.CORNER if corners.are_sharp[k] else StopReason.EXACT_STOP
        before = np.concatenate([[trim_mm], corners.reach])
        after = np.concatenate([corners.reach, [0.0]])
        body = {
            "caps": np.minimum(legs.limits.speed, OVERRIDE_TOP * legs.feeds),
            "feeds": legs.feeds,
            "accs": legs.limits.acceleration,
            "jerks": legs.limits.jerk,
            "ordinals": ordinals,
            "origins": legs.starts + before[:, None] * legs.directions,
            "directions": legs.directions,
            "shapes": np.full(count, _STRAIGHT, dtype=np.int64),
            "offsets": before,
            "knots": np.concatenate([np.where(corners.reach > 0.0, np.inf, corners.speed), [np.inf]]),
            "stops": np.concatenate([stops, [False]]).astype(np.int64),
        }
        lengths = legs.lengths - before - after
        rows = np.flatnonzero(corners.reach > 0.0)
        if len(rows):
            bow_lengths, bows = self._bow_columns(legs, rows, corners.reach, axes, ordinals[rows + 1])
            at = rows + 1
            lengths = np.insert(lengths, at, bow_lengths)
            body = {name: np.insert(column, at, bows[name], axis=0) for name, column in body.items()}
        exists = lengths > 1e-12
        edges = np.cumsum(np.concatenate([[self._end_mm()], lengths[exists]]))
        columns = {name: column[exists] for name, column in body.items()}
        self.pieces.append(len(edges) - 1, starts=edges[:-1], ends=edges[1:], **columns)
        return float(before[-1])

    def _bow_columns(
        self, legs: Legs, rows: Indices, reach: Array, axes: AxisLimits, ordinals: Indices
    ) -> tuple[Array, dict[str, Array | Indices]]:
        """Lengths and columns of the roundings after the legs `rows`; they belong to the motions `ordinals`."""
        index = self._bows.count + np.arange(len(rows))
        d = reach[rows]
        length, bounds, half_sine = self._bows.append(
            legs.ends[rows], legs.directions[rows], legs.directions[rows + 1], d
        )
        feed = np.minimum(legs.feeds[rows + 1], legs.feeds[rows])
        limits = curved_limits(*bounds, np.minimum(feed, np.max(axes.speed)), axes, Shares())
        self._roundings.extend(zip(ordinals.tolist(), (0.375 * d * half_sine).tolist(), strict=True))
        none = np.zeros((len(rows), 3))
        return length, {
            "caps": np.minimum(limits.speed, OVERRIDE_TOP * feed),
            "feeds": feed,
            "accs": limits.acceleration,
            "jerks": limits.jerk,
            "ordinals": ordinals,
            "origins": none,
            "directions": none,
            "shapes": -2 - index,
            "offsets": np.zeros(len(rows)),
            "knots": np.full(len(rows), np.inf),
            "stops": np.zeros(len(rows), dtype=np.int64),
        }

    def _lay(
        self, shape: Shape, stretch_mm: tuple[float, float], ordinal: int, modal: Modal, limit: tuple[float, float]
    ) -> None:
        """Rows for this stretch of one shape; `limit`: its feed, and the speed at which a block lasts a cycle, mm/s."""
        axes, (from_mm, to_mm), (feed, block_speed) = self._axes(modal), stretch_mm, limit
        if to_mm - from_mm <= 1e-12:
            return
        origin, direction, index = np.zeros((1, 3)), np.zeros((1, 3)), len(self._shapes)
        if isinstance(shape, LineShape):
            index = _STRAIGHT
            origin, direction = shape.points(np.array([from_mm])), shape.derivatives(np.zeros(1))[0]
            edges, limits = np.array([from_mm, to_mm]), straight_limits(direction, axes)
        else:
            self._shapes.append(shape)
            edges, limits = curve_pieces(shape.derivatives, from_mm, to_mm, feed, axes, Shares())
        start_mm = self._end_mm()
        self.pieces.append(
            len(edges) - 1,
            starts=start_mm + edges[:-1] - from_mm,
            ends=start_mm + edges[1:] - from_mm,
            offsets=edges[:-1],
            caps=np.minimum(limits.speed, min(block_speed, OVERRIDE_TOP * feed)),
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

    def _own_limit(self, motion: Motion, shape: Shape) -> tuple[float, float]:
        return feed_mm_s(motion), 0.9 * shape.length_mm / self._soft.cycle_s

    def _axes(self, modal: Modal) -> AxisLimits:
        return self._soft if modal.is_jerk_limited else self._brisk

    def _end_mm(self) -> float:
        return float(self.pieces.ends[self.pieces.count - 1]) if self.pieces.count else 0.0

    def first_end(self, piece: int, path_mm: float) -> int:
        """The first motion from this piece on that ends at or beyond this path length."""
        rows = self.pieces
        found = int(np.searchsorted(rows.ends[: rows.count], path_mm - self._same_place_mm))
        return int(rows.ordinals[max(piece, min(found, rows.count - 1))])

    def stop_at(self, ordinal: int) -> None:
        """The path stops where this motion ends, or where the rounding after it begins."""
        row = self._last_row(ordinal)
        self._is_extra_stop = not self.pieces.stops[row]
        self.pieces.stops[row] = 1

    def unstop(self, ordinal: int) -> None:
        """Take the last `stop_at` back; a stop that was there before stays."""
        if self._is_extra_stop:
            self.pieces.stops[self._last_row(ordinal)] = 0

    def _last_row(self, ordinal: int) -> int:
        return int(np.searchsorted(self.pieces.ordinals[: self.pieces.count], ordinal, side="right")) - 1

    # --- what others read

    def positions(self, path_mm: Array, piece: Indices) -> Array:
        """Points (n, 3), mm, at these path lengths on these pieces."""
        rows = self.pieces
        local = path_mm - rows.starts[piece]
        points = rows.origins[piece] + local[:, None] * rows.directions[piece]
        curve = rows.shapes[piece]
        bow = curve < _STRAIGHT
        if np.any(bow):
            points[bow] = self._bows.points(-2 - curve[bow], local[bow])
        for index in np.unique(curve[curve >= 0]):
            here = curve == index
            points[here] = self._shapes[index].points(rows.offsets[piece[here]] + local[here])
        return np.asarray(points)

    def roundings(self) -> list[Rounding]:
        """Every rounded corner, planned ones included."""
        return [
            Rounding(deviation, motion.start, motion.line, motion.block)
            for motion, deviation in ((self.motions[ordinal], deviation) for ordinal, deviation in self._roundings)
        ]

    def travelled(self, path_mm: float) -> list[Motion]:
        """The motions as made up to this path length, roundings included."""
        rows, done = self.pieces, []
        count = int(np.searchsorted(rows.starts[: rows.count], path_mm, side="left"))
        shapes, offsets = rows.shapes[:count], rows.offsets[:count]
        rounds = (rows.shapes[: rows.count] < _STRAIGHT) | np.isin(rows.shapes[: rows.count], list(self._corners))
        rounds_next = np.append(rounds, False)[1 : count + 1]
        whole = (shapes == _STRAIGHT) & (offsets == 0.0) & ~rounds_next & (rows.ends[:count] <= path_mm)
        is_same = np.append((shapes[1:] == shapes[:-1]) & (shapes[1:] >= 0), False)
        low = 0.0
        for k, (ordinal, is_whole) in enumerate(zip(rows.ordinals[:count].tolist(), whole.tolist(), strict=True)):
            if is_whole:
                done.append(self.motions[ordinal])
                continue
            if k == 0 or not is_same[k - 1]:
                low = float(offsets[k])
            if not is_same[k]:
                reach = float(min(path_mm, rows.ends[k]) - rows.starts[k] + offsets[k])
                done.append(self._part(int(shapes[k]), self.motions[ordinal], low, reach))
        return done

    def _part(self, index: int, motion: Motion, from_mm: float, to_mm: float) -> Motion:
        if index < _STRAIGHT:
            return self._bows.part(-2 - index, to_mm, motion)
        if index == _STRAIGHT:
            return shape_of(motion, self._speed_error).part(from_mm, to_mm)
        part = self._shapes[index].part(from_mm, to_mm)
        return Rapid(motion.line, motion.block, part.start, part.end) if isinstance(motion, Rapid) else part
