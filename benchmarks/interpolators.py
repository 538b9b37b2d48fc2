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

from benchmarks.dripping import (
    HIGHEST_MM_MIN,
    drip,
    first_passes,
    highest_feed_mm_min,
    in_even_steps,
    line_limit_mm_min,
)
from dnc.planning import limits_of
from dnc.profile import load_profile
from dnc.shipped import shipped_path
from planner.plan import plan_job
from sim.mill import rehearse
from sim.profile import MillProfile, load_mill_profile

KINDS = ("linear", "arcs", "poly", "bspline")
BAUDS = (1200, 2400, 9600, 38400, 115200)
BUFFERS_BYTES = (128, 5070)
FEEDS_MM_MIN = (250.0, 3000.0)
WAVE_PASSES, WAVE_PATH_MM, WAVE_FEED_MM_MIN, WAVE_BAUD = 12, 0.001, 1500.0, 9600
WAVE_MACHINES = ("sinumerik-840d", "slow-serial-1990s")


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
    cutting = {c.line for c in recording.commands if getattr(c, "feed_mm_min", 0.0) == feed_mm_min}
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


def wave_rows(profile_name: str, folder: Path) -> list[str]:
    """The wave at 1 um, 9600 baud: what the line alone allows, and the highest feed at which this machine never waits.

    Some passes of 300 mm, so many that even the smallest program is larger than the smaller buffer.
    """
    text = shipped_path("jobs", "wave").read_text()
    text = text.replace("../surfaces/wave.toml", str(shipped_path("surfaces", "wave")))
    text = text.replace("pick_feed_mm = 0.5", "pick_feed_mm = 7.5").replace(
        "plunge_mm_min = 100", "plunge_mm_min = 1400"
    )
    job = folder / "wave.toml"
    job.write_text(text)
    profile = load_mill_profile(shipped_path("machines", profile_name))
    limits = limits_of(load_profile(shipped_path("machines", profile_name)))
    planned = {kind: plan_job(job, limits, post={"blocks": kind}) for kind in KINDS}
    programs = {kind: one.program for kind, one in planned.items()}
    lean = planned["linear"]
    curves = sorted(lean.layout.curves, key=lambda curve: curve.plane.offset_mm)
    even = in_even_steps(lean.program, curves, lean.tool_path.radius_mm, WAVE_PATH_MM, WAVE_FEED_MM_MIN)
    rows = []
    for name, whole in (("G1, even steps, all words", even), *programs.items()):
        data = first_passes(whole, WAVE_PASSES)
        line = line_limit_mm_min(data, profile, WAVE_BAUD, WAVE_FEED_MM_MIN)
        cells = [f"{len(data) / WAVE_PASSES:.0f}", f"{line:.0f}"]
        for size in BUFFERS_BYTES:
            if len(data) <= size:
                cells.append("smaller than the buffer")
                continue
            feed = highest_feed_mm_min(data, profile, WAVE_BAUD, size, WAVE_FEED_MM_MIN, line)
            cells.append(f"{feed:.0f}" if feed < HIGHEST_MM_MIN else f"over {HIGHEST_MM_MIN:.0f}")
        rows.append(f"| {name} | " + " | ".join(cells) + " |")
    return rows


def main() -> int:
    """Plan, cut, starve; print the tables, and with `--write` put them into docs/."""
    profile = load_mill_profile(shipped_path("machines", "sinumerik-840d"))
    lines: list[str] = []
    starving: dict[str, dict[int, list[float]]] = {}
    with tempfile.TemporaryDirectory() as name:
        for feed in FEEDS_MM_MIN:
            lines += [f"### {feed:.0f} mm/min", "", _HEAD, _RULE]
            programs = {kind: plan(kind, feed, Path(name)) for kind in KINDS}
            for kind, (data, report) in programs.items():
                figures = motion_figures(data, profile, feed)
                lines.append(_row(kind, data, report, figures))
            lines.append("")
            if feed == FEEDS_MM_MIN[-1]:
                for kind, (data, _) in programs.items():
                    starving[kind] = {
                        size: [drip(data, profile, baud, size).starved_s for baud in BAUDS] for size in BUFFERS_BYTES
                    }
    lines += [f"### Time starved, s, at {FEEDS_MM_MIN[-1]:.0f} mm/min", ""]
    lines += [
        "| blocks | buffer | " + " | ".join(f"{baud} baud" for baud in BAUDS) + " |",
        "|---" * (2 + len(BAUDS)) + "|",
    ]
    for kind, sizes in starving.items():
        lines += [
            f"| {kind} | {size} B | " + " | ".join(f"{t:.1f}" for t in times) + " |" for size, times in sizes.items()
        ]
    with tempfile.TemporaryDirectory() as name:
        for machine in WAVE_MACHINES:
            lines += ["", f"### The wave at {WAVE_BAUD} baud, machine {machine}: highest feed, mm/min", ""]
            lines += [_WAVE_HEAD, "|---" * 5 + "|", *wave_rows(machine, Path(name))]
    print("\n".join(lines))
    if "--write" in sys.argv:
        page = Path("docs/interpolators.md")
        head, _, rest = page.read_text().partition("<!-- figures -->")
        tail = rest.partition("<!-- end of figures -->")[2]
        page.write_text(f"{head}<!-- figures -->\n" + "\n".join(lines) + f"\n<!-- end of figures -->{tail}")
        draw(starving, Path("docs/pictures/interpolators.png"))
    return 0


_WAVE_HEAD = (
    "| blocks | bytes a pass | of the line, worst 2 s | "
    + " | ".join(f"machine never waits, {size} B" for size in BUFFERS_BYTES)
    + " |"
)
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


def draw(starving: dict[str, dict[int, list[float]]], path: Path) -> None:
    """Time starved over baud rate, one line a kind of blocks, one panel a buffer."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, len(BUFFERS_BYTES), figsize=(9, 3.5), sharey=True)
    for panel, size in zip(panels, BUFFERS_BYTES, strict=True):
        for kind, sizes in starving.items():
            panel.semilogx(BAUDS, sizes[size], marker="o", label=kind)
        panel.set_title(f"buffer {size} B")
        panel.set_xlabel("baud")
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("time starved, s")
    panels[0].legend()
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    plt.close(figure)


if __name__ == "__main__":
    sys.exit(main())
