"""Canonical commands: the interpreter's only output, explicit and free of modality.

Every command carries its source: `line` (physical line, from 1) and `block` (the N word, or None). Positions are in
work coordinates (the frame that settable and programmable offsets make), mm, of the programmed point: the tool tip, or
the ball's centre where the program says so. Feeds mm/min, times s, angles rad.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import msgspec
import numpy as np
from numpy.typing import NDArray

Vector = tuple[float, float, float]


class Command(msgspec.Struct, frozen=True, gc=False):
    """What every canonical command carries."""

    line: int
    block: int | None


class Rapid(Command, frozen=True, gc=False):
    """Move all axes to `end` as fast as they go; the path between is not defined (it may dog-leg).

    `is_machine`: the program gave the end in the machine's coordinates, so that it says nothing about the part.
    """

    start: Vector
    end: Vector
    is_machine: bool = False


class Line(Command, frozen=True, gc=False):
    """Cut straight from `start` to `end`."""

    start: Vector
    end: Vector
    feed_mm_min: float


@dataclass(frozen=True, slots=True, eq=False)
class LineRun:
    """Many straight cuts in a row, the compact form of as many Line commands; `expand` gives those.

    `lines` (n,) and `blocks` (n,) are physical lines and block numbers (-1 for none), `start` the first start,
    `ends` (n, 3) mm, `feeds` (n,) mm/min. Each cut starts where the one before it ends.
    """

    lines: NDArray[np.int64]
    blocks: NDArray[np.int64]
    start: Vector
    ends: NDArray[np.float64]
    feeds: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.lines)

    @property
    def last(self) -> Line:
        """The last cut; a run is never empty."""
        return self.cut(len(self) - 1)

    def cut(self, index: int) -> Line:
        """One of the cuts, from 0."""
        start = self.start if index == 0 else self.ends[index - 1].tolist()
        x, y, z = self.ends[index].tolist()
        block = int(self.blocks[index])
        return Line(
            int(self.lines[index]),
            None if block < 0 else block,
            (start[0], start[1], start[2]),
            (x, y, z),
            float(self.feeds[index]),
        )

    def after(self, count: int) -> LineRun:
        """What follows the first `count` cuts, fewer than all."""
        return LineRun(
            self.lines[count:], self.blocks[count:], self.cut(count).start, self.ends[count:], self.feeds[count:]
        )

    def expand(self) -> Iterator[Line]:
        """The Line commands, one a cut."""
        start = self.start
        rows = zip(self.lines.tolist(), self.blocks.tolist(), self.ends.tolist(), self.feeds.tolist(), strict=True)
        for line, block, (x, y, z), feed in rows:
            end = (x, y, z)
            yield Line(line, None if block < 0 else block, start, end, feed)
            start = end


class Arc(Command, frozen=True, gc=False):
    """Cut about `centre`, turning about `axis` (unit, right hand) through `sweep_rad` (> 0); helical along `axis`."""

    start: Vector
    end: Vector
    centre: Vector
    axis: Vector
    sweep_rad: float
    feed_mm_min: float


class Polynomial(Command, frozen=True, gc=False):
    """Cut along c(p) = sum coefficients[k] p^k / sum denominator[k] p^k, p from 0 to `length`.

    `coefficients` are vectors, lowest power first, so coefficients[0] is `start`; `denominator` is (1.0,) when the
    curve is not rational. POLY blocks give one each; BSPLINE, ASPLINE and CSPLINE give one a span.
    """

    start: Vector
    end: Vector
    coefficients: tuple[Vector, ...]
    denominator: tuple[float, ...]
    length: float
    feed_mm_min: float


class PathMode(Enum):
    """How the control passes from block to block."""

    EXACT_STOP = "G60"
    CONTINUOUS = "G64"
    ROUNDING_DISTANCE = "G641"
    ROUNDING_TOLERANCE = "G642"


class SetPathMode(Command, frozen=True, gc=False):
    """From here on blocks join like this; `tolerance_mm` is the rounding distance or tolerance, or None."""

    mode: PathMode
    tolerance_mm: float | None


class ExactStopOnce(Command, frozen=True, gc=False):
    """The move that follows ends with an exact stop (G9)."""


class SetJerkLimit(Command, frozen=True, gc=False):
    """SOFT (True), BRISK (False)."""

    is_limited: bool


class Dwell(Command, frozen=True, gc=False):
    """Stand still for this time."""

    time_s: float


class SelectTool(Command, frozen=True, gc=False):
    """Tool `number` is made ready (T)."""

    number: int


class ChangeTool(Command, frozen=True, gc=False):
    """Tool `number` is in the spindle (M6, or T alone where the machine has no changer)."""

    number: int


class SelectEdge(Command, frozen=True, gc=False):
    """Cutting edge D; 0 switches the offsets of the tool off."""

    number: int


class Spindle(Command, frozen=True, gc=False):
    """Spindle speed, 1/min: > 0 clockwise (M3), < 0 counter-clockwise (M4), 0 stopped (M5)."""

    speed_rpm: float


class Coolant(Command, frozen=True, gc=False):
    """Coolant outlets on or off."""

    is_flood: bool
    is_mist: bool


class Message(Command, frozen=True, gc=False):
    """Text for the operator; empty deletes it."""

    text: str


class Stop(Command, frozen=True, gc=False):
    """Program stop: M0, or M1 when `is_optional`."""

    is_optional: bool


class End(Command, frozen=True, gc=False):
    """Program end (M2, M30)."""


class Alarm(Command, frozen=True, gc=False):
    """The control refuses the block and stops; `number` as the control names it, `text` one sentence."""

    number: int
    text: str
    column: int | None


Motion = Rapid | Line | Arc | Polynomial
