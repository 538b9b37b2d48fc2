"""How planning time grows with the cut and how spans grow with the tolerance; `--write` draws docs/pictures/.

Processor seconds from planes to bounded splines, on waves z = 5 sin(x / 20) cos(y / 15): once more passes of one
length, once longer passes of one number. A line of slope 1 is linear growth.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.planner_speed import fixed
from dnc.shipped import shipped_path
from planner.path.strategy.parallel import Wishes, prepare
from planner.report import segments
from planner.shapes import Kind, shape_passes
from planner.surface.load import load_surface
from planner.surface.patch import NurbsPatch

R_MM = 4.0
PICTURE = Path(__file__).parents[1] / "docs/pictures/planner-growth.png"
LENGTHS_MM = (300.0, 600.0, 1200.0, 2400.0, 4800.0, 9600.0)
PASSES_OF_EACH_LENGTH = 20
PASSES = (20, 40, 80, 160, 320)
TOLERANCES_MM = 10.0 ** -np.arange(2.0, 4.6, 0.5)
PITCH_MM = 5.0

Line = tuple[str, list[float], list[float]]


def main() -> int:
    """Print both tables; draw them if asked."""
    by_cut = [_more_passes(), _longer_passes()]
    (thesis,) = load_surface(shipped_path("surfaces", "thesis"))
    by_tolerance = [
        _spans("cubics, wave", wave(300.0, 300.0), 150.0 + 10.0 * np.arange(5), 298.4, "free"),
        _spans("degree 5, wave", wave(300.0, 300.0), 150.0 + 10.0 * np.arange(5), 298.4, "poly"),
        _spans("cubics, thesis", thesis, 5.0 + 10.0 * np.arange(5), 49.4, "free"),
        _spans("degree 5, thesis", thesis, 5.0 + 10.0 * np.arange(5), 49.4, "poly"),
    ]
    for title, lines in (("cut mm -> s", by_cut), ("path_mm -> spans a pass", by_tolerance)):
        for name, across, up in lines:
            print(f"{title}, {name}: {', '.join(f'{x:g} {y:.3g}' for x, y in zip(across, up, strict=True))}")
            print(f"   grows with the power {np.polyfit(np.log(across), np.log(up), 1)[0]:.3f}")
    if "--write" in sys.argv[1:]:
        _draw(by_cut, by_tolerance)
    return 0


def _more_passes() -> Line:
    patch = wave(300.0, 300.0)
    return "more passes of 298 mm", *_timed([(patch, 300.0, np.linspace(0.0, 300.0, count)) for count in PASSES])


def _longer_passes() -> Line:
    planes = np.linspace(5.0, 55.0, PASSES_OF_EACH_LENGTH)
    timed = _timed([(wave(length, 60.0), length, planes) for length in LENGTHS_MM])
    return f"{PASSES_OF_EACH_LENGTH} longer passes", *timed


def _timed(cases: list[tuple[NurbsPatch, float, np.ndarray]]) -> tuple[list[float], list[float]]:
    """Cut lengths (mm) and processor times."""
    cuts, times = [], []
    for patch, length_mm, planes in cases:
        begin = time.process_time()
        ground = prepare(patch, Wishes(R_MM, 0.0, None, 0.5))
        curves = fixed(ground, planes, 1.2, length_mm - 1.2, 0.001)
        shape_passes(curves, "poly", 0.001, R_MM)
        times.append(time.process_time() - begin)
        cuts.append(sum(curve.length_mm for curve in curves))
    return cuts, times


def _spans(name: str, patch: NurbsPatch, planes: np.ndarray, stop_mm: float, kind: Kind) -> Line:
    """Mean spans of passes over a patch at each tolerance."""
    ground = prepare(patch, Wishes(R_MM, 0.0, None, 1.0))
    means = []
    for path_mm in TOLERANCES_MM.tolist():
        curves = fixed(ground, planes, 1.6, stop_mm, path_mm)
        means.append(float(np.mean([segments(one.shape) for one in shape_passes(curves, kind, path_mm, R_MM)])))
    return name, TOLERANCES_MM.tolist(), means


def wave(x_mm: float, y_mm: float, degree: int = 3) -> NurbsPatch:
    """A wave of this size with control points about 5 mm apart, u along y."""
    knots, places = zip(*(_direction(size, degree) for size in (y_mm, x_mm)), strict=True)
    y, x = np.meshgrid(*places, indexing="ij")
    net = np.stack([x, y, 5 * np.sin(x / 20) * np.cos(y / 15)], axis=2)
    return NurbsPatch(degree, degree, *knots, net)


def _direction(size_mm: float, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Clamped knots over [0, 1] and the Greville places, mm."""
    inner = np.linspace(0.0, 1.0, round(size_mm / PITCH_MM) - degree + 1)
    knots = np.concatenate([np.zeros(degree), inner, np.ones(degree)])
    return knots, size_mm * np.mean([knots[1 + i : len(knots) - degree + i] for i in range(degree)], axis=0)


def _draw(by_cut: list[Line], by_tolerance: list[Line]) -> None:
    figure = Figure(figsize=(9.5, 3.8), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    for axes, lines, power, law in ((left, by_cut, 1.0, "linear"), (right, by_tolerance, -0.25, "(1/tolerance)^(1/4)")):
        for name, across, up in lines:
            axes.loglog(across, up, "o-", label=name)
        _, across, up = lines[0]
        axes.loglog(across, up[0] * (np.array(across) / across[0]) ** power, "k:", label=law)
        axes.grid(visible=True, which="both", alpha=0.25)
        axes.set_ylim(top=3 * max(max(up) for _, _, up in lines))
        axes.legend(frameon=False)
    left.set(xlabel="length of all passes, mm", ylabel="planning time, s", title="Time over cut, 1 um")
    right.set(xlabel="path tolerance, mm", ylabel="spans a pass", title="Spans over tolerance")
    figure.savefig(PICTURE, dpi=110)


if __name__ == "__main__":
    sys.exit(main())
