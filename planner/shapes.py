"""Traced curves become what a control can follow: splines, straight moves or arcs, each within its tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from planner.errors import InputRejected
from planner.path.arcs import arc_chain
from planner.path.chord import paper_spline_within
from planner.path.joint import joined
from planner.path.link_bound import bound_links, seen_gaps
from planner.path.model import ArcChain, Method, Pass, Polyline
from planner.path.polyline import lean_polyline
from planner.path.roll import RolledSurface
from planner.path.slope_range import patch_table
from planner.path.slope_table import SlopeTable
from planner.path.spline import HEIGHTS_DEGREE, fit_leanest, fit_passes
from planner.path.strategy.parallel import Layout
from planner.path.trace import TracedCurve

Kind = Literal["poly", "free", "paper", "arcs", "linear"]
FIT_SHARE = 0.9  # of path_mm; the rest is left for the digits
CLOSER = (1, 2, 4, 8, 16)  # how much closer sections of arcs and straight moves stand, try after try
LINKS_AIM = 0.99  # of their tolerance for arcs and straight moves; the bound lies up to a hundredth above their aim


def kind_of(control: str, blocks: str, fit: Literal["free", "paper"], poly_degree: int) -> Kind:
    """Which shape a control's blocks want; "auto" takes splines where the control reads them, else arcs.

    >>> kind_of("linuxcnc", "auto", "free", 3)
    'arcs'
    >>> kind_of("sinumerik-840d", "auto", "free", 5)
    'poly'
    """
    if blocks == "linear":
        return "linear"
    if blocks == "arcs" or (blocks == "auto" and control in ("linuxcnc", "generic")):
        return "arcs"
    if fit == "free" and poly_degree >= HEIGHTS_DEGREE and control == "sinumerik-840d" and blocks in ("auto", "poly"):
        return "poly"
    return fit


def shape_layout(layout: Layout, kind: Kind, path_mm: float, chosen: Sequence[int] | None = None) -> list[Pass]:
    """The passes of a layout, or the chosen ones, along +w, bounded within the fit's share of `path_mm`.

    Pieces of a pass are cubics where splines are asked for, which join into one.
    """
    wanted = [row for row in range(len(layout.curves)) if chosen is None or layout.pass_of[row] in chosen]
    has_pieces = len(layout.curves) > layout.pass_of[-1] + 1
    kind = "free" if kind == "poly" and has_pieces else kind
    shaped: dict[int, Pass] = {}
    # Curves over one surface are fitted and bounded together.
    for surface in {id(layout.curves[row].surface): layout.curves[row].surface for row in wanted}.values():
        rows = [row for row in wanted if layout.curves[row].surface is surface]
        # What a ball beside the edge comes too near, it cuts deeper along the patch's own normal, (23).
        kept_mm = (1 - surface.facing) * path_mm if isinstance(surface, RolledSurface) else 0.0
        curves, left_mm = [layout.curves[row] for row in rows], path_mm - kept_mm / FIT_SHARE
        passes = shape_passes(curves, kind, left_mm, surface.radius_mm, ends_on_curve=has_pieces)
        for row, one in zip(rows, passes, strict=True):
            shaped[row] = replace(one, deviation_mm=one.deviation_mm + kept_mm)
    pieces: dict[int, list[Pass]] = {}
    for row in wanted:
        pieces.setdefault(int(layout.pass_of[row]), []).append(shaped[row])
    return [joined(parts) for parts in pieces.values()]


def shape_passes(
    curves: Sequence[TracedCurve], kind: Kind, path_mm: float, radius_mm: float, *, ends_on_curve: bool = False
) -> list[Pass]:
    """One pass a curve, all over one surface, bounded within the fit's share of `path_mm`.

    With `ends_on_curve` straight moves begin and end on the curve, as splines and arcs always do.
    """
    tolerance_mm = FIT_SHARE * path_mm
    if kind in ("free", "poly"):
        fits = (fit_passes if kind == "free" else fit_leanest)(curves, tolerance_mm)
        return [
            Pass(curve.plane, fit.spline, fit.deviation_mm, fit.method, _NONE, curve.length_mm)
            for curve, fit in zip(curves, fits, strict=True)
        ]
    if kind == "paper":
        table = patch_table(curves)
        return [_paper_pass(curve, tolerance_mm, radius_mm, table) for curve in curves]
    return _links_within(curves, kind, tolerance_mm, ends_on_curve=ends_on_curve)


def _links_within(curves: Sequence[TracedCurve], kind: Kind, tolerance_mm: float, *, ends_on_curve: bool) -> list[Pass]:
    """Arcs or straight moves; their bound is proved where the curvature of the curves is enclosed.

    They are laid between sections, closer ones and to a little less where a curve turns out to leave them by more than
    the tolerance between two. Raises InputRejected where that does not help.
    """
    table = patch_table(curves)
    passes: dict[int, Pass] = {}
    rows, aims_mm = list(range(len(curves))), np.full(len(curves), LINKS_AIM * tolerance_mm)
    for closer in CLOSER:
        late = [curves[row] for row in rows]
        shapes = [_links_of(curves[row], kind, aims_mm[row], closer, is_held=ends_on_curve) for row in rows]
        bounds = np.full(len(rows), np.inf) if table is None else bound_links(late, shapes, table)
        is_proved = np.isfinite(bounds)
        deviations_mm = bounds if is_proved.all() else np.where(is_proved, bounds, seen_gaps(late, shapes))
        for row, curve, shape, one_mm, proved in zip(rows, late, shapes, deviations_mm, is_proved, strict=True):
            method = Method.PROVED if proved else Method.SAMPLED
            passes[row] = Pass(curve.plane, shape, float(one_mm), method, _NONE, curve.length_mm)
        rows = [row for row in rows if passes[row].deviation_mm > tolerance_mm]
        if not rows:
            return [passes[row] for row in range(len(curves))]
        aims_mm[rows] *= 0.98
    name = "arcs" if kind == "arcs" else "straight moves"
    what = f"{name} do not reach {tolerance_mm:g} mm at {curves[rows[0]].plane.offset_mm:.3f} mm"
    remedy = 'raise path_mm, or write splines (blocks = "auto" at a control that reads them)'
    raise InputRejected(what, remedy=remedy, key=("operation", 0, "path_mm"))


def link_count(curve: TracedCurve, kind: Kind, path_mm: float) -> int:
    """How many arcs or straight moves a pass of these takes, as far as they are laid at first."""
    shape = _links_of(curve, kind, LINKS_AIM * FIT_SHARE * path_mm, CLOSER[0], is_held=False)
    return len(shape.points) - 1


def _links_of(
    curve: TracedCurve, kind: Kind, tolerance_mm: float, closer: int, *, is_held: bool
) -> Polyline | ArcChain:
    if kind == "arcs":
        return arc_chain(curve, tolerance_mm, closer)[0]
    return lean_polyline(curve, tolerance_mm, closer, ends_on_curve=is_held)[0]


def _paper_pass(curve: TracedCurve, tolerance_mm: float, radius_mm: float, table: SlopeTable | None) -> Pass:
    """Lartigue's break points, closer together until the checked deviation keeps the tolerance."""
    found = paper_spline_within(curve, tolerance_mm, radius_mm, table)
    if found is None:
        what = f"the paper's rule does not reach {tolerance_mm:g} mm at {curve.plane.offset_mm:.3f} mm"
        raise InputRejected(what, remedy='use fit = "free"', key=("operation", 0, "fit"))
    fit, break_points = found
    return Pass(curve.plane, fit.spline, fit.deviation_mm, fit.method, break_points, curve.length_mm)


_NONE = np.zeros((0, 2))
