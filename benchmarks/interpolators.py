"""One part as G1, arcs, POLY and BSPLINE through one control: size, feed, jerk, time, starvation by baud and buffer.

After Shpitalni, Koren and Lo (1994) and Yang and Kong (1994). Writes the table and the plot of docs/interpolators.md
when called with `--write`.
"""

from __future__ import annotations

import dataclasses
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from dnc.shipped import shipped_path
from sim.interpreter import canon
from sim.interpreter.run import Interpreter
from sim.mill import rehearse, settings_of
from sim.motion.machine import Machine
from sim.profile import MillProfile, load_mill_profile

KINDS = ("linear", "arcs", "poly", "bspline")
BAUDS = (1200, 2400, 9600, 38400, 115200)
BUFFERS_BYTES = (128, 5070)
FEEDS_MM_MIN = (250.0, 3000.0)
LONGEST_CALL_S = 0.2


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


def starved_s(data: bytes, profile: MillProfile, baud: int, buffer_bytes: int) -> float:
    """Time the machine stands for want of blocks when the program drips in at this rate through this buffer.

    The line sends whenever the buffer has room (an ideal handshake); a block can be read when its last byte is there.
    Line and machine meet every 0.2 s or twice in the time the buffer takes to fill, whichever is shorter.
    """
    profile = dataclasses.replace(profile, baud=baud, receive_buffer_bytes=buffer_bytes)
    machine = Machine(profile, profile.block_cycle_s)
    interpreter = Interpreter(settings_of(profile, is_drip_fed=True))
    rate = baud / profile.bits_per_byte
    call_s = min(LONGEST_CALL_S, 0.5 * buffer_bytes / rate)
    sent, taken, line, now_s, is_done = 0.0, 0, 0, 0.0, False
    while not is_done or machine.snapshot().blocks_queued > 0:
        now_s += call_s
        sent = min(sent + rate * call_s, float(len(data)), float(taken + buffer_bytes))
        while not is_done and machine.free_blocks > 0:
            end = data.find(b"\n", taken, int(sent))
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
    return sum(interval.duration_s for interval in machine.starved)


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
                        size: [starved_s(data, profile, baud, size) for baud in BAUDS] for size in BUFFERS_BYTES
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
    print("\n".join(lines))
    if "--write" in sys.argv:
        page = Path("docs/interpolators.md")
        head, _, rest = page.read_text().partition("<!-- figures -->")
        tail = rest.partition("<!-- end of figures -->")[2]
        page.write_text(f"{head}<!-- figures -->\n" + "\n".join(lines) + f"\n<!-- end of figures -->{tail}")
        draw(starving, Path("docs/pictures/interpolators.png"))
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
