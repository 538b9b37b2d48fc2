"""The motion log as it grows: samples on whole steps, standstills with their reasons."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import Vector
from sim.motion.values import Samples, StandStill, StarvedInterval, StopReason

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Recorder:
    """Keeps the clock in steps, the samples not yet taken, every standstill since the start, the rest owed."""

    def __init__(self, step_s: float) -> None:
        self.step = 0
        self.line = 0
        self.block: int | None = None
        self.is_new = True
        self._step_s = step_s
        self._chunks: list[Samples] = []
        self._stands: list[StandStill] = []
        self._open: StandStill | None = None
        self._owed_steps = 0

    @property
    def reason(self) -> StopReason | None:
        """Why the machine stands now, or None."""
        return None if self._open is None else self._open.reason

    def at(self, line: int, block: int | None) -> None:
        """What is done now stands on this line."""
        self.line, self.block = line, block

    def move(self, points: Array, feeds_mm_min: Array, lines: Indices, blocks: Indices) -> None:
        """Log steps of motion."""
        self.is_new = False
        self._append(points, feeds_mm_min, lines, blocks)
        self.at(int(lines[-1]), None if blocks[-1] < 0 else int(blocks[-1]))

    def owe_rest(self, steps: int) -> None:
        """The machine is to stand for so many steps, for a dwell or until the axes have settled."""
        self._owed_steps = steps

    def rest(self, most_steps: float, position: Vector) -> bool:
        """Log what is owed of it, at most so many steps; False where nothing is."""
        if self._owed_steps <= 0:
            return False
        steps = int(min(self._owed_steps, most_steps))
        self._stand(steps, position)
        self._owed_steps -= steps
        return True

    def skip_to(self, step: int) -> None:
        """Let time pass without samples."""
        self.step = max(self.step, step)

    def begin_stand(self, reason: StopReason, position: Vector) -> None:
        """From now on the machine stands for this reason."""
        if self._open is not None and self._open.reason is reason:
            return
        self.end_stand()
        self._open = StandStill(self.step * self._step_s, 0.0, reason, position, self.line, self.block)

    def end_stand(self) -> None:
        """The reason is gone."""
        if self._open is not None:
            self._stands.append(self._so_far(self._open))
            self._open = None

    def stands(self) -> list[StandStill]:
        """Every standstill, the present one with the time so far."""
        return self._stands + ([] if self._open is None else [self._so_far(self._open)])

    def starved(self) -> list[StarvedInterval]:
        """The standstills for want of blocks."""
        return [
            StarvedInterval(stand.t_s, stand.duration_s, stand.position_mm, stand.line, stand.block)
            for stand in self.stands()
            if stand.reason is StopReason.STARVED
        ]

    def take(self) -> Samples:
        """What was logged since the last call."""
        chunks, self._chunks = self._chunks, []
        return Samples.joined(chunks)

    def _stand(self, steps: int, position: Vector) -> None:
        """Log steps at rest."""
        block = -1 if self.block is None else self.block
        self._append(
            np.tile(np.array(position), (steps, 1)),
            np.zeros(steps),
            np.full(steps, self.line, dtype=np.int64),
            np.full(steps, block, dtype=np.int64),
        )

    def _append(self, points: Array, feeds: Array, lines: Indices, blocks: Indices) -> None:
        times = np.arange(self.step + 1, self.step + 1 + len(points), dtype=np.float64) * self._step_s
        self._chunks.append(Samples(times, points, feeds, lines, blocks))
        self.step += len(points)

    def _so_far(self, stand: StandStill) -> StandStill:
        return replace(stand, duration_s=self.step * self._step_s - stand.t_s)
