"""Pictures of a verdict, drawn with matplotlib; nothing here measures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.deviation import PatchMap, Verdict
from sim.errors import InputRejected, UserError

Floats = NDArray[np.float64]


class PlotUnavailable(UserError):
    """matplotlib is not installed."""


def plot_deviation(verdict: Verdict, path: Path) -> None:
    """The deviation map in plan, its histogram and the worst places, as one PNG.

    Raises PlotUnavailable without matplotlib, InputRejected if the file cannot be written.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise PlotUnavailable("matplotlib is not installed; pip install 'dripmill[plot]'") from None
    figure = Figure(figsize=(11, 6), layout="constrained")
    FigureCanvasAgg(figure)
    plan, side = figure.subplots(1, 2, width_ratios=[3, 2])
    _draw_map(figure, plan, verdict)
    _draw_histogram(side, verdict)
    unfinished = path.with_name(path.name + ".tmp")
    try:
        figure.savefig(unfinished, format="png", dpi=110)
        unfinished.replace(path)
    except OSError as problem:
        raise InputRejected(f"cannot be written: {problem.strerror}", path=path, remedy="name another file") from None


def _draw_map(figure: Any, axes: Any, verdict: Verdict) -> None:
    limit_um = 1000 * max(verdict.scallop_mm, verdict.gouge_mm, 1e-6)
    shades = None
    for mapped in verdict.maps:
        x, y, deviation_um = _plan(mapped)
        axes.pcolormesh(x, y, np.where(np.isfinite(deviation_um), np.nan, 0.0), cmap="Greys", vmin=-1, vmax=1)
        shades = axes.pcolormesh(
            x, y, np.ma.masked_invalid(deviation_um), cmap="RdBu_r", vmin=-limit_um, vmax=limit_um, shading="gouraud"
        )
    figure.colorbar(shades, ax=axes, label="deviation in um: + material left, - gouge", shrink=0.8)
    for places, mark in ((verdict.scallops[:1], "^"), (verdict.gouges[:1], "v")):
        for place in places:
            axes.plot(*place.position_mm[:2], mark, color="black", markerfacecolor="none")
    axes.set(aspect="equal", xlabel="X in mm", ylabel="Y in mm")
    axes.set_title(
        f"scallop {verdict.scallop_mm * 1000:.2f} um (triangle up), gouge {verdict.gouge_mm * 1000:.2f} um (down)\n"
        f"covered {verdict.coverage * 100:.2f} %; grey: not reached"
    )


def _plan(mapped: PatchMap) -> tuple[Floats, Floats, Floats]:
    return mapped.net.points[..., 0], mapped.net.points[..., 1], 1000 * mapped.height_mm


def _draw_histogram(axes: Any, verdict: Verdict) -> None:
    heights = np.concatenate([1000 * each.height_mm[each.is_covered] for each in verdict.maps])
    areas = np.concatenate([each.net.area_mm2[each.is_covered] for each in verdict.maps])
    axes.hist(heights, bins=120, weights=100 * areas / max(areas.sum(), 1e-300), color="#456990")
    axes.set(xlabel="deviation in um", ylabel="share of the covered area in %", yscale="log")
    axes.set_title(f"{heights.size} probes, pitch {verdict.probe_pitch_mm:g} mm")
