"""The spline of every pass, free cubic or heights of degree 5, with as few spans as its tolerance allows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf

from planner.errors import InputRejected
from planner.path.bound import certify_all
from planner.path.cubic_fitter import CubicFitter
from planner.path.curve import ExactCurve
from planner.path.height_fitter import HeightFitter
from planner.path.model import Method, PlaneSpline
from planner.path.slope_range import patch_table
from planner.path.slope_table import SlopeTable
from planner.path.span_search import Fitter, SearchEnd, SpanSearch
from planner.path.spans import joints_of

MOST_SPANS = 400
HEIGHTS_DEGREE = 5
FEW_SPANS = 3
ROUNDS = 8
LEAST_LEAN = 0.5  # cosine of the steepest angle at which a pass is written as heights
AIM = 0.9  # of the tolerance, at the places of the spans; the distance between them comes on top


@dataclass(frozen=True, slots=True)
class FittedSpline:
    """A spline in the pass's plane and the bound on its distance from the exact curve, both ways."""

    spline: PlaneSpline
    deviation_mm: float
    method: Method

    @property
    def spans(self) -> int:
        """Number of spans."""
        return len(joints_of(self.spline)) - 1


@dataclass(frozen=True, slots=True)
class Failed:
    """How the search for one curve ended without a spline, and how far the last one was off."""

    deviation_mm: float
    spans: int
    end: SearchEnd


def fit_passes(curves: Sequence[ExactCurve], tolerance_mm: float) -> list[FittedSpline]:
    """One cubic B-spline a curve, bounded within the tolerance, ends on the curve's ends; (F5) to (F11).

    Raises InputRejected with the pass and the distance reached where the tolerance cannot be kept.
    """
    fits = _fit(curves, CubicFitter, tolerance_mm, patch_table(curves))
    return [_fitted(fit, row) for row, fit in enumerate(fits)]


def fit_heights(
    curves: Sequence[ExactCurve], tolerance_mm: float, table: SlopeTable | None = None
) -> list[FittedSpline | None]:
    """One spline z(w) of degree 5 a curve, bounded within the tolerance, ends on the curve's ends; (F18) to (F21).

    None for curves that are too steep for heights, and where the tolerance cannot be kept. `table` is
    `patch_table(curves)` if the caller has it.
    """
    gentle = [row for row, curve in enumerate(curves) if curve.tangents[:, 0].min() > LEAST_LEAN]
    chosen = [curves[row] for row in gentle]
    found: list[FittedSpline | None] = [None] * len(curves)
    for row, fit in zip(gentle, _fit(chosen, HeightFitter, tolerance_mm, table or patch_table(chosen)), strict=True):
        found[row] = fit if isinstance(fit, FittedSpline) else None
    return found


def fit_leanest(curves: Sequence[ExactCurve], tolerance_mm: float) -> list[FittedSpline]:
    """Of heights and a free cubic the one with fewer spans, heights where they are equal.

    Over long passes a cubic takes 1.6 spans and more for one of degree 5, so it is tried with one span less where there
    are few, and where a pass is too steep for heights. Raises InputRejected as `fit_passes` does.
    """
    table = patch_table(curves)
    chosen = dict(enumerate(fit_heights(curves, tolerance_mm, table)))
    for spans in range(FEW_SPANS, 1, -1):
        rows = [row for row, fit in chosen.items() if fit is not None and fit.spans == spans]
        cubics = _fit([curves[row] for row in rows], CubicFitter, tolerance_mm, table, spans - 1)
        chosen |= {row: fit for row, fit in zip(rows, cubics, strict=True) if isinstance(fit, FittedSpline)}
    steep = [row for row, fit in chosen.items() if fit is None]
    cubics = _fit([curves[row] for row in steep], CubicFitter, tolerance_mm, table)
    chosen |= {row: _fitted(fit, row) for row, fit in zip(steep, cubics, strict=True)}
    return [fit for fit in chosen.values() if fit is not None]


def _fitted(fit: FittedSpline | Failed, row: int) -> FittedSpline:
    if isinstance(fit, Failed):
        far = f"is {1e3 * fit.deviation_mm:.3g} um off" if fit.deviation_mm < inf else "is not known to be near"
        what = f"pass {row + 1} {far} at {fit.spans} spans"
        raise InputRejected(f"{what}: {fit.end.value}", remedy="give a larger path_mm", key=("operation", 0, "path_mm"))
    return fit


def _fit(
    curves: Sequence[ExactCurve],
    kind: Callable[[Sequence[ExactCurve]], Fitter],
    tolerance_mm: float,
    table: SlopeTable | None,
    only_spans: int | None = None,
) -> list[FittedSpline | Failed]:
    """One spline a curve, with so many spans if that is asked; one whose bound fails is aimed again lower."""
    if not curves:
        return []
    most_spans = only_spans or MOST_SPANS
    search = SpanSearch(kind(curves), AIM * tolerance_mm, most_spans)
    if only_spans:
        search.from_scratch(dict.fromkeys(range(len(curves)), only_spans))
    else:
        search.run()
    done: dict[int, FittedSpline | Failed] = {}
    for turn in range(ROUNDS):
        for row, end in search.ends.items():
            if end is not SearchEnd.FITTED:
                done[row] = Failed(search.found[row].error_mm, search.found[row].spans, end)
        rows = [row for row in range(len(curves)) if row not in done]
        splines = [search.found[row].spline for row in rows]
        bounds = certify_all([curves[row] for row in rows], splines, table) if rows else []
        short: dict[int, float] = {}
        for row, spline, (deviation_mm, method) in zip(rows, splines, bounds, strict=True):
            if deviation_mm <= tolerance_mm:
                done[row] = FittedSpline(spline, deviation_mm, method)
            elif turn == ROUNDS - 1:
                done[row] = Failed(deviation_mm, search.found[row].spans, SearchEnd.NOT_BOUNDED)
            else:
                short[row] = min(0.95, max(0.5, 0.97 * tolerance_mm / deviation_mm))
        if not short:
            break
        search.tighten(short)
    return [done[row] for row in range(len(curves))]
