"""What a program does when it drips in over a line: time starved, and the highest feed at which it never starves.

The line is an ideal one, byte by byte: it sends whenever the buffer has room. The control looks at its buffer once a
cycle and takes a block when its last byte is there. After a wait the machine may have stopped before the next block
came: that is starvation.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Sequence

import numpy as np

from planner.feed_limit import feed_limit_mm_min
from planner.path.trace import TracedCurve
from sim.interpreter import canon
from sim.interpreter.run import Interpreter, interpret
from sim.mill import rehearse, settings_of
from sim.motion.machine import Machine
from sim.motion.shapes import shape_of
from sim.profile import MillProfile

FAST_BAUD = 10_000_000
START_S = 0.5
"""What the first blocks may take to come, which no feed changes."""


@dataclasses.dataclass(frozen=True)
class Drip:
    """One run: how long the machine stood for want of blocks, and how long the program took, s."""

    starved_s: float
    time_s: float


def drip(data: bytes, profile: MillProfile, baud: int, buffer_bytes: int, *, longest_s: float = math.inf) -> Drip:
    """Run a program through this line and buffer, until it is done or `longest_s` are over."""
    profile = dataclasses.replace(profile, baud=baud, receive_buffer_bytes=buffer_bytes)
    machine = Machine(profile, profile.block_cycle_s)
    interpreter = Interpreter(settings_of(profile, is_drip_fed=True))
    rate = baud / profile.bits_per_byte
    credit, sent, taken, line, now_s, is_done = 0.0, 0, 0, 0, 0.0, False
    while not is_done or machine.snapshot().blocks_queued > 0:
        now_s += profile.block_cycle_s
        # A full buffer stops the line: what it could have sent meanwhile is lost, but for the byte under way.
        room = min(taken + buffer_bytes, len(data)) - sent
        credit = min(credit + rate * profile.block_cycle_s, room + 1.0)
        sent += min(int(credit), room)
        credit -= int(credit)
        while not is_done and machine.free_blocks > 0:
            end = data.find(b"\n", taken, sent)
            if end < 0 and sent < len(data):
                break
            line += 1
            block, taken = data[taken : end + 1] if end >= 0 else data[taken:], end + 1 if end >= 0 else len(data)
            commands = interpreter.block(block, line)
            is_done = taken >= len(data) or any(isinstance(c, canon.End | canon.Alarm) for c in commands)
            for command in commands + (interpreter.finish() if is_done else []):
                machine.offer(command)
        if is_done:
            machine.close()
        machine.advance(now_s)
        if now_s > longest_s:
            break
    return Drip(sum(interval.duration_s for interval in machine.starved), now_s)


def highest_feed_mm_min(
    data: bytes, profile: MillProfile, baud: int, buffer_bytes: int, planned_mm_min: float, guess_mm_min: float
) -> float:
    """The highest cutting feed, to 2 %, at which the machine never waits; `planned_mm_min` is the one it has.

    No higher than its axes go. It waits where it stands for want of blocks, and where it takes half a percent longer
    than with all of the program at hand: a machine that sees too few blocks ahead slows before it stands.
    """

    def waits(feed_mm_min: float) -> bool:
        asked = with_feed(data, planned_mm_min, feed_mm_min)
        at_hand = drip(asked, profile, FAST_BAUD, 10 * len(data)).time_s
        run = drip(asked, profile, baud, buffer_bytes, longest_s=1.005 * at_hand + START_S)
        return run.starved_s > 0.0 or run.time_s > 1.005 * at_hand + START_S

    highest = axes_mm_min(profile)
    low = high = min(guess_mm_min, highest)
    while waits(low):
        low, high = 0.5 * low, low
    while low == high:
        if high >= highest:
            return highest
        next_mm_min = min(2.0 * high, highest)
        low, high = (high, next_mm_min) if waits(next_mm_min) else (next_mm_min, next_mm_min)
    while high > 1.02 * low:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if waits(middle) else (middle, high)
    return low


def axes_mm_min(profile: MillProfile) -> float:
    """The fastest that the axes X and Z go both."""
    return 60.0 * min(profile.axes[0].rapid_mm_s, profile.axes[2].rapid_mm_s)


def mean_cut_mm_min(data: bytes, profile: MillProfile, planned_mm_min: float, feed_mm_min: float) -> float:
    """How fast the machine really cuts on average with this feed programmed, all of the program at hand."""
    asked = with_feed(data, planned_mm_min, feed_mm_min)
    samples = rehearse(asked, profile).samples
    commands = interpret(asked, settings_of(profile, is_drip_fed=True))
    cutting = {c.line for c in commands if getattr(c, "feed_mm_min", 0.0) == round(feed_mm_min)}
    is_cutting = np.isin(samples.line[1:], list(cutting))
    step_mm = np.linalg.norm(np.diff(samples.position_mm, axis=0), axis=1)
    return float(60.0 * step_mm[is_cutting].sum() / np.diff(samples.t_s)[is_cutting].sum())


def with_feed(data: bytes, planned_mm_min: float, feed_mm_min: float) -> bytes:
    """The program with another cutting feed."""
    return re.sub(rb"F%d\b" % round(planned_mm_min), b"F%d" % round(feed_mm_min), data)


def first_passes(data: bytes, count: int) -> bytes:
    """The program with its first passes only: what stands before the next pass's numbered block, and its tail."""
    begin = data.index(b"\nN%dG" % (count + 1)) + 1
    return data[:begin] + data[data.rindex(b"\nZ50") + 1 :]


def line_limit_mm_min(data: bytes, profile: MillProfile, baud: int, planned_mm_min: float) -> float:
    """The feed at which the line alone just keeps up with the worst 2 s of the cut, whatever machine and buffer."""
    sizes = np.array([len(line) + 1 for line in data.splitlines()], dtype=float)
    cut_mm, other_s = np.zeros(len(sizes)), np.zeros(len(sizes))
    for command in interpret(data, settings_of(profile, is_drip_fed=True)):
        if not isinstance(command, canon.Line | canon.Arc | canon.Polynomial):
            continue
        length_mm = shape_of(command, 1e-3).length_mm
        if command.feed_mm_min == planned_mm_min:
            cut_mm[command.line - 1] += length_mm
        else:
            other_s[command.line - 1] += 60.0 * length_mm / command.feed_mm_min
    rate = baud / profile.bits_per_byte
    return feed_limit_mm_min(sizes, cut_mm, other_s, bytes_per_s=rate, override=1.0)


def in_even_steps(
    lean: bytes, curves: Sequence[TracedCurve], radius_mm: float, error_mm: float, feed_mm_min: float
) -> bytes:
    """The straight program `lean` with its passes written as CAM systems do: even steps, numbered blocks of all words.

    The step is the one whose sag at the sharpest bend is `error_mm`; the curves are those of the balls' centres.
    """
    lines = lean.splitlines()
    begins = [k for k, line in enumerate(lines) if re.match(rb"N\d+G0", line)]
    sharpest = max(float(np.abs(curve.curvatures).max()) for curve in curves)
    step_mm = math.sqrt(8.0 * error_mm / sharpest)
    made, number = lines[: begins[0]], 0
    for curve, begin, end in zip(curves, begins, [*begins[1:], len(lines)], strict=True):
        stop = next(k for k in range(begin + 1, end) if lines[k].startswith(b"G0Z"))
        count = math.ceil(curve.length_mm / step_mm)
        points = curve.refine(np.linspace(0.0, curve.length_mm, count + 1)).points
        found = re.search(rb"X(-?[\d.]+)", lines[begin])
        is_backward = found is not None and float(found.group(1)) > points[:, 0].mean()
        made += lines[begin : begin + 3]
        for w, z in points[::-1] if is_backward else points:
            number += 10
            block = f"N{number} G1 X{w:.3f} Y{curve.plane.offset_mm:.3f} Z{z - radius_mm:.3f}"
            made.append(block.encode())
        made[-count - 1] += b" F%d" % round(feed_mm_min)
        made += lines[stop:end]
    return b"\n".join(made) + b"\n"
