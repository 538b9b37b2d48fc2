"""The motion log as CSV: one row a sample, tool position of the programmed point, written as it grows."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TextIO

import numpy as np

from sim.motion.machine import Samples

HEADER = "t_s,x_mm,y_mm,z_mm,feed_mm_min,line,block\n"


class MotionLog:
    """Writes to a temporary name beside `path`; `close` gives it its name, so that nothing half-written remains."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._unfinished = path.with_name(path.name + ".part")
        self._file: TextIO = self._unfinished.open("w", encoding="ascii")
        self._file.write(HEADER)

    def add(self, samples: Samples) -> None:
        """Append samples; a block without a number is left empty."""
        self._file.write("".join(rows(samples)))

    def close(self) -> None:
        """Finish the file."""
        self._file.close()
        self._unfinished.replace(self._path)


def rows(samples: Samples) -> Iterable[str]:
    """The rows of these samples."""
    columns = np.column_stack([samples.t_s, samples.position_mm, samples.feed_mm_min]).tolist()
    numbers = zip(samples.line.tolist(), samples.block.tolist(), strict=True)
    for (t, x, y, z, feed), (line, block) in zip(columns, numbers, strict=True):
        yield f"{t:.4f},{x:.6f},{y:.6f},{z:.6f},{feed:.4f},{line},{block if block >= 0 else ''}\n"
