"""The wave through a slow line: highest feeds, and the time that a machine loses for want of blocks.

Twelve passes of 300 mm, 1 um, 7.5 mm apart: so many that even the smallest program is larger than either buffer.
"""

from __future__ import annotations

from pathlib import Path

from benchmarks.dripping import (
    FAST_BAUD,
    axes_mm_min,
    drip,
    first_passes,
    highest_feed_mm_min,
    in_even_steps,
    line_limit_mm_min,
    mean_cut_mm_min,
    with_feed,
)
from dnc.planning import limits_of
from dnc.profile import load_profile
from dnc.shipped import shipped_path
from planner.plan import plan_job
from sim.profile import MillProfile, load_mill_profile

KINDS = ("linear", "arcs", "poly", "bspline")
EVEN = "G1, even steps, all words"
BAUDS = (1200, 2400, 9600, 38400, 115200)
BUFFERS_BYTES = (128, 5070)
PASSES, PATH_MM, FEED_MM_MIN, BAUD = 12, 0.001, 1500.0, 9600
LOSS_FEED_MM_MIN = 6000.0

Losses = dict[str, dict[int, list[float]]]


def mill_of(name: str) -> MillProfile:
    """The virtual mill of a shipped profile."""
    return load_mill_profile(shipped_path("machines", name))


def wave_programs(machine: str, folder: Path) -> dict[str, bytes]:
    """The passes as a CAM system writes them and in our four kinds of blocks."""
    text = shipped_path("jobs", "wave").read_text()
    text = text.replace("../surfaces/wave.toml", str(shipped_path("surfaces", "wave")))
    for before, after in (
        ("pick_feed_mm = 0.5", "pick_feed_mm = 7.5"),
        ("plunge_mm_min = 100", "plunge_mm_min = 1400"),
    ):
        text = text.replace(before, after)
    job = folder / "wave.toml"
    job.write_text(text)
    limits = limits_of(load_profile(shipped_path("machines", machine)))
    planned = {kind: plan_job(job, limits, post={"blocks": kind}) for kind in KINDS}
    lean = planned["linear"]
    curves = sorted(lean.layout.curves, key=lambda curve: curve.plane.offset_mm)
    even = in_even_steps(lean.program, curves, lean.tool_path.radius_mm, PATH_MM, FEED_MM_MIN)
    programs = {EVEN: even, **{kind: one.program for kind, one in planned.items()}}
    return {name: first_passes(whole, PASSES) for name, whole in programs.items()}


def feed_table(programs: dict[str, bytes], profile: MillProfile) -> list[str]:
    """What the line alone allows, and the highest feed at which this machine never waits."""
    heads = [f"machine never waits, {size} B" for size in BUFFERS_BYTES]
    heads.append(f"mean of the cut then, {BUFFERS_BYTES[0]} B")
    rows = ["| blocks | bytes a pass | of the line, worst 2 s | " + " | ".join(heads) + " |", "|---" * 6 + "|"]
    for name, data in programs.items():
        line = line_limit_mm_min(data, profile, BAUD, FEED_MM_MIN)
        feeds = [highest_feed_mm_min(data, profile, BAUD, size, FEED_MM_MIN, line) for size in BUFFERS_BYTES]
        axes = axes_mm_min(profile)
        cells = [f"{len(data) / PASSES:.0f}", f"{line:.0f}"]
        cells += [f"{feed:.0f}" if feed < axes else f"the axes' {axes:.0f}" for feed in feeds]
        cells.append(f"{mean_cut_mm_min(data, profile, FEED_MM_MIN, feeds[0]):.0f}")
        rows.append(f"| {name} | " + " | ".join(cells) + " |")
    return rows


def losses_of(programs: dict[str, bytes], profile: MillProfile) -> Losses:
    """Time lost for want of blocks, s, by program, buffer and baud, against the program at hand."""
    found: Losses = {}
    for name, whole in programs.items():
        data = with_feed(whole, FEED_MM_MIN, LOSS_FEED_MM_MIN)
        at_hand_s = drip(data, profile, FAST_BAUD, 10 * len(data)).time_s
        found[name] = {
            size: [max(drip(data, profile, baud, size).time_s - at_hand_s, 0.0) for baud in BAUDS]
            for size in BUFFERS_BYTES
        }
    return found


def loss_table(losses: Losses) -> list[str]:
    """The losses as rows."""
    rows = ["| blocks | buffer | " + " | ".join(f"{baud} baud" for baud in BAUDS) + " |"]
    rows.append("|---" * (2 + len(BAUDS)) + "|")
    for name, sizes in losses.items():
        rows += [f"| {name} | {size} B | " + " | ".join(f"{t:.1f}" for t in sizes[size]) + " |" for size in sizes]
    return rows


def draw(losses: Losses, path: Path) -> None:
    """Time lost over baud rate, one line a kind of blocks, one panel a buffer."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, len(BUFFERS_BYTES), figsize=(9, 3.8), sharey=True, layout="constrained")
    for panel, size in zip(panels, BUFFERS_BYTES, strict=True):
        for index, (name, sizes) in enumerate(losses.items()):
            # Lines that lie upon each other are told apart: the later ones are thinner, with gaps.
            style, width = ("-", "--", ":")[index % 3], 3.5 - 0.5 * index
            panel.plot(BAUDS, sizes[size], style, lw=width, marker="o", ms=3 * width, label=name)
        panel.set(title=f"buffer {size} B", xlabel="baud", xscale="log", yscale="symlog")
        panel.set_xticks(BAUDS, [str(baud) for baud in BAUDS])
        panel.minorticks_off()
        panel.grid(alpha=0.3)
    panels[0].set_ylabel(f"time lost, s, at {LOSS_FEED_MM_MIN:.0f} mm/min")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    plt.close(figure)
