"""Quintic heights for the search: starts whose spans are equally hard, one more joint, and fits of a batch."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from planner.path.curve import ExactCurve
from planner.path.gauss_newton import improve
from planner.path.height_fit import HeightFit, start_heights, step
from planner.path.height_table import HeightTable
from planner.path.model import Array
from planner.path.plane_spline import Index
from planner.path.span_search import Candidate, Start, halved_where_worst

MOST_FRESH = 400
FEW_SPANS, HASTE = 2, 5
SPREADINGS = 8
EASIEST = 0.02  # of the mean error of a row's spans
_NO_FEET = np.zeros((0, 0))


class HeightFitter:
    """Quintics z(w) that share height, slope and second derivative where they meet, (F18) to (F21)."""

    def __init__(self, curves: Sequence[ExactCurve]) -> None:
        self._table = HeightTable(curves)
        self.count = len(curves)
        self.most_fresh = MOST_FRESH

    def fresh(self, asked: dict[int, int]) -> dict[int, Start]:
        """Joints moved together and apart until interpolation errs alike in every span, (F21)."""
        if not asked:
            return {}
        rows = np.array(list(asked), np.intp)
        shares = [np.linspace(0.0, 1.0, spans + 1) for spans in asked.values()]
        for _ in range(SPREADINGS):
            fit = start_heights(self._table, rows, self._places(rows, shares))
            errors_mm = np.split(np.abs(fit.distance).max(axis=0), fit.index.lasts[:-1] + 1)
            shares = [_spread(one, error) for one, error in zip(shares, errors_mm, strict=True)]
        return {row: Start(one, _NO_FEET) for row, one in zip(asked, shares, strict=True)}

    def is_lost(self, row: int, candidate: Candidate) -> bool:
        """Never: heights cannot fold."""
        del row, candidate
        return False

    def opened(self, candidate: Candidate, more: int = 1) -> Start:
        """The candidate with so many more joints, each in the middle of the span that is worst then."""
        return Start(halved_where_worst(candidate, more), _NO_FEET)

    def fit(self, rows: Index, starts: list[Start], powers: Array, targets_mm: Array) -> list[Candidate]:
        """Gauss-Newton from these starts."""
        fit = start_heights(self._table, rows, self._places(rows, [start.joints for start in starts]))
        stepping = partial(_step_of, self._table, rows)
        # What will not do with one or two spans shows early; with more it takes every step.
        patience = HASTE if max(start.spans for start in starts) <= FEW_SPANS else len(powers)
        fit = improve(fit, stepping, powers=powers, targets_mm=targets_mm, patience=patience)
        return [self._candidate(fit, at, int(row)) for at, row in enumerate(rows)]

    def _places(self, rows: Index, shares: Sequence[Array]) -> list[Array]:
        """Joints in w from their shares of each curve's run, both ends exact."""
        ends = zip(self._table.begins[rows], self._table.ends[rows], strict=True)
        return [(1.0 - share) * begin + share * end for share, (begin, end) in zip(shares, ends, strict=True)]

    def _candidate(self, fit: HeightFit, at: int, row: int) -> Candidate:
        begin, end = self._table.begins[row], self._table.ends[row]
        spans = slice(fit.index.firsts[at], fit.index.lasts[at] + 1)
        start = Start((fit.joints_of(at) - begin) / (end - begin), _NO_FEET)
        return Candidate(start, fit.spline(at), np.abs(fit.distance[:, spans]).max(axis=0))


def _step_of(
    table: HeightTable, rows: Index, live: Index, fit: HeightFit, power: int, damping: Array
) -> tuple[HeightFit, Array]:
    return step(table, rows[live], fit, power, damping)


def _spread(shares: Array, errors_mm: Array) -> Array:
    """Joints (n + 1,) spread anew, as dense as the sixth root of the errors (n,) asks."""
    hard = np.cbrt(np.sqrt(errors_mm + EASIEST * errors_mm.mean() + np.finfo(float).tiny))
    rising = np.zeros(len(shares))
    np.cumsum(hard, out=rising[1:])
    even = np.arange(len(shares)) * (rising[-1] / len(hard))
    spread = np.interp(even, rising, shares)
    spread[[0, -1]] = 0.0, 1.0
    return np.asarray(spread)
