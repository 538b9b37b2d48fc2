"""What stands at the edge of the part after passes that roll over it, measured on what the virtual mill cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dnc.profile import profile_path
from dnc.shipped import shipped_path
from planner.plan import plan_job
from planner.post.written import ControlLimits
from planner.surface.patch import NurbsPatch
from sim.deviation import Verdict, judge
from sim.mill import rehearse
from sim.nominal import load_nominal
from sim.profile import load_mill_profile
from sim.tool import tool_of
from tests.planner.surfaces import thesis_patch, wavy_patch
from tests.system.test_steep_surface import surface_text


def cut(folder: Path, patch: NurbsPatch, edge: str, blocks: str) -> tuple[Verdict, dict[str, object]]:
    """The verdict on the thesis job over this patch, and the plan's report."""
    job = shipped_path("jobs", "thesis").read_text()
    for old, new in (("../surfaces/thesis.toml", "surface.toml"), ('edge = "to-border"', f'edge = "{edge}"')):
        assert old in job
        job = job.replace(old, new)
    (folder / "job.toml").write_text(job)
    (folder / "surface.toml").write_text(surface_text(patch))
    planned = plan_job(folder / "job.toml", ControlLimits(), post={"blocks": blocks})
    recording = rehearse(planned.program, load_mill_profile(profile_path("sinumerik-840d")))
    assert not recording.alarms
    nominal = load_nominal(folder / "job.toml")
    way = recording.travelled
    verdict = judge(nominal, tool_of(nominal.cutter), way, reference=nominal.reference, probe_pitch_mm=0.5)
    return verdict, planned.report


def left_beside_mm(verdict: Verdict, patch: NurbsPatch, out_mm: float) -> np.ndarray:
    """Heights (k,) of what stands `out_mm` outside the edge over the edge itself, along the tool axis."""
    share = np.linspace(0, 1, 200)
    ends = np.zeros_like(share)
    sides = [(share, ends), (share, ends + 1), (ends, share), (ends + 1, share)]
    heights = []
    for side in sides:
        edge = patch.evaluate(*side).point.T
        along = np.gradient(edge[:, :2], axis=0)
        out = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
        out *= np.sign(((edge[:, :2] - patch.control_points[..., :2].mean(axis=(0, 1))) * out).sum(axis=1))[:, None]
        beside = edge + np.pad(out_mm * out, ((0, 0), (0, 1)))
        heights.append(verdict.probes.measure(beside, np.tile([0.0, 0.0, 1.0], (len(edge), 1))).height_mm)
    return np.concatenate(heights)


@pytest.mark.system
@pytest.mark.parametrize("blocks", ["poly", "bspline", "linear", "arcs"])
def test_no_ridge_is_left_at_the_edge_of_the_thesis_part(tmp_path: Path, blocks: str) -> None:
    """(4.2) On the edge and up to 0.7 mm outside it nothing stands higher than a scallop; a ridge stays without."""
    verdict, report = cut(tmp_path, thesis_patch(), "roll-over", blocks)
    assert verdict.coverage == 1.0
    assert verdict.scallop_mm <= 0.08
    assert verdict.gouge_mm <= 0.001
    assert report["path_deviation_mm"] <= 0.001
    for out_mm in (0.0, 0.1, 0.3, 0.7):
        assert left_beside_mm(verdict, thesis_patch(), out_mm).max() <= 0.09
    if blocks == "poly":
        before, _ = cut(tmp_path, thesis_patch(), "to-border", blocks)
        assert left_beside_mm(before, thesis_patch(), 0.7).max() > 0.2


@pytest.mark.system
def test_no_ridge_is_left_at_the_edge_of_a_wavy_part(tmp_path: Path) -> None:
    """(4.2)"""
    patch = wavy_patch(1, size_mm=30.0, height_mm=0.4)
    verdict, _ = cut(tmp_path, patch, "roll-over", "poly")
    assert verdict.coverage == 1.0
    assert verdict.scallop_mm <= 0.08
    assert verdict.gouge_mm <= 0.001
    for out_mm in (0.0, 0.1, 0.3, 0.7):
        assert left_beside_mm(verdict, patch, out_mm).max() <= 0.09
