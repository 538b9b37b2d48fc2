"""What a plan promises on a steep, wavy surface, against what the virtual mill measures of its program."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dnc.cli.main import run_with
from dnc.shipped import shipped_path
from planner.plan import plan_job
from planner.post.written import ControlLimits
from planner.surface.patch import NurbsPatch
from tests.planner.surfaces import wavy_patch


def rows(values: list[object]) -> str:
    """Numbers or nested lists of numbers as TOML."""
    return json.dumps(values)


def surface_text(patch: NurbsPatch) -> str:
    return (
        f"degree = [{patch.degree_u}, {patch.degree_v}]\nknots_u = {rows(patch.knots_u.tolist())}\n"
        f"knots_v = {rows(patch.knots_v.tolist())}\ncontrol_points = {rows(patch.control_points.tolist())}\n"
    )


@pytest.mark.system
def test_the_mill_measures_no_deeper_gouge_than_the_plan_reports(tmp_path: Path) -> None:
    """(4.3) At 0.5 um on a steep 9 x 9 bicubic; straight moves once gouged 1.34 um there."""
    job = shipped_path("jobs", "thesis").read_text()
    for old, new in (
        ("../surfaces/thesis.toml", "steep.toml"),
        ("path_mm = 0.001", "path_mm = 0.0005"),
        ("scallop_mm = 0.08", "pick_feed_mm = 3.0"),
    ):
        assert old in job
        job = job.replace(old, new)
    (tmp_path / "job.toml").write_text(job)
    (tmp_path / "steep.toml").write_text(surface_text(wavy_patch(1, size_mm=30.0, height_mm=0.4)))
    planned = plan_job(tmp_path / "job.toml", ControlLimits(), post={"blocks": "linear"})
    part, measured = tmp_path / "part.mpf", tmp_path / "measured.json"
    part.write_bytes(planned.program)
    options = ["--job", str(tmp_path / "job.toml"), "--report", str(measured), "--pitch", "0.5"]
    assert run_with(["simulate", str(part), *options]) == 0
    assert planned.report["path_deviation_mm"] <= 0.0005
    assert 0.0001 < json.loads(measured.read_text())["gouge_mm"] <= planned.report["gouge_mm"]
