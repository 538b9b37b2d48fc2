"""Speed of the virtual mill's motion: `python -m benchmarks.motion` (7.5).

A program of 100,000 straight blocks of 0.2 mm over a wave, interpreted and moved, under G64 and G642, at
a feed that the axes keep and at one that their jerk does not allow on blocks rounded to 1 um; the first run
of each, shorter, warms up. What is timed ends at the motion log; the motions as made, which only a verdict on the part
needs, are timed apart.
"""

from __future__ import annotations

import math
import time

from dnc.shipped import shipped_path
from sim.mill import rehearse
from sim.profile import load_mill_profile

BLOCKS, STEP_MM, LENGTH_MM, RUNS = 100_000, 0.2, 300.0, 3
FEEDS_MM_MIN = (1000, 3000)


def main() -> None:
    """Print blocks a second and how much faster than real time, best of the runs."""
    profile = load_mill_profile(shipped_path("machines", "sinumerik-840d"))
    for mode, feed in ((mode, feed) for mode in ("G64", "G642") for feed in FEEDS_MM_MIN):
        rehearse(program(mode, feed, 500), profile)
        data = program(mode, feed, BLOCKS)
        best_s, machining_s = math.inf, 0.0
        for _ in range(RUNS):
            begin_s = time.perf_counter()
            machining_s = rehearse(data, profile).machining_time_s
            best_s = min(best_s, time.perf_counter() - begin_s)
        begin_s = time.perf_counter()
        made = len(rehearse(data, profile).travelled)
        made_s = time.perf_counter() - begin_s - best_s
        print(
            f"{mode} F{feed}: {BLOCKS / best_s:.0f} blocks/s, {machining_s / best_s:.0f} times as fast as the machine; "
            f"{made} motions as made in {made_s:.2f} s more"
        )


def program(mode: str, feed_mm_min: int, blocks: int) -> bytes:
    """Steps of 0.2 mm to and fro along a wave."""
    half = LENGTH_MM / STEP_MM
    places = (STEP_MM * (half - abs(half - number % (2 * half))) for number in range(1, blocks + 1))
    moves = (f"X{x:.3f} Z{5 + 5 * math.sin(x / 20):.3f}" for x in places)
    return "\n".join([f"G90 {mode} F{feed_mm_min}", "G0 X0 Y0 Z10", "G1 Z5", *moves, "M30"]).encode()


if __name__ == "__main__":
    main()
