"""Runs of straight moves, prepared together: limits of each leg, and how each joins the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import Line, LineRun, Motion, PathMode, Rapid
from sim.motion.bows import SHARPEST
from sim.motion.limits import OVERRIDE_TOP, AxisLimits, PieceLimits, bend_speed, straight_limits

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Modal:
    """What is modal when a motion is prepared; the tolerance is that of G642, the distance that of G641."""

    mode: PathMode
    tolerance_mm: float
    is_jerk_limited: bool


@dataclass(frozen=True, slots=True)
class Legs:
    """Straight moves, none of zero length: starts, ends, unit directions (n, 3), lengths mm, feeds mm/s (n,)."""

    starts: Array
    ends: Array
    directions: Array
    lengths: Array
    feeds: Array
    are_rapid: Flags
    limits: PieceLimits


@dataclass(frozen=True, slots=True)
class Corners:
    """The joins between neighbouring legs (n - 1,).

    What a rounding takes of both legs, mm (0: none); the greatest speed without one, mm/s; where the path must stop
    because the next move begins elsewhere (`are_gaps`) or turns back too sharply (`are_sharp`).
    """

    reach: Array
    speed: Array
    are_gaps: Flags
    are_sharp: Flags


def feed_mm_s(motion: Motion) -> float:
    """The programmed feed; a rapid knows no limit but the axes."""
    return np.inf if isinstance(motion, Rapid) else motion.feed_mm_min / 60.0


def legs_of(moves: Sequence[Line | Rapid] | LineRun, axes: AxisLimits, same_place_mm: float) -> tuple[Legs, Flags]:
    """The legs of these moves, and which moves are legs at all: one that ends where it begins is none."""
    if isinstance(moves, LineRun):
        starts, ends, feeds = np.vstack([moves.start, moves.ends[:-1]]), moves.ends, moves.feeds / 60.0
    else:
        starts = np.array([move.start for move in moves], dtype=float)
        ends = np.array([move.end for move in moves], dtype=float)
        feeds = np.array([feed_mm_s(move) for move in moves])
    steps = ends - starts
    lengths = np.sqrt(np.einsum("ij,ij->i", steps, steps))
    goes = lengths > same_place_mm
    if not np.all(goes):
        starts, ends, steps, lengths, feeds = starts[goes], ends[goes], steps[goes], lengths[goes], feeds[goes]
    directions = steps / lengths[:, None]
    limits = straight_limits(directions, axes)
    speed = np.minimum(limits.speed, 0.9 * lengths / axes.cycle_s)
    limits = PieceLimits(speed, limits.acceleration, limits.jerk)
    return Legs(starts, ends, directions, lengths, feeds, np.isinf(feeds), limits), goes


def corners_of(legs: Legs, modal: Modal, axes: AxisLimits, overload: float, same_place_mm: float) -> Corners:
    """How each leg joins the next, under one path mode.

    Without rounding a corner may step an axis' speed by overload x acceleration x cycle. With rounding, a bend whose
    step would need less than a tenth of the jerk in one cycle is passed as it is.
    """
    bend = legs.directions[1:] - legs.directions[:-1]
    gaps = np.abs(legs.starts[1:] - legs.ends[:-1]).max(axis=1, initial=0.0) > same_place_mm
    none = np.zeros(len(bend), dtype=bool)
    zero = np.zeros_like(bend)
    step = overload * axes.acceleration * axes.cycle_s
    speed = bend_speed(bend, zero, axes, step)
    reach = np.zeros(len(bend))
    if modal.mode not in (PathMode.ROUNDING_DISTANCE, PathMode.ROUNDING_TOLERANCE):
        return Corners(reach, speed, gaps, none)
    smooth_speed = bend_speed(bend, zero, axes, 0.1 * axes.jerk * axes.cycle_s**2)
    fastest = np.minimum(OVERRIDE_TOP * np.minimum(legs.feeds[:-1], legs.feeds[1:]), legs.limits.speed[:-1])
    rounds = smooth_speed < np.minimum(fastest, legs.limits.speed[1:])
    if modal.mode is PathMode.ROUNDING_DISTANCE:
        is_rapid = legs.are_rapid[:-1] | legs.are_rapid[1:]
        rounds &= ~is_rapid
        smooth_speed = np.where(is_rapid, speed, smooth_speed)
        wanted = np.full(len(bend), modal.tolerance_mm)
    half_sine = np.sqrt(np.einsum("ij,ij->i", bend, bend)) / 2.0
    if modal.mode is PathMode.ROUNDING_TOLERANCE:
        wanted = modal.tolerance_mm / np.maximum(0.375 * half_sine, 1e-300)
    room = np.minimum(legs.lengths[:-1], legs.lengths[1:]) / 2.0
    sharp = rounds & (half_sine > SHARPEST)
    reach = np.where(rounds & ~sharp & ~gaps, np.minimum(room, wanted), 0.0)
    return Corners(reach, smooth_speed, gaps, sharp)
