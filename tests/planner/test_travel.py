"""What the axes of the machine reach: the curve of a program decides, not the ends of its blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from planner.errors import InputRejected
from planner.job import load_job
from planner.path.model import ArcChain, DrivingPlane, Method, Pass, ToolPath
from planner.path.moves import corners_of
from planner.path.spans import points_along
from planner.travel import check_program
from tests.planner.jobs import job_in

# An arc through its bottom at -5, a line, an arc over its top at 5, and one that meets neither.
CHAIN = ArcChain(
    np.array([[-4.0, -3.0], [3.0, -4.0], [7.0, 4.0], [14.0, 3.0], [14.8, 1.4]]),
    np.array([[0.0, 0.0], [0.0, 0.0], [10.0, 0.0], [10.0, 0.0]]),
    np.array([1, 0, -1, -1], dtype=np.int8),
)


@pytest.mark.parametrize("chain", [CHAIN, ArcChain(CHAIN.points[::-1], CHAIN.centres[::-1], -CHAIN.turns[::-1])])
def test_an_arc_is_boxed_with_its_bottom_and_top(chain: ArcChain) -> None:
    """Whichever way it runs; the ends of its blocks stand up to 2 mm inside."""
    boxed, along = corners_of(chain), points_along(chain, 200)
    assert boxed.min(axis=0) == pytest.approx(along.min(axis=0), abs=1e-6)
    assert boxed.max(axis=0) == pytest.approx(along.max(axis=0), abs=1e-6)
    assert boxed[:, 1].min() == pytest.approx(-5.0, abs=1e-6)


def test_an_arc_that_bulges_below_the_travel_of_z_is_refused(tmp_path: Path) -> None:
    """(4.7) Z50 down to Z-9, the tip of a ball of 4 mm; the ends of its blocks stop at Z-8."""
    one = Pass(DrivingPlane(0.0, 0.0), CHAIN, 0.0, Method.PROVED, np.zeros((0, 2)), 20.0)
    path = ToolPath((one,), 4.0, np.zeros(0), np.zeros(0), Method.SAMPLED)
    job_path = job_in(tmp_path)
    job = load_job(job_path)
    check_program(job, path, (500.0, 500.0, 59.01), job_path)
    with pytest.raises(InputRejected, match=r"reaches over 59 mm along Z, the machine over 58\.5"):
        check_program(job, path, (500.0, 500.0, 58.5), job_path)
