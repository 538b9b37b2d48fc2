"""The plan's clock for one program: when each line and block begins, from a rehearsal without a line.

A rehearsal takes seconds of computing, so the console runs this module as a process of its own: program and profile in,
the forecast as one line of JSON out.
"""

from __future__ import annotations

import asyncio
import bisect
import contextlib
import os
import sys
from pathlib import Path

import msgspec


class Forecast(msgspec.Struct, frozen=True):
    """Planned times in s since the first block: by line (rising), by block number, and in all; `stops` need a hand."""

    lines: tuple[int, ...]
    starts_s: tuple[float, ...]
    blocks: dict[int, float]
    total_s: float
    stops: tuple[int, ...]

    def done_s(self, line: int | None, block: int | None) -> float | None:
        """How far the plan has come when this block (better) or this line is being cut."""
        if block is not None and block in self.blocks:
            return self.blocks[block]
        if line is None or not self.lines:
            return None
        place = bisect.bisect_right(self.lines, line) - 1
        return self.starts_s[place] if place >= 0 else 0.0

    def next_stop_s(self, line: int | None) -> float | None:
        """Planned time of the next programmed stop after this line."""
        for stop in self.stops:
            if line is None or stop > line:
                return self.done_s(stop, None)
        return None


def forecast(program: Path, profile: Path) -> Forecast | None:
    """Rehearse the program on this machine; None if it cannot be read or alarms. Takes seconds: never in the screen."""
    import numpy as np

    from dnc.errors import UserError
    from sim.interpreter.canon import Stop
    from sim.mill import rehearse
    from sim.profile import load_mill_profile

    try:
        recording = rehearse(program.read_bytes(), load_mill_profile(profile))
    except (OSError, UserError):
        return None
    if recording.alarms or not len(recording.samples.t_s):
        return None
    samples = recording.samples
    lines, first = np.unique(samples.line, return_index=True)
    blocks, first_of_block = np.unique(samples.block, return_index=True)
    starts_s = np.maximum.accumulate(samples.t_s[first])
    times = {int(block): float(samples.t_s[at]) for block, at in zip(blocks, first_of_block, strict=True) if block >= 0}
    stops = tuple(
        command.line for command in recording.commands if isinstance(command, Stop) and not command.is_optional
    )
    return Forecast(
        tuple(int(line) for line in lines),
        tuple(float(start) for start in starts_s),
        times,
        recording.machining_time_s,
        stops,
    )


async def forecast_apart(program: Path, profile: Path) -> Forecast | None:
    """The same in a child process of low priority, which is ended when this is cancelled."""
    child = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "dnc.console.forecast", str(program), str(profile)),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
    )
    try:
        said, _ = await child.communicate()
    finally:
        if child.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                child.kill()
            await child.communicate()
    with contextlib.suppress(msgspec.DecodeError):
        return msgspec.json.decode(said, type=Forecast | None)
    return None


if __name__ == "__main__":
    os.nice(10)
    sys.stdout.buffer.write(msgspec.json.encode(forecast(Path(sys.argv[1]), Path(sys.argv[2]))))
