"""Pictures of a verdict, drawn with matplotlib; nothing here measures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.files import write_with
from sim.deviation import PatchMap, Verdict
from sim.errors import UserError
from sim.interpreter.canon import Vector
from sim.section import section_at
from sim.stock import stock_after

Floats = NDArray[np.float64]


class PlotUnavailable(UserError):
    """matplotlib is not installed."""


def require_drawing() -> None:
    """Load what draws, before a long run; raises PlotUnavailable where it is not installed."""
    try:
        import matplotlib.backends.backend_agg
        import matplotlib.figure  # noqa: F401 (loaded for later)
    except ImportError:
        raise PlotUnavailable("matplotlib is not installed; pip install 'dripmill[plot]'") from None


def plot_deviation(verdict: Verdict, path: Path, dwells_mm: Sequence[Vector] = ()) -> None:
    """Deviation map, histogram, the stock as cut and a section through the worst place, as one PNG.

    `dwells_mm` are the places where the tool stood for want of blocks: each may have left a mark.
    Raises PlotUnavailable without matplotlib, InputRejected if the file cannot be written.
    """
    require_drawing()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 10), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle("SIMULATED: what the virtual mill left of the part")
    (plan, side), (relief, section) = figure.subplots(2, 2, width_ratios=[3, 2])
    _draw_map(figure, plan, verdict)
    if dwells_mm:
        _draw_dwells(plan, dwells_mm)
    _draw_histogram(side, verdict)
    _draw_stock(relief, verdict)
    _draw_section(section, verdict)
    write_with(path, lambda part: figure.savefig(part, format="png", dpi=110))


def _draw_map(figure: Any, axes: Any, verdict: Verdict) -> None:
    limit_um = 1000 * verdict.scale_mm
    shades = None
    for mapped in verdict.maps:
        x, y, deviation_um = _plan(mapped)
        if not mapped.is_covered.all():
            axes.pcolormesh(x, y, np.zeros(x.shape), cmap="Greys", vmin=-1, vmax=1, shading="gouraud")
        shades = axes.pcolormesh(
            x, y, np.ma.masked_invalid(deviation_um), cmap="RdBu_r", vmin=-limit_um, vmax=limit_um, shading="gouraud"
        )
        if not mapped.is_accessible.all():
            beyond = np.ma.masked_where(mapped.is_accessible[:-1, :-1], np.ones(np.subtract(x.shape, 1)))
            axes.pcolormesh(x, y, beyond, cmap="Wistia", vmin=1, vmax=3)
        shades.set_in_layout(False)  # measuring a mesh of so many cells for the layout takes longer than drawing it
    ends = ends_beyond(verdict, limit_um)
    figure.colorbar(shades, ax=axes, label="deviation in µm: + material left, - gouge", shrink=0.8, extend=ends)
    for places, mark in ((verdict.scallops[:1], "^"), (verdict.gouges[:1], "v")):
        for place in places:
            axes.plot(*place.position_mm[:2], mark, color="black", markerfacecolor="none", clip_on=False)
    axes.set(aspect="equal", xlabel="X in mm", ylabel="Y in mm")
    axes.set_title(
        f"scallop {verdict.scallop_mm * 1000:.2f} µm (triangle up), gouge {verdict.gouge_mm * 1000:.2f} µm (down)\n"
        f"covered {verdict.coverage * 100:.2f} %; grey: not reached"
        + (
            f"\nyellow: out of this cutter's reach, {verdict.inaccessible * 100:.2f} %"
            if verdict.inaccessible > 0
            else ""
        )
    )


def ends_beyond(verdict: Verdict, limit_um: float) -> str:
    """Which ends of the scale are darker than what they stand for, in the words of the drawing library."""
    heights_um = np.concatenate([1000 * each.height_mm[np.isfinite(each.height_mm)] for each in verdict.maps])
    is_low, is_high = (bool((side * heights_um > 1.001 * limit_um).any()) for side in (-1, 1))
    return {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[
        is_low, is_high
    ]


def _draw_dwells(axes: Any, dwells_mm: Sequence[Vector]) -> None:
    x, y = np.array(dwells_mm)[:, :2].T
    words = f"tool stood here {len(x)} times for want of blocks: risk of a mark"
    axes.plot(x, y, "s", color="black", markerfacecolor="gold", markersize=4, linestyle="none", label=words)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), frameon=False)


def _plan(mapped: PatchMap) -> tuple[Floats, Floats, Floats]:
    return mapped.net.points[..., 0], mapped.net.points[..., 1], 1000 * mapped.height_mm


def _draw_histogram(axes: Any, verdict: Verdict) -> None:
    heights = np.concatenate([1000 * each.height_mm[each.is_covered] for each in verdict.maps])
    areas = np.concatenate([each.net.area_mm2[each.is_covered] for each in verdict.maps])
    if not heights.size:
        axes.set_axis_off()
        axes.set_title("no place was reached")
        return
    axes.hist(heights, bins=120, weights=100 * areas / max(areas.sum(), 1e-300), color="#456990")
    axes.set(xlabel="deviation in µm", ylabel="share of the covered area in %", yscale="log")
    axes.yaxis.set_major_formatter("{x:g}")
    chosen = axes.yaxis.get_minor_formatter()

    def plain(value: float, place: int | None) -> str:
        chosen.set_locs(())
        return f"{value:g}" if chosen(value, place) else ""

    axes.yaxis.set_minor_formatter(plain)
    axes.set_title(f"{heights.size} probes, pitch {verdict.probe_pitch_mm:g} mm")


def _draw_stock(axes: Any, verdict: Verdict) -> None:
    """The stock as a relief lit from the upper left, from a billet 1 mm higher than the design."""
    points = np.concatenate([each.net.points.reshape(-1, 3) for each in verdict.maps])
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    pitch_mm = float((high - low)[:2].max()) / 400
    stock = stock_after(verdict.probes, (low[0], low[1]), (high[0], high[1]), float(high[2]) + 1.0, pitch_mm)
    slope_x, slope_y = np.gradient(stock.z_mm, stock.x_mm, stock.y_mm)
    light = (0.6 + 3.0 * slope_x - 3.0 * slope_y) / np.sqrt(1.0 + 9.0 * (slope_x**2 + slope_y**2))
    extent = (float(low[0]), float(high[0]), float(low[1]), float(high[1]))
    axes.imshow(light.T, origin="lower", extent=extent, cmap="gray", vmin=0.0, vmax=1.2)
    axes.set(xlabel="X in mm", ylabel="Y in mm", title="stock as cut (Z-map, for the eye only)")


def _draw_section(axes: Any, verdict: Verdict) -> None:
    worst_places = (*verdict.scallops[:1], *verdict.gouges[:1])
    if worst_places:
        worst, tool = worst_places[0], verdict.probes.tool
        radius_mm = tool.corner_mm + tool.flat_mm
        width_mm = 4.0 * (2.0 * radius_mm * abs(worst.deviation_mm)) ** 0.5
        section = section_at(verdict, worst, width_mm, 801)
        axes.plot(section.distance_mm, 1000 * section.deviation_mm, color="#456990")
        x, y, _ = worst.position_mm
        axes.set_title(f"section across the passes at X{x:.3f} Y{y:.3f}")
    else:
        axes.set_title("no scallop, no gouge: no section")
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.set(xlabel="distance on the design in mm", ylabel="deviation in µm")
