"""The picture of a plan: passes over the surface, the scallop along the worst gap, one pass with its control points.

The only room of the planner that knows matplotlib.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from planner.errors import InputRejected
from planner.path.model import Pass, PlaneSpline
from planner.path.peaks import profile
from planner.path.spans import points_along
from planner.surface.curvature import span_places

if TYPE_CHECKING:
    from planner.plan import Planned

Array = NDArray[np.float64]

_INK, _PASS, _MARK = "#1b1f24", "#0b6e99", "#c8401e"
_MOST_DRAWN = 80  # passes


def draw_plan(planned: Planned) -> bytes:
    """The picture as PNG; raises InputRejected where matplotlib is not installed."""
    try:
        import matplotlib as mpl
    except ImportError:
        raise InputRejected("pictures need matplotlib", remedy="install dripmill[plot]") from None
    mpl.use("Agg")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 8), dpi=120, layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.1, 1))
    _draw_passes(figure, figure.add_subplot(grid[:, 0]), planned)
    _draw_scallop(figure.add_subplot(grid[0, 1]), planned)
    _draw_pass(figure.add_subplot(grid[1, 1]), planned)
    report = planned.report
    figure.suptitle(
        f"Program {planned.job.post.name}: {report['passes']} passes, {report['cut_length_mm']:.0f} mm, "
        f"{report['bytes']} bytes, path within {1000 * report['path_deviation_mm']:.2f} µm",
        color=_INK,
    )
    page = io.BytesIO()
    figure.savefig(page, format="png")
    return page.getvalue()


def _draw_passes(figure: Any, axes: Any, planned: Planned) -> None:
    """Heights of the part seen from above, passes over them with arrows the way they run.

    Of very many passes every n-th is drawn, as all would be one tint.
    """
    surface = planned.layout.ground.surface
    angle_rad = planned.tool_path.passes[0].plane.angle_rad
    patch = surface.patch.turned(-angle_rad)
    u, v = (np.interp(np.linspace(0, 1, 81), np.linspace(0, 1, len(p)), p) for p in _places(planned))
    grid = np.meshgrid(u, v, indexing="ij")
    x, y, z = (part.reshape(81, 81) for part in patch.evaluate(grid[0].ravel(), grid[1].ravel()).point)
    heights = axes.contourf(x, y, z, levels=16, cmap="Greys", alpha=0.75)
    figure.colorbar(heights, ax=axes, label="Z of the part, mm", shrink=0.7)
    passes = planned.tool_path.passes
    every = -(-len(passes) // _MOST_DRAWN)
    drawn = passes[::every]
    width = float(np.clip(60 / len(drawn), 0.5, 1.0))
    for one in drawn:
        points = one.plane.to_work(_sampled(one, 80))
        axes.plot(points[:, 0], points[:, 1], color=_PASS, linewidth=width)
        if len(drawn) <= 60:
            middle = points[len(points) // 2 : len(points) // 2 + 2]
            head = {"arrowstyle": "-|>", "color": _PASS, "lw": width}
            axes.annotate("", xy=middle[1, :2], xytext=middle[0, :2], arrowprops=head)
    u_worst, v_worst = _worst_place(planned)
    worst = patch.evaluate(np.array([u_worst]), np.array([v_worst])).point[:, 0]
    label = f"highest scallop, {1000 * planned.report['scallop_mm']:.1f} µm"
    axes.plot(worst[0], worst[1], "o", color=_MARK, markersize=8, fillstyle="none", markeredgewidth=2, label=label)
    title = "Ball centres over the part" + (f"; one pass of {every} is drawn" if every > 1 else "")
    axes.set(aspect="equal", xlabel="X, mm", ylabel="Y, mm", title=title)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.07), frameon=False)


def _draw_scallop(axes: Any, planned: Planned) -> None:
    """Height of the cusp line along the gap with the highest cusp, against what was asked."""
    layout = planned.layout
    operation = planned.job.operation[0]
    axes.set(xlabel="along the pass, mm", ylabel="scallop, µm")
    if operation.scallop_mm is not None:
        axes.axhline(1000 * operation.scallop_mm, color=_MARK, linewidth=1, linestyle="--", label="asked")
    if len(layout.planes_mm) > 1:
        gap = worst_gap(planned)
        x, height_mm = profile(layout.ground, layout.planes_mm, gap, 200)
        axes.set_title(f"Worst gap, pick feed {np.diff(layout.planes_mm)[gap]:.3f} mm")
        if len(x):  # passes that roll over a narrow strip meet beside it, and leave no cusp on it
            axes.plot(x, 1000 * height_mm, color=_PASS, label=f"between planes {gap + 1} and {gap + 2}")
            top_mm = max(float(height_mm.max()), operation.scallop_mm or 0.0)
            axes.set_ylim(950 * float(height_mm.min()), 1010 * top_mm)
        else:
            axes.text(0.5, 0.5, "no cusp line to follow", transform=axes.transAxes, ha="center")
    axes.grid(alpha=0.25)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2, frameon=False)


def _draw_pass(axes: Any, planned: Planned) -> None:
    """The longest pass: its curve, and control points, vertices or arc ends; heights enlarged."""
    one = max(planned.tool_path.passes, key=lambda item: item.length_mm)
    curve = _sampled(one, 400)
    axes.plot(curve[:, 0], curve[:, 1], color=_PASS, label="ball centre")
    if isinstance(one.shape, PlaneSpline):
        points, name = one.shape.control_points, "control points"
        axes.plot(points[:, 0], points[:, 1], color=_MARK, linewidth=0.8, linestyle=":")
    else:
        points, name = one.shape.points, "block ends"
    axes.plot(points[:, 0], points[:, 1], "s", color=_MARK, markersize=4, label=f"{len(points)} {name}")
    if len(one.break_points):
        axes.plot(*one.break_points.T, "o", color=_INK, markersize=4, fillstyle="none", label="break points")
    where = f"plane at {one.plane.offset_mm:.3f} mm"
    axes.set(
        xlabel="along the pass, mm",
        ylabel="Z of the centre, mm",
        title=f"One pass, {where}, within {one.deviation_mm * 1000:.2f} µm",
    )
    axes.grid(alpha=0.25)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, frameon=False)


def _places(planned: Planned) -> tuple[Array, Array]:
    patch = planned.layout.ground.surface.patch
    return span_places(patch.basis_u, 2), span_places(patch.basis_v, 2)


def _worst_place(planned: Planned) -> tuple[float, float]:
    """(u, v) under the highest cusp of all gaps; the patch's first corner where there is no gap."""
    peaks = planned.layout.peaks
    if not len(peaks.height_mm):
        (u_low, _), (v_low, _) = planned.layout.ground.surface.patch.domain
        return u_low, v_low
    u, v = peaks.foot[:, worst_gap(planned)]
    return float(u), float(v)


def worst_gap(planned: Planned) -> int:
    """The gap with the highest cusp; outside the border there are gaps with a bound but without a cusp of their own."""
    peaks = planned.layout.peaks
    has_cusp = (peaks.by_a != 0) | (peaks.by_b != 0)
    return int(np.argmax(np.where(has_cusp, peaks.height_mm, -1.0)))


def _sampled(one: Pass, count: int) -> Array:
    """Points along a pass's shape in its plane."""
    if not isinstance(one.shape, PlaneSpline):
        return points_along(one.shape)
    degree, knots = one.shape.degree, one.shape.knots
    places = np.linspace(knots[degree], knots[-degree - 1], count)
    span = np.clip(np.searchsorted(knots, places, side="right") - 1, degree, len(knots) - degree - 2)
    points = [one.shape.control_points[span - degree + i] for i in range(degree + 1)]
    for level in range(1, degree + 1):  # the algorithm of de Boor
        for i in range(degree, level - 1, -1):
            low, high = knots[span - degree + i], knots[span + i - level + 1]
            share = ((places - low) / (high - low))[:, None]
            points[i] = (1 - share) * points[i - 1] + share * points[i]
    return points[degree]
