"""The motion log while it grows: as CSV rows of the tool tip, and its peaks of acceleration and jerk."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TextIO

import numpy as np

from planner.files import part_of, unwritable
from sim.motion.values import Samples
from sim.peaks import peaks

HEADER = "t_s,x_mm,y_mm,z_mm,feed_mm_min,line,block\n"


class MotionLog:
    """Writes to a temporary name beside `path`; `close` gives it its name, so that nothing half-written remains.

    The tip lies `tip_below_mm` under the programmed point: 0 for a program of tips, R for one of centres.
    """

    def __init__(self, path: Path, tip_below_mm: float) -> None:
        self._path = path
        self._below = np.array([0.0, 0.0, tip_below_mm])
        self._unfinished = part_of(path)
        self._file: TextIO = self._unfinished.open("w", encoding="ascii")
        self._problem: OSError | None = None
        self._say(HEADER)

    def add(self, samples: Samples) -> None:
        """Append samples; a block without a number is left empty."""
        tip = replace(samples, position_mm=samples.position_mm - self._below)
        self._say("".join(rows(tip)))

    def close(self) -> None:
        """Finish the file; raises InputRejected where it could not be written, and then leaves nothing."""
        try:
            self._file.close()
            if self._problem is None:
                self._unfinished.replace(self._path)
        except OSError as problem:
            self._problem = self._problem or problem
        if self._problem is not None:
            self._unfinished.unlink(missing_ok=True)
            raise unwritable(self._path, self._problem)

    def _say(self, text: str) -> None:
        """Write unless it failed before: a full disk must not stop the mill, it is told at the end."""
        if self._problem is None:
            try:
                self._file.write(text)
            except OSError as problem:
                self._problem = problem


def rows(samples: Samples) -> Iterable[str]:
    """The rows of these samples."""
    columns = np.column_stack([samples.t_s, samples.position_mm, samples.feed_mm_min]).tolist()
    numbers = zip(samples.line.tolist(), samples.block.tolist(), strict=True)
    for (t, x, y, z, feed), (line, block) in zip(columns, numbers, strict=True):
        yield f"{t:.4f},{x:.6f},{y:.6f},{z:.6f},{feed:.4f},{line},{block if block >= 0 else ''}\n"


class Peaks:
    """Largest acceleration in mm/s2 and jerk in mm/s3 of any axis so far."""

    def __init__(self) -> None:
        self.acceleration_mm_s2 = self.jerk_mm_s3 = 0.0
        self._t_s = np.zeros(0)
        self._position_mm = np.zeros((0, 3))

    def add(self, samples: Samples) -> None:
        """Look at the next stretch, and over the seam to the one before."""
        t_s = np.concatenate([self._t_s, samples.t_s])
        position_mm = np.concatenate([self._position_mm, samples.position_mm])
        acceleration, jerk = peaks(t_s, position_mm)
        self.acceleration_mm_s2 = max(self.acceleration_mm_s2, acceleration)
        self.jerk_mm_s3 = max(self.jerk_mm_s3, jerk)
        self._t_s, self._position_mm = t_s[-3:], position_mm[-3:]
