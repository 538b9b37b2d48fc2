"""Traced curves become what a control can follow: splines, straight moves or arcs, each within its tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from planner.errors import InputRejected
from planner.path.arcs import arc_chain
from planner.path.chord import paper_spline_within
from planner.path.model import Method, Pass
from planner.path.polyline import lean_polyline
from planner.path.slope_range import patch_table
from planner.path.slope_table import SlopeTable
from planner.path.spline import HEIGHTS_DEGREE, fit_leanest, fit_passes
from planner.path.trace import TracedCurve

Kind = Literal["poly", "free", "paper", "arcs", "linear"]
FIT_SHARE = 0.9  # of path_mm; the rest is left for the digits


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


def shape_passes(curves: Sequence[TracedCurve], kind: Kind, path_mm: float, radius_mm: float) -> list[Pass]:
    """One pass a curve, along +w, bounded within the fit's share of `path_mm`."""
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
    passes = []
    for curve in curves:
        shape, deviation_mm = (arc_chain if kind == "arcs" else lean_polyline)(curve, tolerance_mm)
        passes.append(Pass(curve.plane, shape, deviation_mm, Method.SAMPLED, _NONE, curve.length_mm))
    return passes


def _paper_pass(curve: TracedCurve, tolerance_mm: float, radius_mm: float, table: SlopeTable | None) -> Pass:
    """Lartigue's break points, closer together until the checked deviation keeps the tolerance."""
    found = paper_spline_within(curve, tolerance_mm, radius_mm, table)
    if found is None:
        what = f"the paper's rule does not reach {tolerance_mm:g} mm at {curve.plane.offset_mm:.3f} mm"
        raise InputRejected(what, remedy='use fit = "free"')
    fit, break_points = found
    return Pass(curve.plane, fit.spline, fit.deviation_mm, fit.method, break_points, curve.length_mm)


_NONE = np.zeros((0, 2))
