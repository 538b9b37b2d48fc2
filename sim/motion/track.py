"""The path laid out: rows of pieces with their limits, the curves they lie on, and where the axes are on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import Motion
from sim.motion.blend import Corner
from sim.motion.bows import Bows
from sim.motion.limits import OVERRIDE_TOP, AxisLimits, Shares, curve_pieces, curved_limits, straight_limits
from sim.motion.moves import Moves
from sim.motion.pieces import STRAIGHT, Pieces
from sim.motion.shapes import LineShape, Shape
from sim.motion.straight import Corners, Flags, Legs
from sim.motion.values import Rounding

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Join:
    """How a motion begins: what a rounding before it takes of it, or that the path bends there as it is."""

    trim_mm: float = 0.0
    is_bent: bool = False


class Track:
    """What has been laid so far; rows are added at the end, and taken back there.

    `bows` are the roundings between straight moves, `shapes` every other curve, `corners` those of them that round.
    No piece is as short as `no_length_mm`.
    """

    def __init__(self, no_length_mm: float) -> None:
        self._no_length_mm = no_length_mm
        self.pieces = Pieces()
        self.moves = Moves()
        self.bows = Bows()
        self.shapes: list[Shape] = []
        self.corners: set[int] = set()
        self._roundings: list[tuple[Indices, Array]] = []

    @property
    def end_mm(self) -> float:
        """Path length so far."""
        return float(self.pieces.ends[self.pieces.count - 1]) if self.pieces.count else 0.0

    def lay_legs(
        self, legs: Legs, corners: Corners, stops: Flags, ordinals: Indices, axes: AxisLimits, ends: tuple[Join, bool]
    ) -> Join:
        """Rows for these legs and the roundings between them; returns how the last leg is joined to the one before.

        `stops` (n - 1,): whether the path stops after a leg; `ends`: how the first leg is joined to what is there, and
        whether the last one may have to leave something for a join that is passed as it is.
        """
        count, (join, is_open) = len(legs.lengths), ends
        bent = np.concatenate([[join.is_bent], corners.are_bent, [is_open]])
        spared = straight_limits(legs.directions, axes.spared())
        is_spared = bent[:-1] | bent[1:]
        before = np.concatenate([[join.trim_mm], corners.reach])
        after = np.concatenate([corners.reach, [0.0]])
        body = {
            "caps": np.minimum(legs.limits.speed, OVERRIDE_TOP * legs.feeds),
            "feeds": legs.feeds,
            "accs": np.where(is_spared, spared.acceleration, legs.limits.acceleration),
            "jerks": np.where(is_spared, spared.jerk, legs.limits.jerk),
            "ordinals": ordinals,
            "origins": legs.starts + before[:, None] * legs.directions,
            "directions": legs.directions,
            "shapes": np.full(count, STRAIGHT, dtype=np.int64),
            "offsets": before,
            "knots": np.concatenate([np.where(corners.reach > 0.0, np.inf, corners.speed), [np.inf]]),
            "stops": np.concatenate([stops, [False]]).astype(np.int64),
        }
        lengths = legs.lengths - before - after
        rows = np.flatnonzero(corners.reach > 0.0)
        if len(rows):
            bow_lengths, bows = self._bow_columns(legs, rows, corners.reach[rows], axes, ordinals[rows + 1])
            at = rows + 1
            lengths = np.insert(lengths, at, bow_lengths)
            body = {name: np.insert(column, at, bows[name], axis=0) for name, column in body.items()}
        exists = lengths > self._no_length_mm
        if not np.all(exists):
            lengths, body = lengths[exists], {name: column[exists] for name, column in body.items()}
        edges = np.cumsum(np.concatenate([[self.end_mm], lengths]))
        self.pieces.append(len(lengths), starts=edges[:-1], ends=edges[1:], **body)
        return Join(float(before[-1]), bool(bent[-2]))

    def lay_bow(self, legs: Legs, reach_mm: float, ordinal: int, axes: AxisLimits) -> None:
        """One row: the rounding between the two legs, which belongs to motion `ordinal`."""
        first = np.zeros(1, dtype=np.int64)
        length, columns = self._bow_columns(legs, first, np.array([reach_mm]), axes, np.array([ordinal]))
        start_mm = self.end_mm
        self.pieces.append(1, starts=start_mm, ends=start_mm + length, **columns)

    def lay_corner(self, corner: Corner, motion: Motion, ordinal: int, feed_mm_s: float, axes: AxisLimits) -> None:
        """Rows for the rounding before this motion, where a neighbour is a curve."""
        self.corners.add(len(self.shapes))
        self.lay(corner.shape_for(motion), (0.0, corner.shape.length_mm), ordinal, axes, (feed_mm_s, np.inf), True)
        self._roundings.append((np.array([ordinal]), np.array([corner.deviation_mm])))

    def corner_speed(self, corner: Corner, feed_mm_s: float, axes: AxisLimits) -> float:
        """The greatest speed at which this rounding is passed, mm/s."""
        shape = corner.shape
        _, limits = curve_pieces(shape.derivatives, 0.0, shape.length_mm, feed_mm_s, axes.spared(), Shares())
        return float(np.min(limits.speed))

    def lay(
        self,
        shape: Shape,
        stretch_mm: tuple[float, float],
        ordinal: int,
        axes: AxisLimits,
        limit_mm_s: tuple[float, float],
        is_spared: bool,
    ) -> None:
        """Rows for this stretch of one shape; `limit_mm_s`: its feed, and the speed at which a block lasts a cycle.

        `is_spared`: a straight one leaves something for a join that is passed as it is; a curve always does.
        """
        (from_mm, to_mm), (feed, block_speed) = stretch_mm, limit_mm_s
        if to_mm - from_mm <= self._no_length_mm:
            return
        origin, direction, index = np.zeros((1, 3)), np.zeros((1, 3)), len(self.shapes)
        if isinstance(shape, LineShape):
            index = STRAIGHT
            origin, direction = shape.points(np.array([from_mm])), shape.derivatives(np.zeros(1))[0]
            edges, limits = np.array([from_mm, to_mm]), straight_limits(direction, axes.spared() if is_spared else axes)
        else:
            self.shapes.append(shape)
            edges, limits = curve_pieces(shape.derivatives, from_mm, to_mm, feed, axes.spared(), Shares())
        start_mm = self.end_mm
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

    def positions(self, path_mm: Array, piece: Indices) -> Array:
        """Points (n, 3), mm, at these path lengths on these pieces."""
        rows = self.pieces
        local = path_mm - rows.starts[piece]
        points = rows.origins[piece] + local[:, None] * rows.directions[piece]
        curve = rows.shapes[piece]
        bow = curve < STRAIGHT
        if np.any(bow):
            points[bow] = self.bows.points(STRAIGHT - 1 - curve[bow], local[bow])
        for index in np.unique(curve[curve >= 0]):
            here = curve == index
            points[here] = self.shapes[index].points(rows.offsets[piece[here]] + local[here])
        return np.asarray(points)

    def roundings(self) -> list[Rounding]:
        """Every rounded corner, planned ones included."""
        found = []
        for ordinals, deviations in self._roundings:
            for ordinal, deviation in zip(ordinals.tolist(), deviations.tolist(), strict=True):
                motion = self.moves[ordinal]
                found.append(Rounding(deviation, motion.start, motion.line, motion.block))
        return found

    def _bow_columns(
        self, legs: Legs, rows: Indices, reach_mm: Array, axes: AxisLimits, ordinals: Indices
    ) -> tuple[Array, dict[str, Array | Indices]]:
        """Lengths and columns of the roundings after the legs `rows`; they belong to the motions `ordinals`."""
        index = self.bows.count + np.arange(len(rows))
        length, bounds, half_sine = self.bows.append(
            legs.ends[rows], legs.directions[rows], legs.directions[rows + 1], reach_mm
        )
        feed = np.minimum(legs.feeds[rows + 1], legs.feeds[rows])
        limits = curved_limits(*bounds, np.minimum(feed, np.max(axes.speed)), axes.spared(), Shares())
        self._roundings.append((ordinals, 0.375 * reach_mm * half_sine))
        none = np.zeros((len(rows), 3))
        return length, {
            "caps": np.minimum(limits.speed, OVERRIDE_TOP * feed),
            "feeds": feed,
            "accs": limits.acceleration,
            "jerks": limits.jerk,
            "ordinals": ordinals,
            "origins": none,
            "directions": none,
            "shapes": STRAIGHT - 1 - index,
            "offsets": np.zeros(len(rows)),
            "knots": np.full(len(rows), np.inf),
            "stops": np.zeros(len(rows), dtype=np.int64),
        }
