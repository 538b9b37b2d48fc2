"""What the planner sees to by itself: kind of blocks, digits of the ends, angle, clearance of the tip (4.3, 4.4)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from dnc.cli.main import run_with
from planner.errors import InputRejected
from planner.path.gouge import tool_side
from planner.path.strategy.angle import best_angle_rad
from planner.plan import plan_job
from planner.post.written import ControlLimits
from planner.surface.curvature import survey
from planner.surface.patch import NurbsPatch
from tests.planner.jobs import LIMITS, SURFACE, job_in

STEEP = (Path(__file__).parent / "data/ends/short-steep-pass.toml").read_text()
PLATE = """degree = [1, 1]
knots_u = [0, 0, 1, 1]
knots_v = [0, 0, 1, 1]
control_points = [[[0, 0, 0], [40, 0, 0]], [[0, 30, 0], [40, 30, 0]]]
"""


@pytest.mark.parametrize(("path_mm", "surface"), [(0.05, SURFACE), (0.001, PLATE)], ids=["coarse", "plane"])
def test_auto_is_the_smallest_that_the_control_reads(tmp_path: Path, path_mm: float, surface: str) -> None:
    """(4.4) Arcs and straight moves, which every control reads, were never tried."""
    job = job_in(tmp_path, ("path_mm = 0.001", f"path_mm = {path_mm}"), surface=(SURFACE, surface))
    limits = ControlLimits(poly_degree=5)
    sizes = {
        blocks: len(plan_job(job, limits, post={"blocks": blocks}).program)
        for blocks in ("auto", "poly", "arcs", "linear")
    }
    assert sizes["auto"] == min(sizes.values()) < sizes["poly"]


def test_the_ends_of_a_short_steep_pass_take_the_digits_they_need(tmp_path: Path) -> None:
    """(4.3) Passes over a corner, 45 degrees steep: what rounding their ends cost was 1.12 um of the 1 um allowed."""
    changes = [("angle_deg = 0.0", "angle_deg = 45.0"), ("scallop_mm = 0.08", "scallop_mm = 0.02")]
    changes += [("clearance_z_mm = 10.0", "clearance_z_mm = 200.0"), ("safe_z_mm = 50.0", "safe_z_mm = 210.0")]
    planned = plan_job(job_in(tmp_path, *changes, surface=(SURFACE, STEEP)), ControlLimits(poly_degree=5))
    assert planned.report["path_deviation_mm"] <= 0.001
    assert not [warning for warning in planned.warnings if "as written may lie" in warning]


@pytest.mark.parametrize(("clearance", "is_clear"), [("6.9", False), ("7.1", True)])
def test_the_tip_clears_the_part_where_the_centre_is_programmed(
    tmp_path: Path, clearance: str, *, is_clear: bool
) -> None:
    """(4.3) Rapids at a clearance height above the part led the ball's centre there, and the tip through the part."""
    changes = [
        ('reference = "tip"', 'reference = "centre"'),
        ("clearance_z_mm = 10.0", f"clearance_z_mm = {clearance}"),
    ]
    job = job_in(tmp_path, *changes)
    if is_clear:
        assert plan_job(job, LIMITS).program
        return
    with pytest.raises(InputRejected, match=r"job\.toml:\d+: clearance_z_mm 6\.9, with the tip at Z2\.9, is not above"):
        plan_job(job, LIMITS)


@pytest.mark.parametrize(("x_mm", "y_mm", "angle_deg"), [(50.0, 1.0, 0.0), (2.0, 40.0, 90.0)])
def test_where_all_directions_cut_the_same_the_fewest_passes_win(x_mm: float, y_mm: float, angle_deg: float) -> None:
    """(angle_deg = "auto") Over a plane the angle was left to the rounding of the last digit."""
    corners = np.array([[[0.0, 0.0, 0.0], [x_mm, 0.0, 0.0]], [[0.0, y_mm, 0.0], [x_mm, y_mm, 0.0]]])
    patch = NurbsPatch(1, 1, np.array([0.0, 0, 1, 1]), np.array([0.0, 0, 1, 1]), corners)
    found = best_angle_rad(patch, tool_side(survey(patch)), 4.0, 0.02)
    assert np.degrees(found) == pytest.approx(angle_deg)


def test_stock_is_named_where_it_is_to_blame(tmp_path: Path) -> None:
    """(4.7) The ball was said to have a radius of 1004 mm."""
    job = job_in(tmp_path, ('edge = "to-border"', 'edge = "to-border"\nstock_to_leave_mm = 1000.0'))
    with pytest.raises(InputRejected, match=r"job\.toml:\d+: patch 1 has a concave radius .* mm of stock"):
        plan_job(job, LIMITS)


@pytest.mark.parametrize(
    ("decimals", "is_inch", "path_mm"), [(3, False, 0.005), (4, True, 0.005), (2, False, 0.01), (3, True, 0.0254)]
)
def test_a_control_of_few_digits_gets_a_finer_fit_or_flatter_scallops(
    tmp_path: Path, decimals: int, path_mm: float, *, is_inch: bool
) -> None:
    """(4.1, 4.3) What the digits cost was not kept free of the fit: 5.08 um of 5, and scallops of 81 um of 80."""
    job = job_in(tmp_path, ("path_mm = 0.001", f"path_mm = {path_mm}"))
    planned = plan_job(job, ControlLimits(decimals=decimals, is_inch=is_inch, poly_degree=5))
    deviation_mm = planned.report["path_deviation_mm"]
    assert deviation_mm <= path_mm
    assert planned.report["scallop_mm"] + deviation_mm * 4.0 / 3.92 <= 0.08
    assert [warning for warning in planned.warnings if "as written may lie" in warning] == []


@pytest.mark.parametrize(("decimals", "is_inch", "step"), [(2, False, "0.01 mm"), (2, True, "0.254 mm")])
def test_a_path_finer_than_the_digits_of_the_control_is_refused(
    tmp_path: Path, decimals: int, step: str, *, is_inch: bool
) -> None:
    """(4.3, 4.7) It was written with a warning: 10 um off where 5 were asked, half a millimetre in inches."""
    job = job_in(tmp_path, ("path_mm = 0.001", "path_mm = 0.005"))
    with pytest.raises(InputRejected, match=rf"job\.toml:\d+: path_mm 0\.005 is less than {re.escape(step)}, one step"):
        plan_job(job, ControlLimits(decimals=decimals, is_inch=is_inch, poly_degree=5))


def test_a_summit_between_samples_is_seen_from_the_clearance_height(tmp_path: Path) -> None:
    """(4.7) Rapid moves across ran 0.02 mm through the top of a bump that no sample had met."""
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, 22), np.ones(3)])
    places = 120.0 * np.array([knots[i + 1 : i + 4].mean() for i in range(24)])
    x, y = np.meshgrid(places, places, indexing="ij")
    heights = np.zeros((24, 24))
    heights[11, 11:13], heights[12, 12] = (0.5, 1.2), 0.5
    patch = NurbsPatch(3, 3, knots, knots, np.stack([x, y, heights], axis=2))
    u, v = (part.ravel() for part in np.meshgrid(np.linspace(0.4, 0.6, 401), np.linspace(0.4, 0.6, 401)))
    top_mm = float(patch.evaluate(u, v).point[2].max())
    table = f"degree = [3, 3]\nknots_u = {knots.tolist()}\nknots_v = {knots.tolist()}\n"
    changes = [
        ("clearance_z_mm = 10.0", f"clearance_z_mm = {top_mm - 0.005}"),
        ("scallop_mm = 0.08", "pick_feed_mm = 4"),
    ]
    job = job_in(tmp_path, *changes)
    (tmp_path / "surface.toml").write_text(f"{table}control_points = {patch.control_points.tolist()}\n")
    with pytest.raises(InputRejected, match="is not above patch 1"):
        plan_job(job, LIMITS)


@pytest.mark.parametrize("lift", ["-0.5", "-1000"])
def test_a_program_is_lifted_and_never_lowered(lift: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """(4.7) A negative lift took the whole program, rapid moves included, down into the part."""
    words = ["plan", str(job_in(tmp_path)), "-o", str(tmp_path / "part.mpf"), "--lift", lift]
    assert run_with(words) == 2
    assert "--lift" in capsys.readouterr().err
    assert not (tmp_path / "part.mpf").exists()


@pytest.mark.parametrize("key", ["cut_mm_min", "plunge_mm_min"])
def test_a_feed_that_the_digits_of_the_control_turn_into_none_is_refused(key: str, tmp_path: Path) -> None:
    """(4.7) 0.1 mm/min was written as F0 for a control that reads two decimals of an inch."""
    feed = {"cut_mm_min": "250.0", "plunge_mm_min": "100.0"}[key]
    changes = [("scallop_mm = 0.08", "pick_feed_mm = 5.0"), ("path_mm = 0.001", "path_mm = 0.3")]
    job = job_in(tmp_path, (f"{key} = {feed}", f"{key} = 0.1"), *changes)
    with pytest.raises(InputRejected, match=rf"job\.toml:\d+: {key} 0\.1 is F0 in the 2 decimals"):
        plan_job(job, ControlLimits(decimals=2, is_inch=True))
