"""Runs of straight moves, prepared together: limits of each leg, and how each joins the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import Line, LineRun, Motion, PathMode, Rapid
from sim.motion.bows import SHARPEST
from sim.motion.limits import OVERRIDE_TOP, AxisLimits, PieceLimits, Shares, join_speed, straight_limits

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Modal:
    """What is modal when a motion is prepared.

    `tolerance_mm`: under G64 and G642 how far a rounding may leave the programmed path, under G641 how long before and
    after the corner it may begin and end.
    """

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
    because the next move begins elsewhere (`are_gaps`) or turns too sharply to be rounded (`are_sharp`); which are
    passed as they are though they bend.
    """

    reach: Array
    speed: Array
    are_gaps: Flags
    are_sharp: Flags
    are_bent: Flags


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


def corners_of(legs: Legs, modal: Modal, axes: AxisLimits, room_mm: float, same_place_mm: float) -> Corners:
    """How each leg joins the next, under one path mode; a rounding may take at most `room_mm` of a leg.

    A corner is rounded where that is faster than to pass it as it is (`join_speed`); where neither goes it is a stop.
    """
    bend = legs.directions[1:] - legs.directions[:-1]
    half_sine = np.sqrt(np.einsum("ij,ij->i", bend, bend)) / 2.0
    gaps = np.abs(legs.starts[1:] - legs.ends[:-1]).max(axis=1, initial=0.0) > same_place_mm
    none = np.zeros(len(bend), dtype=bool)
    speed = join_speed(bend, np.zeros_like(bend), axes)
    if modal.mode is PathMode.EXACT_STOP:
        return Corners(np.zeros(len(bend)), speed, gaps, none, none)
    fastest = np.minimum(OVERRIDE_TOP * np.minimum(legs.feeds[:-1], legs.feeds[1:]), legs.limits.speed[:-1])
    fastest = np.minimum(fastest, legs.limits.speed[1:])
    room = np.minimum(np.minimum(legs.lengths[:-1], legs.lengths[1:]) / 2.0, room_mm)
    reach = np.minimum(room, wanted_reach(half_sine, fastest, modal, axes))
    reach[half_sine > SHARPEST] = 0.0
    if modal.mode is PathMode.ROUNDING_DISTANCE:
        reach[legs.are_rapid[:-1] | legs.are_rapid[1:]] = 0.0
    rounds = (speed < fastest) & ~gaps & (rounded_speed(half_sine, reach, axes) > speed)
    are_sharp = ~rounds & ~gaps & (speed == 0.0)
    are_bent = ~rounds & ~gaps & ~are_sharp & (half_sine > 1e-9)
    return Corners(np.where(rounds, reach, 0.0), speed, gaps, are_sharp, are_bent)


def wanted_reach(half_sine: Array, speed: Array, modal: Modal, axes: AxisLimits) -> Array:
    """What a rounding takes of either neighbour, (n,) mm, if there is room; `half_sine` is that of half the turn.

    G642 uses its tolerance up, 0.375 d sin(theta/2), and G641 its distance. G64 rounds no more than `speed` needs:
    acceleration 1.5 v^2 sin(theta/2) / d, jerk 3 v^3 sin(theta/2) / d^2 (with a tenth more for sharp turns).
    """
    if modal.mode is PathMode.ROUNDING_DISTANCE:
        return np.full(len(half_sine), modal.tolerance_mm)
    widest = modal.tolerance_mm / np.maximum(0.375 * half_sine, 1e-300)
    if modal.mode is PathMode.ROUNDING_TOLERANCE:
        return widest
    acceleration, jerk = _for_curvature(axes)
    by_acceleration = 1.5 * half_sine * speed**2 / acceleration
    return np.minimum(widest, 1.1 * np.maximum(by_acceleration, np.sqrt(3.0 * half_sine * speed**3 / jerk)))


def rounded_speed(half_sine: Array, reach_mm: Array, axes: AxisLimits) -> Array:
    """About the speed (n,) at which such a rounding is passed; its pieces have the exact limits."""
    acceleration, jerk = _for_curvature(axes)
    s = np.maximum(half_sine, 1e-300)
    by_acceleration = np.sqrt(acceleration * reach_mm / (1.5 * s))
    return np.minimum(by_acceleration, np.cbrt(jerk * reach_mm**2 / (3.0 * s)))


def _for_curvature(axes: AxisLimits) -> tuple[float, float]:
    """What the weakest axis has for curvature: acceleration mm/s2 and jerk mm/s3."""
    left, shares = axes.spared(), Shares()
    return shares.acceleration * float(np.min(left.acceleration)), shares.jerk * float(np.min(left.jerk))
