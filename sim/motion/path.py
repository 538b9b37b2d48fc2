"""From canonical motions to pieces with limits: the control's preparation.

A straight motion becomes one piece, a curved one several where its limits vary, with a rounding before it where the
path mode asks for one. The last motion's end stays open: whether it is a corner, a rounding or a stop shows when the
next motion arrives; until then the time law must be able to stop there. A corner is passed as the mode of the block
before it says.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import Line, LineRun, Motion, PathMode, Rapid
from sim.motion.blend import round_corner
from sim.motion.bows import SHARPEST
from sim.motion.limits import OVERRIDE_TOP, AxisLimits, join_speed, straight_limits
from sim.motion.rows import ACC, CAP, JERK, KNOT, STOP
from sim.motion.shapes import LineShape, Shape, shape_of
from sim.motion.straight import Modal, corners_of, feed_mm_s, legs_of, wanted_reach
from sim.motion.track import Join, Track
from sim.motion.values import MachineTimes, StopReason

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Run:
    """Motions under one modal state: any number of straight ones, or one curve.

    `is_after_stop`: something before the first makes the axes stand; `is_exact_stop`: the last ends with one.
    """

    motions: Sequence[Motion] | LineRun
    modal: Modal
    is_after_stop: bool
    is_exact_stop: bool


@dataclass(frozen=True, slots=True)
class _Tail:
    """The last motion, whose end is open: rows from `first_piece` on, and how it is joined to what is before it."""

    motion: Motion
    shape: Shape
    modal: Modal
    ordinal: int
    first_piece: int
    join: Join


class Path:
    """The whole path of a run of the program, as far as it is known."""

    def __init__(self, axes: AxisLimits, speed_error: float, times: MachineTimes) -> None:
        self._soft = axes
        self._brisk = AxisLimits(axes.speed, axes.acceleration, axes.acceleration / axes.cycle_s, axes.cycle_s)
        self._speed_error = speed_error
        self._times = times
        self._is_after_stop = self._is_extra_stop = False
        self._tail: _Tail | None = None
        self.track = Track(times.no_length_mm)
        self.pieces, self.moves = self.track.pieces, self.track.moves
        self.reasons: dict[int, StopReason] = {}

    def add(self, runs: Sequence[Run], committed_mm: float) -> int:
        """Append motions; returns the first piece that changed.

        The path up to `committed_mm` (where the machine can stop now) is not altered: a corner that comes too late to
        be rounded becomes a stop, or is passed as it is where its bend is gentle.
        """
        first = self.pieces.count if self._tail is None else self._tail.first_piece
        for run in runs:
            self._is_after_stop |= run.is_after_stop
            first_ordinal = len(self.moves)
            self.moves.append(run.motions)
            if isinstance(run.motions, LineRun) or isinstance(run.motions[0], Line | Rapid):
                self._add_legs(run, first_ordinal, committed_mm)
            else:
                self._add_curve(run, first_ordinal, committed_mm)
            if _stops(run):
                self._stop(StopReason.EXACT_STOP)
        return first

    def _add_legs(self, run: Run, first_ordinal: int, committed_mm: float) -> None:
        axes, modal = self._axes(run.modal), run.modal
        moves = run.motions if isinstance(run.motions, LineRun) else _straight(run.motions)
        legs, goes = legs_of(moves, axes, self._times.same_place_mm)
        ordinals = first_ordinal + np.flatnonzero(goes)
        if len(ordinals) == 0:
            return
        first, last = self.moves[ordinals[0]], self.moves[ordinals[-1]]
        join = self._join(first, shape_of(first, self._speed_error), int(ordinals[0]), modal, committed_mm)
        corners = corners_of(legs, modal, axes, math.inf, self._times.same_place_mm)
        stops = corners.are_gaps | corners.are_sharp | (modal.mode is PathMode.EXACT_STOP)
        for k in np.flatnonzero(stops):
            self.reasons[int(ordinals[k])] = StopReason.CORNER if corners.are_sharp[k] else StopReason.EXACT_STOP
        before = self.track.lay_legs(legs, corners, stops, ordinals, axes, (join, not _stops(run)))
        shape = shape_of(last, self._speed_error)
        self._tail = _Tail(last, shape, modal, int(ordinals[-1]), self.pieces.count - 1, before)

    def _add_curve(self, run: Run, ordinal: int, committed_mm: float) -> None:
        motion = self.moves[ordinal]
        shape = shape_of(motion, self._speed_error)
        if shape.length_mm <= self._times.same_place_mm:
            return
        join = self._join(motion, shape, ordinal, run.modal, committed_mm)
        first_piece = self.pieces.count
        stretch = join.trim_mm, shape.length_mm
        self.track.lay(shape, stretch, ordinal, self._axes(run.modal), self._own_limit(motion, shape), True)
        self._tail = _Tail(motion, shape, run.modal, ordinal, first_piece, join)

    # --- joins

    def _join(self, motion: Motion, shape: Shape, ordinal: int, modal: Modal, committed_mm: float) -> Join:
        """Settle the open end before this motion; returns how the motion begins."""
        tail, is_after_stop = self._tail, self._is_after_stop
        self._is_after_stop = False
        if tail is None:
            return Join()
        if is_after_stop or np.max(np.abs(np.subtract(motion.start, tail.motion.end))) > self._times.same_place_mm:
            self._stop(None if is_after_stop else StopReason.EXACT_STOP)
            return Join()
        way = tail.modal
        if modal.is_jerk_limited is not way.is_jerk_limited:
            way = Modal(PathMode.CONTINUOUS, 0.0, modal.is_jerk_limited)
        if isinstance(shape, LineShape) and isinstance(tail.shape, LineShape):
            return self._join_legs(tail, motion, ordinal, way, committed_mm)
        return self._join_curves(tail, motion, shape, ordinal, way, committed_mm)

    def _join_legs(self, tail: _Tail, motion: Motion, ordinal: int, way: Modal, committed_mm: float) -> Join:
        assert isinstance(tail.motion, Line | Rapid)
        assert isinstance(motion, Line | Rapid)
        axes = self._axes(tail.modal)
        legs, _ = legs_of([tail.motion, motion], axes, self._times.same_place_mm)
        room = self._room_mm(committed_mm)
        corners = corners_of(legs, way, axes, room, self._times.same_place_mm)
        reach = float(corners.reach[0])
        if corners.are_sharp[0]:
            return self._stop(StopReason.LATE if room < self._times.late_mm else StopReason.CORNER)
        if reach == 0.0:
            return self._pass(tail, float(corners.speed[0]), bool(corners.are_bent[0]))
        self._shorten(tail, reach)
        self.track.lay_bow(legs, reach, ordinal, axes)
        return Join(reach)

    def _join_curves(
        self, tail: _Tail, motion: Motion, shape: Shape, ordinal: int, way: Modal, committed_mm: float
    ) -> Join:
        axes = self._axes(tail.modal)
        t1, k1, _ = tail.shape.derivatives(np.array([tail.shape.length_mm]))
        t0, k0, _ = shape.derivatives(np.array([0.0]))
        speed = float(join_speed(t0 - t1, k0 - k1, axes)[0])
        feed = min(feed_mm_s(tail.motion), feed_mm_s(motion))
        fastest = min(OVERRIDE_TOP * feed, float(self.pieces.rows[self.pieces.count - 1, CAP]))
        is_rapid = isinstance(motion, Rapid) or isinstance(tail.motion, Rapid)
        if speed >= fastest:
            return self._pass(tail, speed, True)
        half_sine = np.linalg.norm(t0 - t1, axis=1) / 2.0
        room = self._room_mm(committed_mm)
        reach = min(room, float(wanted_reach(half_sine, np.array([fastest]), way, axes)[0]))
        tolerance = math.inf if way.mode is PathMode.ROUNDING_DISTANCE else way.tolerance_mm
        if half_sine[0] > SHARPEST or (way.mode is PathMode.ROUNDING_DISTANCE and is_rapid):
            reach = 0.0
        corner = round_corner(tail.shape, shape, tail.join.trim_mm, reach, tolerance, self._speed_error)
        if corner is not None and self.track.corner_speed(corner, feed, axes) > speed:
            self._shorten(tail, corner.reach_mm)
            self.track.lay_corner(corner, motion, ordinal, feed, axes)
            return Join(corner.reach_mm)
        if speed > 0.0:
            return self._pass(tail, speed, True)
        return self._stop(StopReason.LATE if room < self._times.late_mm else StopReason.CORNER)

    def _pass(self, tail: _Tail, speed_mm_s: float, is_bent: bool) -> Join:
        """The open end is passed as it is, at most at this speed."""
        self.pieces.rows[self.pieces.count - 1, KNOT] = speed_mm_s
        if not is_bent:
            self._free(tail)
        return Join(0.0, is_bent)

    def _free(self, tail: _Tail) -> None:
        """No join at the open end needs what a straight motion has left for one."""
        if isinstance(tail.shape, LineShape) and not tail.join.is_bent:
            limits = straight_limits(tail.shape.derivatives(np.zeros(1))[0], self._axes(tail.modal))
            self.pieces.rows[self.pieces.count - 1, [ACC, JERK]] = limits.acceleration[0], limits.jerk[0]

    def _room_mm(self, committed_mm: float) -> float:
        """How much of the open end a rounding may still take: all of it until the machine comes near."""
        room = self.track.end_mm - committed_mm
        return math.inf if committed_mm <= 0.0 else room if room > self._times.late_mm else 0.0

    def _shorten(self, tail: _Tail, reach_mm: float) -> None:
        """Lay the last motion again, without what the rounding after it takes."""
        self.pieces.cut(tail.first_piece)
        stretch = tail.join.trim_mm, tail.shape.length_mm - reach_mm
        limit = self._own_limit(tail.motion, tail.shape)
        self.track.lay(tail.shape, stretch, tail.ordinal, self._axes(tail.modal), limit, tail.join.is_bent)

    def _stop(self, reason: StopReason | None) -> Join:
        """The open end is a stop."""
        if self._tail is not None:
            self._free(self._tail)
            self.pieces.rows[self.pieces.count - 1, STOP] = 1.0
            if reason is not None:
                self.reasons[self._tail.ordinal] = reason
            self._tail = None
        return Join()

    def _own_limit(self, motion: Motion, shape: Shape) -> tuple[float, float]:
        return feed_mm_s(motion), 0.9 * shape.length_mm / self._soft.cycle_s

    def _axes(self, modal: Modal) -> AxisLimits:
        return self._soft if modal.is_jerk_limited else self._brisk

    # --- single block

    def first_end(self, piece: int, path_mm: float) -> int:
        """The first motion from this piece on that ends at or beyond this path length."""
        rows = self.pieces
        found = int(np.searchsorted(rows.ends[: rows.count], path_mm - self._times.same_place_mm))
        return int(rows.ordinals[max(piece, min(found, rows.count - 1))])

    def stop_at(self, ordinal: int) -> None:
        """The path stops where this motion ends, or where the rounding after it begins."""
        row = self._last_row(ordinal)
        self._is_extra_stop = self.pieces.rows[row, STOP] == 0.0
        self.pieces.rows[row, STOP] = 1.0

    def unstop(self, ordinal: int) -> None:
        """Take the last `stop_at` back; a stop that was there before stays."""
        if self._is_extra_stop:
            self.pieces.rows[self._last_row(ordinal), STOP] = 0.0

    def _last_row(self, ordinal: int) -> int:
        return int(np.searchsorted(self.pieces.ordinals[: self.pieces.count], ordinal, side="right")) - 1


def _stops(run: Run) -> bool:
    return run.is_exact_stop or run.modal.mode is PathMode.EXACT_STOP


def _straight(motions: Sequence[Motion]) -> list[Line | Rapid]:
    return [motion for motion in motions if isinstance(motion, Line | Rapid)]
