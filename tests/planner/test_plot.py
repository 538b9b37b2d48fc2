"""The picture of a plan where a gap has no cusp on the part (4.9)."""

from __future__ import annotations

from pathlib import Path

import pytest

from planner.plan import plan_job
from planner.plot import draw_plan, worst_gap
from planner.post.written import ControlLimits
from tests.planner.jobs import SURFACE, job_in

ROLLING = ('edge = "to-border"', 'edge = "roll-over"')
PLATE = """degree = [1, 1]
knots_u = [0, 0, 1, 1]
knots_v = [0, 0, 1, 1]
control_points = [[[0, 0, 0], [40, 0, 0]], [[0, WIDE, 0], [40, WIDE, 0]]]
"""


@pytest.mark.parametrize("height", ["scallop_mm = 0.08", "pick_feed_mm = 2.0"])
def test_a_strip_between_passes_that_roll_over_it_is_drawn(height: str, tmp_path: Path) -> None:
    """(4.7) There is no cusp on it: the picture ended as an internal fault."""
    job = job_in(tmp_path, ROLLING, ("scallop_mm = 0.08", height), surface=(SURFACE, PLATE.replace("WIDE", "0.3")))
    assert draw_plan(plan_job(job, ControlLimits())).startswith(b"\x89PNG")


def test_the_worst_gap_is_one_that_has_a_cusp(tmp_path: Path) -> None:
    """(4.9) A gap beside the part, for which only a bound is known, was drawn as the worst."""
    planned = plan_job(job_in(tmp_path, ROLLING, surface=(SURFACE, PLATE.replace("WIDE", "9"))), ControlLimits())
    peaks, gap = planned.layout.peaks, worst_gap(planned)
    assert peaks.by_b[gap] > 0
    assert peaks.height_mm[gap] == pytest.approx(peaks.height_mm.max(), abs=1e-6)
