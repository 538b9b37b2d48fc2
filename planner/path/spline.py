"""The planar cubic B-spline of every pass, with as few spans as its tolerance allows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from planner.errors import InputRejected
from planner.path.bound import certify_all
from planner.path.cubic_fitter import CubicFitter
from planner.path.curve import ExactCurve
from planner.path.model import Method, PlaneSpline
from planner.path.slope_range import patch_table
from planner.path.span_search import SearchEnd, SpanSearch

MOST_SPANS = 400
AIM = 0.9  # of the tolerance, at the places of the spans; the distance between them comes on top


@dataclass(frozen=True, slots=True)
class FittedSpline:
    """A spline in the pass's plane and the bound on its distance from the exact curve, both ways."""

    spline: PlaneSpline
    deviation_mm: float
    method: Method


def fit_passes(curves: Sequence[ExactCurve], tolerance_mm: float, rounds: int = 8) -> list[FittedSpline]:
    """One cubic B-spline a curve, bounded within the tolerance, ends on the curve's ends; (F5) to (F11).

    A pass whose bound fails is aimed again lower, `rounds` times at most. Raises InputRejected with the pass and the
    distance reached where the tolerance cannot be kept.
    """
    if not curves:
        return []
    search = SpanSearch(CubicFitter(curves), AIM * tolerance_mm, MOST_SPANS)
    search.run()
    table = patch_table(curves)
    done: dict[int, FittedSpline] = {}
    for turn in range(rounds):
        rows = [row for row in range(len(curves)) if row not in done]
        splines = [search.found[row].spline for row in rows]
        bounds = certify_all([curves[row] for row in rows], splines, table)
        short: dict[int, float] = {}
        for row, spline, (deviation_mm, method) in zip(rows, splines, bounds, strict=True):
            found = search.found[row]
            if deviation_mm <= tolerance_mm:
                done[row] = FittedSpline(spline, deviation_mm, method)
            elif search.ends[row] is not SearchEnd.FITTED or found.spans >= MOST_SPANS or turn == rounds - 1:
                end = SearchEnd.NOT_BOUNDED if search.ends[row] is SearchEnd.FITTED else search.ends[row]
                what = f"pass {row + 1} is {1e3 * deviation_mm:.3g} um off at {found.spans} spans"
                raise InputRejected(f"{what}: {end.value}", remedy="give a larger path_mm")
            else:
                short[row] = min(0.95, max(0.5, 0.97 * tolerance_mm / deviation_mm))
        if not short:
            break
        search.tighten(short)
    return [done[row] for row in range(len(curves))]
