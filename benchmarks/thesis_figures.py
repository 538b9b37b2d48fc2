"""The figures and pictures of docs/thesis.md: `python -m benchmarks.thesis_figures` (about a minute).

Three programs are cut on the virtual mill and measured on the same surface: the thesis's as printed, its method with
its own pick feed (planned with the paper's rule), and ours. The table goes to stdout, the pictures to docs/pictures/.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from dnc.cli.main import run_with
from dnc.shipped import shipped_path
from sim.deviation import Verdict, judge
from sim.measuring import Comparison, compared, load_points
from sim.mill import Recording, rehearse
from sim.nominal import load_nominal
from sim.profile import load_mill_profile
from sim.tool import tool_of

ROOT = Path(__file__).parents[1]
JOB = shipped_path("jobs", "thesis")
PICTURES = ROOT / "docs/pictures"


@dataclass(frozen=True, slots=True)
class Cut:
    """One program, cut and measured."""

    name: str
    size_bytes: int
    recording: Recording
    verdict: Verdict

    def share(self, low_mm: float, high_mm: float) -> float:
        """Share of the whole surface whose deviation lies in [low, high)."""
        mapped = self.verdict.maps[0]
        height, area = mapped.height_mm, mapped.net.area_mm2
        return float(area[(height >= low_mm) & (height < high_mm)].sum() / area.sum())


def main() -> None:
    """Cut, measure, print, draw."""
    with tempfile.TemporaryDirectory() as folder:
        paper_job, paper, ours = (Path(folder) / name for name in ("paper.toml", "paper.mpf", "ours.mpf"))
        text = JOB.read_text().replace("../surfaces", str(shipped_path("surfaces", "thesis").parent))
        paper_job.write_text(text.replace("scallop_mm = 0.08", 'pick_feed_mm = 1.0\nfit = "paper"'))
        for job, program in ((paper_job, paper), (JOB, ours)):
            if run_with(["plan", str(job), "-o", str(program)]) != 0:
                raise SystemExit(f"planning {program.name} failed")
        cuts = [
            _cut("thesis, as printed", ROOT / "tests/golden/thesis-5000.mpf"),
            _cut("its method, 1 mm apart", paper),
            _cut("ours, 0.08 mm scallops", ours),
        ]
    _print(cuts)
    _draw_cuts(cuts, PICTURES / "thesis-cuts.png")
    comparison = compared(load_points(ROOT / "tests/sim/data/cmm-tables.csv"), load_nominal(JOB))
    _draw_points(comparison, PICTURES / "thesis-cmm.png")


def _cut(name: str, program: Path) -> Cut:
    nominal, data = load_nominal(JOB), program.read_bytes()
    recording = rehearse(data, load_mill_profile(shipped_path("machines", "sinumerik-840d")))
    verdict = judge(
        nominal, tool_of(nominal.cutter), recording.travelled, reference=nominal.reference, probe_pitch_mm=0.1
    )
    return Cut(name, len(data), recording, verdict)


def _print(cuts: list[Cut]) -> None:
    rows: list[tuple[str, list[str]]] = [
        ("", [cut.name for cut in cuts]),
        ("---", ["---:" for _ in cuts]),
        ("program, bytes", [f"{cut.size_bytes}" for cut in cuts]),
        ("blocks", [f"{cut.recording.blocks}" for cut in cuts]),
        ("machining time, min", [f"{cut.recording.machining_time_s / 60:.1f}" for cut in cuts]),
        ("highest scallop, um", [f"{1000 * cut.verdict.scallop_mm:.1f}" for cut in cuts]),
        ("deepest gouge, um", [f"{1000 * cut.verdict.gouge_mm:.1f}" for cut in cuts]),
        ("gouged deeper than 2 um, % of the surface", [f"{100 * cut.share(-np.inf, -0.002):.1f}" for cut in cuts]),
        ("left higher than 0.1 mm, % of the surface", [f"{100 * (1 - cut.share(-np.inf, 0.1)):.1f}" for cut in cuts]),
        ("never cut (over 1 mm left), % of the surface", [f"{100 * (1 - cut.verdict.coverage):.1f}" for cut in cuts]),
    ]
    for name, values in rows:
        print(f"| {name} | {' | '.join(values)} |")


def _draw_cuts(cuts: list[Cut], path: Path) -> None:
    figure = Figure(figsize=(11, 4.1), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, len(cuts), sharey=True)
    shades = None
    for each, cut in zip(axes, cuts, strict=True):
        mapped = cut.verdict.maps[0]
        x, y = mapped.net.points[::2, ::2, 0], mapped.net.points[::2, ::2, 1]
        height = np.ma.masked_invalid(1000 * mapped.height_mm[::2, ::2])
        each.pcolormesh(x, y, np.zeros(x.shape), cmap="Greys", vmin=-1, vmax=1, shading="gouraud")
        shades = each.pcolormesh(x, y, height, cmap="RdBu_r", vmin=-80, vmax=80, shading="gouraud")
        each.set(aspect="equal", title=cut.name, xlabel="X in mm")
    axes[0].set_ylabel("Y in mm")
    figure.colorbar(shades, ax=axes, label="um: + left, - gouge; grey: never cut", shrink=0.85)
    figure.savefig(path, dpi=80, metadata={"Software": None})


def _draw_points(comparison: Comparison, path: Path) -> None:
    figure = Figure(figsize=(7, 3.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    points = comparison.points
    for name, mark in zip(dict.fromkeys(points.group), "os^", strict=True):
        at = np.array([group == name for group in points.group])
        axes.plot(points.x_mm[at], 1000 * comparison.along_z_mm[at], mark, label=f"tool path {name}")
    offset, residual = 1000 * comparison.offset_mm, 1000 * comparison.residual_mm
    axes.axhline(offset, color="black", linewidth=1, label=f"offset {offset:.1f} um")
    axes.axhspan(offset - residual, offset + residual, color="#ddd", label=f"residual {residual:.1f} um")
    axes.axhline(0, color="black", linewidth=0.5)
    axes.set(xlabel="X in mm", ylabel="measured - design along Z in um")
    axes.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False)
    figure.savefig(path, dpi=80, metadata={"Software": None})


if __name__ == "__main__":
    main()
