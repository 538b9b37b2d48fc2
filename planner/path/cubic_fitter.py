"""Free cubics for the search: starts with crowded knots, one more knot, and fits of a batch."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from planner.path.curve import CurveTable, ExactCurve
from planner.path.free_fit import PLACES, Fit, places_in, start_fit, step
from planner.path.gauss_newton import improve
from planner.path.model import Array, PlaneSpline
from planner.path.plane_spline import Index
from planner.path.span_search import Candidate, Start, halved_where_worst
from planner.path.spans import folds_mm

MOST_FRESH = 6
HASTE = 5
LOST = 0.02  # of the mean length of a span


class CubicFitter:
    """Cubic B-splines with free parametrisation, (F5) to (F9); feet are arc lengths."""

    def __init__(self, curves: Sequence[ExactCurve]) -> None:
        self._table = CurveTable(curves)
        self.count = len(curves)
        self.most_fresh = MOST_FRESH
        self._rises = [bool(curve.tangents[:, 0].min() > 0.0) for curve in curves]

    def fresh(self, asked: dict[int, int]) -> dict[int, Start]:
        """Knots crowded where the curvature changes, the arc length as parameter."""
        return {row: self._crowded(row, spans) for row, spans in asked.items()}

    def _crowded(self, row: int, spans: int) -> Start:
        joints = self._table.places([row], spans + 1)[0] / self._table.lengths_mm[row]
        return Start(joints, _places(joints))

    def is_lost(self, row: int, candidate: Candidate) -> bool:
        """Whether it is off by a good part of its spans' length: it misses whole waves or turns back."""
        return candidate.error_mm * candidate.spans > LOST * float(self._table.lengths_mm[row])

    def opened(self, candidate: Candidate, more: int = 1) -> Start:
        """The candidate's parametrisation with more knots, each in the middle of the span that is worst then."""
        joints = halved_where_worst(candidate, more)
        before = _places(candidate.start.joints).T.ravel()
        feet = np.interp(_places(joints).T.ravel(), before, candidate.start.feet.T.ravel())
        return Start(joints, feet.reshape(-1, PLACES).T)

    def fit(self, rows: Index, starts: list[Start], powers: Array, targets_mm: Array) -> list[Candidate]:
        """Gauss-Newton from these starts."""
        lengths_mm = self._table.lengths_mm[rows]
        knots = [_clamped(start.joints) * length for start, length in zip(starts, lengths_mm, strict=True)]
        feet = [start.feet * length for start, length in zip(starts, lengths_mm, strict=True)]
        fit = start_fit(self._table, rows, knots, np.concatenate(feet, axis=1))
        stepping = partial(_step_of, self._table, rows)
        # What will not do with few spans shows early; with many it takes every step.
        patience = HASTE if max(start.spans for start in starts) <= MOST_FRESH else len(powers)
        fit = improve(fit, stepping, powers=powers, targets_mm=targets_mm, patience=patience)
        found = [_candidate(fit, at) for at in range(len(rows))]
        return [_unfolded(one) if self._rises[row] else one for row, one in zip(rows, found, strict=True)]


def _step_of(table: CurveTable, rows: Index, live: Index, fit: Fit, power: int, damping: Array) -> tuple[Fit, Array]:
    return step(table, rows[live], fit, power, damping)


def _clamped(joints: Array) -> Array:
    return np.concatenate([np.repeat(joints[:1], 3), joints, np.repeat(joints[-1:], 3)])


def _places(joints: Array) -> Array:
    """The places (k, spans) of one spline between its joints."""
    return places_in(np.lib.stride_tricks.sliding_window_view(_clamped(joints)[1:-1], 6).T)


def _candidate(fit: Fit, at: int) -> Candidate:
    knots, control_points = fit.spline(at)
    spans = slice(fit.index.firsts[at], fit.index.lasts[at] + 1)
    start = Start(knots[3:-3] / knots[-1], fit.arcs[:, spans] / knots[-1])
    return Candidate(start, PlaneSpline(3, knots, control_points), np.abs(fit.distance[:, spans]).max(axis=0))


def _unfolded(candidate: Candidate) -> Candidate:
    """The candidate, with what it runs backwards counted tenfold as error, and then no parametrisation to go on from.

    A spline that turns back may lie close to its pass and still cut a place three times.
    """
    if (np.diff(candidate.spline.control_points[:, 0]) >= 0.0).all():
        return candidate
    folds = folds_mm(candidate.spline)
    if not folds.any():
        return candidate
    start = Start(candidate.start.joints, _places(candidate.start.joints))
    return Candidate(start, candidate.spline, np.maximum(candidate.errors_mm, 10.0 * folds))
