"""The interpolator: where the axes are on the path, and how the time law takes them along it.

It knows the motions, the horizon and the speed. Why the axes stand, what happens between motions and what is logged
is the machine's (`sim.motion.machine`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.interpreter.canon import Motion, Vector
from sim.motion.fast import can_compile, time_law
from sim.motion.limits import AxisLimits
from sim.motion.path import Path, Run
from sim.motion.rows import HORIZON, PIECE, PROVED, STATE_SIZE, A, S, V
from sim.motion.standing import LONGEST_WAY
from sim.motion.travelled import travelled
from sim.motion.values import Array, Indices, MachineTimes, Rounding, StopReason


@dataclass(frozen=True, slots=True)
class Stretch:
    """Steps made: points (n, 3) mm, path feeds mm/min, source lines and blocks (n,).

    `landed`: the motion at whose end the axes have come to rest, None where they have not; `has_halted`: they have come
    to rest elsewhere.
    """

    points_mm: Array
    feeds_mm_min: Array
    lines: Indices
    blocks: Indices
    landed: int | None
    has_halted: bool


class Interpolator:
    """The axes on the path; at first, and after every reset, they stand before a path that is still empty.

    `step_s` is the step of the time law, `lookahead_blocks` how far it sees at most. `is_compiled` chooses the law's
    twin; None takes the compiled one if it can be had. Motions are numbered from the last reset on.
    """

    def __init__(
        self,
        axes: AxisLimits,
        times: MachineTimes,
        lookahead_blocks: int,
        step_s: float,
        *,
        speed_error: float,
        is_compiled: bool | None,
    ) -> None:
        self._axes = axes
        self._times = times
        self._lookahead_blocks = lookahead_blocks
        self._step_s = step_s
        self._speed_error = speed_error
        self._law = time_law(can_compile() if is_compiled is None else is_compiled)
        self._way = np.empty(LONGEST_WAY)
        self._travelled: list[Motion] = []
        self._roundings: list[Rounding] = []
        self._blocks_before = 0
        self.override = 1.0
        self.is_single_block = False
        self._begin()

    def _begin(self) -> None:
        self._path = Path(self._axes, self._speed_error, self._times)
        self._state = np.zeros(STATE_SIZE)
        self._single_ordinal = -1
        self.is_at_stop = True

    # --- what is asked of it

    def add(self, runs: Sequence[Run]) -> None:
        """Append motions to the path; what the axes can no longer keep clear of stays as it is."""
        first = self._path.add(runs, self._committed_mm())
        self._path.pieces.limit(self.override, max(first - 1, 0))
        self._find_piece()
        self._mark_single_block()

    def set_override(self, override: float) -> None:
        """Feed override, 1.0 as programmed."""
        self.override = override
        self._path.pieces.limit(override, 0)

    def set_single_block(self, is_on: bool) -> None:
        """Come to rest at the end of every motion."""
        self.is_single_block = is_on
        self._mark_single_block()

    def set_off(self) -> Motion | None:
        """Leave the stop for the next motion, and say which; None where none is known."""
        rows = self._path.pieces
        following = self._following_piece()
        if following == rows.count:
            return None
        self._state[PIECE] = self._state[HORIZON] = self._state[PROVED] = following
        self.is_at_stop = False
        self._mark_single_block()
        return self._path.moves[int(rows.ordinals[following])]

    def run(self, steps: int, is_holding: bool) -> Stretch:
        """Go on for at most this many steps, at least one; shorter where the axes come to rest."""
        rows, before_mm_s = self._path.pieces, self.speed_mm_s
        log_s, log_v, log_piece = np.empty(steps), np.empty(steps), np.empty(steps, dtype=np.int64)
        done = self._law.run(
            self._state,
            rows.count,
            rows.rows,
            rows.ordinals,
            self._lookahead_blocks,
            self._way,
            is_holding,
            self._step_s,
            log_s,
            log_v,
            log_piece,
        )
        points = self._path.track.positions(log_s[:done], log_piece[:done])
        piece = int(log_piece[done - 1])
        ordinal = int(rows.ordinals[piece])
        has_landed = self.is_at_rest and log_s[done - 1] == rows.ends[piece]
        if has_landed:
            end = self._path.moves[ordinal].end
            if np.max(np.abs(points[-1] - end)) <= self._times.same_place_mm:
                points[-1] = end
        lines, blocks = self._path.moves.sources(rows.ordinals[log_piece[:done]])
        has_halted = self.is_at_rest and not has_landed and (log_v[done - 2] if done > 1 else before_mm_s) > 0.0
        return Stretch(points, log_v[:done] * 60.0, lines, blocks, ordinal if has_landed else None, bool(has_halted))

    def arrive(self, ordinal: int) -> tuple[StopReason | None, bool]:
        """The axes stand at the end of this motion: why the path stops there, and whether single block made them."""
        self.is_at_stop = True
        is_single = ordinal == self._single_ordinal
        if is_single:
            self._single_ordinal = -1
        return self._path.reasons.get(ordinal), is_single

    def reset(self) -> None:
        """Forget the path, keep what was made of it."""
        self._travelled, self._roundings = self.travelled, self.roundings
        self._blocks_before = self.blocks_done
        self._begin()

    # --- what it tells

    @property
    def speed_mm_s(self) -> float:
        """Speed along the path."""
        return float(self._state[V])

    @property
    def is_at_rest(self) -> bool:
        """Whether the axes stand, be it at a stop of the path or by order."""
        return bool(self._state[V] == 0.0)

    @property
    def is_settled(self) -> bool:
        """Whether they stand and nothing is about to move them."""
        return self.is_at_rest and bool(self._state[A] == 0.0)

    @property
    def has_path(self) -> bool:
        """Whether any motion is known."""
        return self._path.pieces.count > 0

    @property
    def motion_count(self) -> int:
        """How many motions are known."""
        return len(self._path.moves)

    @property
    def ordinal(self) -> int:
        """Motions finished (standing), or the number of the one being made."""
        rows = self._path.pieces
        if not self.is_at_stop:
            return int(rows.ordinals[int(self._state[PIECE])])
        following = self._following_piece()
        return int(rows.ordinals[following]) if following < rows.count else self.motion_count

    @property
    def motion(self) -> Motion | None:
        """The motion being made, None at a stop."""
        return None if self.is_at_stop else self._path.moves[self.ordinal]

    @property
    def start_mm(self) -> Vector | None:
        """Where the first motion known begins."""
        return self._path.moves[0].start if self.motion_count else None

    @property
    def blocks_done(self) -> int:
        """Motions finished, those before a reset included."""
        return self._blocks_before + self.ordinal

    @property
    def roundings(self) -> list[Rounding]:
        """Every rounded corner with the deviation it made, planned ones included."""
        return self._roundings + self._path.track.roundings()

    @property
    def travelled(self) -> list[Motion]:
        """The motions as really made so far, roundings included."""
        return self._travelled + travelled(self._path.track, float(self._state[S]))

    # --- the place on the path

    def _following_piece(self) -> int:
        """The first piece that ends beyond this place; the count of pieces where none does."""
        rows = self._path.pieces
        return int(np.searchsorted(rows.ends[: rows.count], self._state[S], side="right"))

    def _committed_mm(self) -> float:
        """Path length where the axes can stand at the earliest; from here on they can, whatever changes behind it."""
        return self._law.keep_way(self._state, self._path.pieces.rows, self._way, self._step_s)

    def _find_piece(self) -> None:
        """The path has changed ahead: the same place may have another row now."""
        if not self.is_at_stop:
            self._state[PIECE] = min(self._following_piece(), self._path.pieces.count - 1)
        self._state[HORIZON] = self._state[PROVED] = self._state[PIECE]

    def _mark_single_block(self) -> None:
        """In single block the first block end at which the axes can stand is a stop."""
        rows, path = self._path.pieces, self._path
        if self._single_ordinal >= 0 and not self.is_single_block:
            path.unstop(self._single_ordinal)
            self._single_ordinal = -1
        elif self.is_single_block and not self.is_at_stop and rows.count:
            self._single_ordinal = path.first_end(int(self._state[PIECE]), self._committed_mm())
            path.stop_at(self._single_ordinal)
        else:
            return
        rows.limit(self.override, int(self._state[PIECE]))
