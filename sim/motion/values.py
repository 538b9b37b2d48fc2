"""What the moving machine tells: samples of its log, a snapshot, the stops it made and why.

Positions are of the programmed point in work coordinates, mm; the clock is the machine's own, s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import Vector

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class MachineState(Enum):
    """What the machine is doing, as its operator would say it."""

    READY = "ready"
    ACTIVE = "active"
    FEED_HOLD = "feed hold"
    PROGRAM_STOPPED = "program stopped"
    OPTIONAL_STOP = "optional stop"
    SINGLE_BLOCK = "single block"
    ALARM = "alarm"
    COMPLETED = "completed"


class StopReason(Enum):
    """Why the axes stood still; a stop without one of these would be a fault of the model."""

    EXACT_STOP = "exact stop"
    CORNER = "corner that cannot be rounded"
    LATE = "block came too late to pass without a stop"
    DWELL = "dwell"
    SPINDLE = "spindle"
    TOOL_CHANGE = "tool change"
    PROGRAM_STOP = "program stop"
    OPTIONAL_STOP = "optional stop"
    SINGLE_BLOCK = "single block"
    FEED_HOLD = "feed hold"
    OVERRIDE = "override at zero"
    STARVED = "no blocks from the line"
    ALARM = "alarm"
    RESET = "reset"
    END = "end of program"


@dataclass(frozen=True, slots=True)
class Samples:
    """A stretch of the motion log: (n,) times s, (n, 3) positions mm, (n,) path feeds mm/min, (n,) lines, (n,) blocks.

    Times lie on whole steps of the machine; while it waits for somebody (blocks, cycle start) it gives none. A block
    without a number is -1.
    """

    t_s: Array
    position_mm: Array
    feed_mm_min: Array
    line: NDArray[np.int64]
    block: NDArray[np.int64]

    @classmethod
    def joined(cls, parts: Sequence[Samples]) -> Samples:
        """Stretches that follow each other as one."""
        if len(parts) == 1:
            return parts[0]
        if not parts:
            none = np.zeros(0, dtype=np.int64)
            return cls(np.zeros(0), np.zeros((0, 3)), np.zeros(0), none, none)
        return cls(
            np.concatenate([part.t_s for part in parts]),
            np.concatenate([part.position_mm for part in parts]),
            np.concatenate([part.feed_mm_min for part in parts]),
            np.concatenate([part.line for part in parts]),
            np.concatenate([part.block for part in parts]),
        )

    @property
    def last_number(self) -> int | None:
        """The number of the last numbered block in this stretch."""
        numbered = self.block[self.block >= 0]
        return int(numbered[-1]) if len(numbered) else None


@dataclass(frozen=True, slots=True)
class StarvedInterval:
    """The machine stood in cycle because no block had arrived: when, how long, where, after which block."""

    t_s: float
    duration_s: float
    position_mm: Vector
    line: int
    block: int | None


@dataclass(frozen=True, slots=True)
class StandStill:
    """The axes stood from `t_s` on for `duration_s`, for this reason, after this block."""

    t_s: float
    duration_s: float
    reason: StopReason
    position_mm: Vector
    line: int
    block: int | None


@dataclass(frozen=True, slots=True)
class Rounding:
    """One corner as it was rounded: how far the path left the programmed one, where, before which line."""

    deviation_mm: float
    corner_mm: Vector
    line: int
    block: int | None


@dataclass(frozen=True, slots=True)
class MachineSnapshot:
    """The machine at this moment; `distance_to_go_mm` is end of block minus position, axis by axis."""

    time_s: float
    position_mm: Vector
    distance_to_go_mm: Vector
    feed_mm_min: float
    line: int
    block: int | None
    state: MachineState
    tool: int
    spindle_rpm: float
    is_flood: bool
    is_mist: bool
    override_percent: float
    is_single_block: bool
    blocks_done: int
    blocks_queued: int
    message: str
    alarm: str


@dataclass(frozen=True, slots=True)
class MachineTimes:
    """What the profile does not say: auxiliary times in s, the servo loop, and how a corner may be taken.

    `servo_gain_per_s` and `exact_stop_mm` give the time an exact stop waits for the axes to arrive (G601 fine);
    3.5 (m/min)/mm and 0.01 mm are one real machine's. `rounding_mm` is the tolerance of G642 and the distance of G641
    where the program names none; `continuous_mm` what G64 may leave the path by in a corner, as much as G601 takes for
    arrived; ends nearer than `same_place_mm` are one point, far below any control's resolution. With less way than
    `late_mm` before it must stand the machine is at a corner already. Of a leg that roundings at both its ends use up,
    no more than `no_length_mm` is left by the arithmetic.
    """

    tool_change_s: float = 4.0
    spindle_start_s: float = 1.0
    servo_gain_per_s: float = 3500.0 / 60.0
    exact_stop_mm: float = 0.01
    continuous_mm: float = 0.01
    rounding_mm: float = 0.01
    same_place_mm: float = 1e-7
    late_mm: float = 1e-4
    no_length_mm: float = 1e-12

    def settle_s(self, jerk_mm_s3: float) -> float:
        """Time until the axes are within the exact-stop window after the set values have come to rest.

        A stop with constant jerk J leaves a servo loop of gain K lagging by J/K^3, which decays with K.
        """
        lag_mm = jerk_mm_s3 / self.servo_gain_per_s**3
        return max(0.0, math.log(lag_mm / self.exact_stop_mm) / self.servo_gain_per_s)
