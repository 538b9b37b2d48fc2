"""The travel of the axes: what no position of the zero point can reach is refused, as a software limit switch does it.

The machine positions of the settable offsets are the setter's. While one is active the zero point may therefore lie
anywhere within the travel, and an axis reaches as far from it as it travels; without one (G500, and moves in machine
coordinates) it is the travel itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.canon import Motion, Rapid
from sim.interpreter.settings import Settings
from sim.interpreter.state import State
from sim.interpreter.tangents import bounds, extent


def check_travel(motion: Motion, state: State, settings: Settings) -> None:
    """Raises ControlAlarm for a motion that leaves the travel of an axis; one that starts outside may come back."""
    limits = reach_mm(state, settings, is_machine=isinstance(motion, Rapid) and motion.is_machine)
    if limits is None:
        return
    low, high = bounds(motion)
    if all(least <= low[index] and high[index] <= most for index, (least, most) in enumerate(limits)):
        return
    low, high = extent(motion)
    for index, (least_mm, most_mm) in enumerate(limits):
        for at_mm in (low[index], high[index]):
            if not least_mm <= at_mm <= most_mm and at_mm != motion.start[index]:
                axis, reach = "XYZ"[index], f"{least_mm:g} to {most_mm:g}"
                text = f"{axis} {at_mm:g} is beyond the travel of the axis; {reach} is expected"
                raise ControlAlarm(AlarmNumber.SOFTWARE_LIMIT, text, line=motion.line, block=motion.block)


def reach_mm(state: State, settings: Settings, *, is_machine: bool) -> tuple[tuple[float, float], ...] | None:
    """Least and greatest canonical position of X, Y and Z, mm; None where the travel is not known.

    `is_machine` says that the position is one of the machine's own coordinates.
    """
    if settings.travel_mm is None:
        return None
    if is_machine or state.work_offset == "G500":
        base = settings.work_offsets_mm.get(settings.reference_offset, (0.0, 0.0, 0.0))
        return tuple((least - zero, most - zero) for (least, most), zero in zip(settings.travel_mm, base, strict=True))
    return tuple((least - most, most - least) for least, most in settings.travel_mm)


def rows_within(values: NDArray[np.float64], state: State, settings: Settings, shift: tuple[float, ...]) -> int:
    """How many of these plain blocks (`PlainLines.values`), from the first on, stay within the travel."""
    reach = reach_mm(state, settings, is_machine=False)
    if reach is None:
        return len(values)
    ends = values[:, 2:5] + np.array(shift)
    low, high = np.array(reach).T
    outside = np.flatnonzero(((ends < low) | (ends > high)).any(axis=1))
    return int(outside[0]) if len(outside) else len(values)
