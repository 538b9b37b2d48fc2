"""The fewest spans for each of many neighbouring curves: a few are searched from scratch, the others follow them.

Passes side by side are nearly the same curve, so a pass starts from the joints and the parametrisation of passes
already fitted on either side. What kind of spline it is, only the fitter knows. The order is fixed by the number of
passes alone, so the result is, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from planner.path.model import Array, PlaneSpline
from planner.path.plane_spline import Index

SEEDS = 10
SPANS_AT_ONCE = 2000
SPANS_A_STEP = 24  # for one more in each step of the search
EXTRA_KNOTS = 4
ASTRAY = 4.0  # times the error of a spline with fewer spans
HALVED = 1 / 16  # of a span's error that each half has left
NARROWEST_SHARE = 1e-7  # of the curve
FROM_SCRATCH = np.concatenate([np.full(10, 2.0), np.linspace(2.0, 10.0, 20)])
FROM_NEIGHBOUR = np.array([2.0, 2.0, 3.0, 4.0, 6.0, 8.0, 8.0, 8.0])


class SearchEnd(Enum):
    """How the search for one pass ended; the value is the sentence for the user."""

    FITTED = "the spline keeps its tolerance"
    NOT_BOUNDED = "more spans do not bring its bound below the tolerance"
    TOO_MANY_SPANS = "no spline with the largest number of spans tried keeps the tolerance"


@dataclass(frozen=True, slots=True)
class Start:
    """Where an iteration starts: `joints` (spans + 1,) and `feet` (k, spans) of the places, as shares of the curve."""

    joints: Array
    feet: Array

    @property
    def spans(self) -> int:
        """Number of spans."""
        return self.joints.size - 1


@dataclass(frozen=True, slots=True)
class Candidate:
    """One spline for one curve, and where an iteration would start that begins with it.

    `errors_mm` (spans,) are the largest distances at the places of each span, `error_mm` the largest of all.
    """

    start: Start
    spline: PlaneSpline
    errors_mm: Array

    @property
    def error_mm(self) -> float:
        """The largest distance at the places."""
        return float(self.errors_mm.max())

    @property
    def spans(self) -> int:
        """Number of spans."""
        return self.start.spans


class Fitter(Protocol):
    """One kind of spline for a table of curves."""

    @property
    def count(self) -> int:
        """How many curves there are."""

    def fresh(self, asked: dict[int, int]) -> dict[int, Start]:
        """For these curves, starts with so many spans that know nothing but the curve."""

    @property
    def most_fresh(self) -> int:
        """Up to how many spans a fresh start finds what can be found; beyond it, one grown from fewer spans does."""

    def is_lost(self, row: int, candidate: Candidate) -> bool:
        """Whether the candidate is so far off that it is no start for more spans."""

    def opened(self, candidate: Candidate, more: int = 1) -> Start:
        """The candidate with so many more joints, each in the middle of the span that is worst then."""

    def fit(self, rows: Index, starts: list[Start], powers: Array, targets_mm: Array) -> list[Candidate]:
        """Iterate from these starts, until the targets (p,) are reached."""


class SpanSearch:
    """The search over all curves of a fitter for one tolerance; `found` has a candidate for every curve done."""

    def __init__(self, fitter: Fitter, tolerance_mm: float, most_spans: int) -> None:
        self._fitter, self._most_spans = fitter, most_spans
        self._aims_mm = np.full(fitter.count, tolerance_mm)
        self.found: dict[int, Candidate] = {}
        self.ends: dict[int, SearchEnd] = {}

    def run(self) -> None:
        """Search every curve: seeds first, then the curves half-way between those done, until none is left."""
        count = self._fitter.count
        stride = 1
        while count // (2 * stride) >= SEEDS:
            stride *= 2
        self.from_scratch(dict.fromkeys(range(0, count, stride), 1))
        while stride > 1:
            stride //= 2
            self._follow([row for row in range(0, count, stride) if row not in self.found])
        self._share()

    def from_scratch(self, asked: dict[int, int]) -> None:
        """Rising numbers of spans from those asked, until the tolerance is kept, and then numbers that were skipped.

        Small numbers start from the curve alone; larger ones grow from the best that had too few, so that one
        iteration gone astray does not lead the next.
        """
        tried = {row: spans - 1 for row, spans in asked.items()}
        best: dict[int, Candidate] = {}
        trial = self._fitter.fresh(asked)
        while trial:
            wanted: dict[int, int] = {}
            for row, candidate in self._fit(trial, FROM_SCRATCH).items():
                if not self._keeps_aim(row, candidate):
                    tried[row] = candidate.spans
                    if row not in best or candidate.error_mm < ASTRAY * best[row].error_mm:
                        best[row] = candidate
                if not self._accept(row, candidate):
                    if self._is_at_end(candidate):
                        self.found[row], self.ends[row] = candidate, SearchEnd.TOO_MANY_SPANS
                    else:
                        wanted[row] = self._more(row, candidate)
                elif tried[row] < self.found[row].spans - 1:
                    wanted[row] = (tried[row] + self.found[row].spans) // 2
            grown = [row for row in wanted if row in best and not self._is_fresh(row, best[row], wanted[row])]
            trial = self._fitter.fresh({row: spans for row, spans in wanted.items() if row not in grown})
            trial |= {row: self._fitter.opened(best[row], wanted[row] - best[row].spans) for row in grown}

    def tighten(self, shares: dict[int, float]) -> None:
        """Search these curves again for a smaller error at the nodes, with the same spans or with more."""
        before = {row: self.found.pop(row) for row in shares}
        for row, share in shares.items():
            self._aims_mm[row] *= share
        got = self._fit({row: candidate.start for row, candidate in before.items()}, FROM_NEIGHBOUR)
        self._lengthen({row: candidate for row, candidate in got.items() if not self._accept(row, candidate)})

    def _more(self, row: int, candidate: Candidate) -> int:
        """The next number of spans: most of the way to the sixth-order guess, so as not to miss the fewest."""
        spans = candidate.spans
        least = spans + max(1, spans // SPANS_A_STEP)
        if spans >= self._fitter.most_fresh:
            lost = spans + spans // 4
            return min(lost if self._fitter.is_lost(row, candidate) else least, self._most_spans)
        guess = spans * (candidate.error_mm / self._aims_mm[row]) ** (1 / 6)
        most = min(4 * spans, self._fitter.most_fresh, self._most_spans)
        return int(min(max(least, spans + 0.7 * (guess - spans)), most))

    def _is_fresh(self, row: int, best: Candidate, spans: int) -> bool:
        """Whether so many spans are to start from the curve alone."""
        return spans <= self._fitter.most_fresh or self._fitter.is_lost(row, best)

    def _follow(self, rows: Sequence[int]) -> None:
        """Start each curve from its fitted neighbours; where that fails, add knots."""
        got = self._fit({row: self._between(row) for row in rows}, FROM_NEIGHBOUR)
        self._lengthen({row: candidate for row, candidate in got.items() if not self._accept(row, candidate)})

    def _share(self) -> None:
        """Let a curve with many more spans than a neighbour try that neighbour's, once up and once down the rows."""
        count = self._fitter.count
        for ahead in (1, -1):
            starts = {}
            for row in range(max(0, -ahead), count - max(0, ahead)):
                mine, other = self.found[row], self.found[row + ahead]
                if other.spans + 1 < mine.spans and self.ends[row + ahead] is SearchEnd.FITTED:
                    starts[row] = self._fitter.opened(other)
            for row, candidate in self._fit(starts, FROM_SCRATCH).items():
                self._accept(row, candidate)

    def _lengthen(self, short: dict[int, Candidate]) -> None:
        """Add a knot where each is worst, a few times; what still fails is searched from scratch."""
        for _ in range(EXTRA_KNOTS):
            opened = {row: self._fitter.opened(one) for row, one in short.items() if not self._is_at_end(one)}
            got = short | self._fit(opened, FROM_NEIGHBOUR)
            short = {row: candidate for row, candidate in got.items() if not self._accept(row, candidate)}
        self.from_scratch({row: candidate.spans for row, candidate in short.items()})

    def _is_at_end(self, candidate: Candidate) -> bool:
        """Whether it has as many spans as it may, or one so narrow that halving it again says nothing of the curve."""
        return candidate.spans >= self._most_spans or bool(np.diff(candidate.start.joints).min() < NARROWEST_SHARE)

    def _accept(self, row: int, candidate: Candidate) -> bool:
        if self._keeps_aim(row, candidate):
            self._keep(row, candidate)
        return row in self.found

    def _keeps_aim(self, row: int, candidate: Candidate) -> bool:
        return candidate.error_mm <= float(self._aims_mm[row])

    def _keep(self, row: int, candidate: Candidate) -> None:
        if row not in self.found or candidate.spans < self.found[row].spans:
            self.found[row], self.ends[row] = candidate, SearchEnd.FITTED

    def _between(self, row: int) -> Start:
        """A start from the nearest fitted curves before and after: their mean if they have as many spans."""
        before = next((other for other in range(row - 1, -1, -1) if other in self.found), None)
        after = next((other for other in range(row + 1, self._fitter.count) if other in self.found), None)
        sides = [self.found[other].start for other in (before, after) if other is not None]
        fewest = min(side.spans for side in sides)
        sides = [side for side in sides if side.spans == fewest]
        joints = np.mean([side.joints for side in sides], axis=0)
        return Start(joints, np.mean([side.feet for side in sides], axis=0))

    def _fit(self, starts: dict[int, Start], powers: Array) -> dict[int, Candidate]:
        """Iterate all starts, in batches of about the same number of spans."""
        if not starts:
            return {}
        rows = np.array(sorted(starts, key=lambda row: (starts[row].spans, row)), np.intp)
        total = np.cumsum([starts[row].spans for row in rows])
        done: dict[int, Candidate] = {}
        for batch in np.split(rows, np.flatnonzero(np.diff(total // SPANS_AT_ONCE)) + 1):
            got = self._fitter.fit(batch, [starts[row] for row in batch], powers, self._aims_mm[batch])
            done.update(zip(batch.tolist(), got, strict=True))
        return done


def halved_where_worst(candidate: Candidate, more: int) -> Array:
    """The joints with so many more, each in the middle of the span that is worst then."""
    joints, errors_mm = candidate.start.joints, candidate.errors_mm
    for _ in range(more):
        at = int(errors_mm.argmax())
        joints = np.insert(joints, at + 1, 0.5 * (joints[at] + joints[at + 1]))
        errors_mm = np.insert(errors_mm, at, errors_mm[at])
        errors_mm[at : at + 2] *= HALVED
    return joints
