"""One part as G1, arcs, POLY and BSPLINE through one control: size, feed, jerk, time, starvation by baud and buffer.

After Shpitalni, Koren and Lo (1994) and Yang and Kong (1994). Writes the table and the plot of docs/interpolators.md
when called with `--write`.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.dripping import drip
from benchmarks.wave_line import (
    KINDS,
    LOSS_FEED_MM_MIN,
    draw,
    feed_table,
    loss_table,
    losses_of,
    mill_of,
    wave_programs,
)
from dnc.shipped import shipped_path
from sim.interpreter.run import interpret
from sim.mill import rehearse, settings_of
from sim.profile import MillProfile, load_mill_profile

FEEDS_MM_MIN = (250.0, 3000.0)
WAVE_MACHINES = ("sinumerik-840d", "five-axis-840d", "slow-serial-1990s")


def plan(kind: str, feed_mm_min: float, folder: Path) -> tuple[bytes, dict[str, object]]:
    """The thesis part with this kind of blocks at this feed: program and plan report."""
    text = shipped_path("jobs", "thesis").read_text()
    text = text.replace("../surfaces/thesis.toml", str(shipped_path("surfaces", "thesis")))
    text = text.replace("cut_mm_min = 250.0", f"cut_mm_min = {feed_mm_min}")
    job, out, report = folder / "job.toml", folder / f"{kind}.mpf", folder / f"{kind}.json"
    job.write_text(text)
    command = [sys.executable, "-m", "dnc", "plan", str(job), "-o", str(out), "--blocks", kind, "--report", str(report)]
    subprocess.run(command, check=True, capture_output=True)
    return out.read_bytes(), json.loads(report.read_text())


def motion_figures(data: bytes, profile: MillProfile, feed_mm_min: float) -> dict[str, float]:
    """Feed fluctuation away from limits, peak and RMS jerk of the axes while cutting, machining time."""
    recording = rehearse(data, profile)
    samples, dt = recording.samples, profile.block_cycle_s
    commands = interpret(data, settings_of(profile, is_drip_fed=True))  # not the recording's, where runs are one
    cutting = {c.line for c in commands if getattr(c, "feed_mm_min", 0.0) == feed_mm_min}
    is_cutting = np.isin(samples.line, list(cutting)) & (samples.feed_mm_min > 0.0)
    jerk = np.diff(samples.position_mm, n=3, axis=0, prepend=[samples.position_mm[0]] * 3) / dt**3
    step = np.linalg.norm(np.diff(samples.position_mm, axis=0, prepend=samples.position_mm[:1]), axis=1) / dt * 60.0
    steady = is_cutting & (np.abs(samples.feed_mm_min - feed_mm_min) < 1e-6 * feed_mm_min)
    steady &= np.roll(steady, 2) & np.roll(steady, -2)
    return {
        "time_s": recording.machining_time_s,
        "peak_jerk": float(np.max(np.abs(jerk[is_cutting]))) / 1000.0,
        "rms_jerk": float(np.sqrt(np.mean(np.sum(jerk[is_cutting] ** 2, axis=1)))) / 1000.0,
        "feed_error": float(np.max(np.abs(step[steady] / feed_mm_min - 1.0))) if np.any(steady) else math.nan,
        "at_feed": float(np.count_nonzero(steady) / max(np.count_nonzero(is_cutting), 1)),
    }


def main() -> int:
    """Plan, cut, starve; print the tables, and with `--write` put them into docs/."""
    profile = load_mill_profile(shipped_path("machines", "sinumerik-840d"))
    lines: list[str] = []
    with tempfile.TemporaryDirectory() as name:
        for feed in FEEDS_MM_MIN:
            lines += [f"### {feed:.0f} mm/min", "", _HEAD, _RULE]
            for kind in KINDS:
                data, report = plan(kind, feed, Path(name))
                lines.append(_row(kind, data, report, motion_figures(data, profile, feed)))
            starved = max(drip(plan(kind, feed, Path(name))[0], profile, 1200, 128).starved_s for kind in KINDS)
            lines += ["", f"Longest time starved at 1200 baud through 128 bytes: {starved:.1f} s.", ""]
        for machine in WAVE_MACHINES:
            lines += [f"### The wave at 9600 baud, machine {machine}: highest feed, mm/min", ""]
            lines += [*feed_table(wave_programs(machine, Path(name)), mill_of(machine)), ""]
        losses = losses_of(wave_programs(WAVE_MACHINES[0], Path(name)), mill_of(WAVE_MACHINES[0]))
    lines += [f"### The wave at {LOSS_FEED_MM_MIN:.0f} mm/min, machine {WAVE_MACHINES[0]}: time lost, s", ""]
    lines += loss_table(losses)
    print("\n".join(lines))
    if "--write" in sys.argv:
        page = Path("docs/interpolators.md")
        head, _, rest = page.read_text().partition("<!-- figures -->")
        tail = rest.partition("<!-- end of figures -->")[2]
        page.write_text(f"{head}<!-- figures -->\n" + "\n".join(lines) + f"\n<!-- end of figures -->{tail}")
        draw(losses, Path("docs/pictures/interpolators.png"))
    return 0


_HEAD = (
    "| blocks | bytes | blocks | path error, um | time, s | share of cutting at the feed | feed error there | "
    "peak jerk, m/s3 | RMS jerk, m/s3 |"
)
_RULE = "|---" * 9 + "|"


def _row(kind: str, data: bytes, report: dict[str, object], figures: dict[str, float]) -> str:
    deviation_um = 1000.0 * float(str(report["path_deviation_mm"]))
    return (
        f"| {kind} | {len(data)} | {report['blocks']} | {deviation_um:.2f} | {figures['time_s']:.1f} | "
        f"{100 * figures['at_feed']:.1f} % | {100 * figures['feed_error']:.3f} % | {figures['peak_jerk']:.1f} | "
        f"{figures['rms_jerk']:.2f} |"
    )


if __name__ == "__main__":
    sys.exit(main())
