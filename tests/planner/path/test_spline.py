"""Fitting passes: tolerance kept, few spans, ends exact."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from planner.errors import InputRejected
from planner.path.curve import ExactCurve
from planner.path.model import Method, PlaneSpline
from planner.path.span_search import Candidate, SearchEnd, SpanSearch, Start, halved_where_worst
from planner.path.spline import fit_passes
from planner.path.spline_table import SplineTable
from planner.plan import plan_job
from planner.post.written import ControlLimits
from tests.planner.path.curves import arc, random_graph, wave_pass


def closest_mm(points: np.ndarray, polyline: np.ndarray) -> float:
    """The largest distance of points from a dense polyline, by brute force."""
    start, chord = polyline[:-1], np.diff(polyline, axis=0)
    worst = 0.0
    for point in points:
        gap = point - start
        share = np.clip((gap * chord).sum(axis=1) / (chord**2).sum(axis=1), 0.0, 1.0)
        worst = max(worst, float(np.hypot(*(gap - share[:, None] * chord).T).min()))
    return worst


@pytest.mark.parametrize("tolerance_mm", [0.01, 0.001, 0.00025])
def test_stays_within_tolerance_both_ways(tolerance_mm: float) -> None:
    """(4.3) Dense points of either curve lie within the stated deviation of the other."""
    curves = [random_graph(seed) for seed in range(4)] + [arc(4.0, 0.0, 2.5)]
    for curve, fitted in zip(curves, fit_passes(curves, tolerance_mm), strict=True):
        assert fitted.deviation_mm <= tolerance_mm
        parameters = np.linspace(0.0, fitted.spline.knots[-1], 2001)
        spline = SplineTable([fitted.spline]).evaluate(np.zeros(2001, np.intp), parameters)[0]
        exact = curve.refine(np.linspace(0.0, curve.arc_mm[-1], 2001)).points
        slack_mm = 2e-5
        assert closest_mm(exact[::20], spline) <= fitted.deviation_mm + slack_mm
        assert closest_mm(spline[::20], exact) <= fitted.deviation_mm + slack_mm
        np.testing.assert_allclose(spline[[0, -1]], exact[[0, -1]], atol=1e-9)


def test_wave_needs_few_control_points() -> None:
    """(4.4) A 300 mm pass over the wave at 1 um: at most 22 control points."""
    (fitted,) = fit_passes([wave_pass()], 0.001)
    assert fitted.spans + 3 <= 22


def test_a_long_pass_needs_as_many_for_its_length() -> None:
    """(4.4, 4.5) A cubic with few spans misses whole waves; grown from one, 1200 mm found no spline at all."""
    (fitted,) = fit_passes([wave_pass(length_mm=1200.0)], 0.001)
    assert fitted.spans <= 4 * 22


def test_no_spline_turns_back_along_its_pass() -> None:
    """(4.3, 4.4) Two of these passes lay within 7.5 um of cubics that ran backwards by 0.17 and 0.3 mm."""
    job = Path(__file__).parents[1] / "data" / "turning-back-job.toml"
    planned = plan_job(job, ControlLimits(poly_degree=5), post={"blocks": "poly"})
    shapes = [one.shape for one in planned.tool_path.passes]
    splines = [shape for shape in shapes if isinstance(shape, PlaneSpline)]
    assert len(splines) > 50
    assert max(np.ptp(spline.control_points[:, 0]) for spline in splines) > 1.0
    for spline in splines:
        places = np.linspace(spline.knots[0], spline.knots[-1], 2001)
        w = SplineTable([spline]).evaluate(np.zeros(2001, np.intp), places)[0][:, 0]
        assert (np.diff(w) > 0.0).all() or (np.diff(w) < 0.0).all()


class _Stubborn:
    """A fitter whose first span stays as bad as it is, however narrow."""

    count, most_fresh = 1, 2

    def fresh(self, asked: dict[int, int]) -> dict[int, Start]:
        return {row: Start(np.linspace(0.0, 1.0, spans + 1), np.zeros((1, spans))) for row, spans in asked.items()}

    def is_lost(self, row: int, candidate: Candidate) -> bool:
        return False

    def opened(self, candidate: Candidate, more: int = 1) -> Start:
        joints = halved_where_worst(candidate, more)
        return Start(joints, np.zeros((1, len(joints) - 1)))

    def fit(self, rows: np.ndarray, starts: list[Start], powers: np.ndarray, targets_mm: np.ndarray) -> list[Candidate]:
        spline = PlaneSpline(1, np.array([0.0, 0.0, 1.0, 1.0]), np.zeros((2, 2)))
        return [Candidate(start, spline, np.eye(start.spans)[0]) for start in starts]


def test_a_span_that_halving_does_not_mend_ends_the_search() -> None:
    """(4.7) Halved on and on it had no width any more, an internal fault."""
    search = SpanSearch(_Stubborn(), 0.001, 400)
    search.from_scratch({0: 1})
    assert search.ends[0] is SearchEnd.TOO_MANY_SPANS
    assert 20 < search.found[0].spans < 40


class _Hard(_Stubborn):
    """A fitter that is content with one number of spans and counts what it is asked."""

    def __init__(self, needed: int, most_fresh: int) -> None:
        self.needed, self.most_fresh, self.asked = needed, most_fresh, 0

    def opened(self, candidate: Candidate, more: int = 1) -> Start:
        return self.fresh({0: candidate.spans + more})[0]

    def fit(self, rows: np.ndarray, starts: list[Start], powers: np.ndarray, targets_mm: np.ndarray) -> list[Candidate]:
        self.asked += len(starts)
        spline = PlaneSpline(1, np.array([0.0, 0.0, 1.0, 1.0]), np.zeros((2, 2)))
        errors = [0.001 * (self.needed / start.spans) ** 6 for start in starts]
        return [
            Candidate(start, spline, np.full(start.spans, error)) for start, error in zip(starts, errors, strict=True)
        ]


@pytest.mark.parametrize("most_fresh", [6, 4000])
@pytest.mark.parametrize("needed", [1, 7, 60, 800])
def test_many_spans_take_few_trials(needed: int, most_fresh: int) -> None:
    """(4.5) Each trial costs as much as it has spans, so as many trials as spans made long passes dear."""
    fitter = _Hard(needed, most_fresh)
    search = SpanSearch(fitter, 0.001, 4000)
    search.from_scratch({0: 1})
    assert (search.found[0].spans, search.ends[0]) == (needed, SearchEnd.FITTED)
    assert fitter.asked <= 10 + 40 * np.log10(needed)


def test_a_pass_without_a_bound_is_refused_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    """(4.7) It was told to be "inf um off"."""

    def unbounded(curves: Sequence[ExactCurve], *_: object) -> list[tuple[float, Method]]:
        return [(float("inf"), Method.SAMPLED)] * len(curves)

    monkeypatch.setattr("planner.path.spline.certify_all", unbounded)
    with pytest.raises(InputRejected, match=r"^pass 1 is not known to be near at \d+ spans: more spans do not bring"):
        fit_passes([random_graph(0)], 0.001)
