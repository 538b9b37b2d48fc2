"""The mill sees only bytes and the surface file: a lie in the program appears in what it measures, in place (1.7)."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from dnc.planning import limits_of
from dnc.profile import load_profile, profile_path
from dnc.shipped import shipped_path
from planner.path.model import Pass, PlaneSpline
from planner.plan import Planned, plan_job
from planner.surface.load import load_surface
from tests.helpers.mill import MillProcess

JOB = shipped_path("jobs", "thesis")
RADIUS_MM = 4.0
LIE_MM = 0.020


@pytest.fixture(scope="module")
def planned() -> Planned:
    return plan_job(JOB, limits_of(load_profile(profile_path("sinumerik-840d"))))


def cut(program: bytes, folder: Path) -> dict[str, Any]:
    """The mill's report after the program came through the line, by `dnc send`."""
    part, sent = folder / "part.mpf", folder / "send.json"
    part.write_bytes(program)
    with MillProcess(folder, "--speed", "200", "--nominal", JOB, "--probe-pitch", "0.2") as mill:
        words = ["send", part, "--port", mill.ready["pty"], "--baud", mill.ready["effective_baud"], "--report", sent]
        subprocess.run([sys.executable, "-m", "dnc", *map(str, words)], check=True, capture_output=True)
        assert mill.end(120.0) == 0
    assert json.loads(sent.read_text())["sha256"] == mill.report["sha256"] == hashlib.sha256(program).hexdigest()
    return mill.report


@pytest.mark.system
def test_a_block_lowered_by_20_um_is_a_gouge_there(planned: Planned, tmp_path: Path) -> None:
    lines = planned.program.decode().split("\n")
    at = next(
        number
        for number, text in enumerate(lines)
        if number > 60 and text.startswith("POLY") and "PO[Z]" in lines[number + 1]
    )
    found = re.search(r"PO\[Z\]=\(([^,]+)", lines[at])
    assert found is not None
    lines[at] = lines[at].replace(found[0], f"PO[Z]=({float(found[1]) - LIE_MM:.5f}")
    report = cut("\n".join(lines).encode(), tmp_path)
    joint = np.array([word_of(lines, at, "X"), last_y(lines, at), float(found[1]) + RADIUS_MM])
    normal, contact = touch(joint)
    worst = report["worst_gouges"][0]
    assert report["gouge_mm"] == pytest.approx(LIE_MM * normal[2], abs=0.001)
    assert np.linalg.norm(np.array(worst["position_mm"]) - contact) < 0.3
    assert worst["line"] in (at + 1, at + 2)


@pytest.mark.system
def test_a_deleted_pass_is_a_ridge_there(planned: Planned, tmp_path: Path) -> None:
    lines = planned.program.decode().split("\n")
    gone = 15
    start = next(number for number, text in enumerate(lines) if text.startswith(f"N{gone + 1}G0"))
    stop = next(number for number, text in enumerate(lines) if text.startswith(f"N{gone + 2}G0"))
    report = cut("\n".join(lines[:start] + lines[stop:]).encode(), tmp_path)
    worst = report["worst_scallops"][0]
    place = np.array(worst["position_mm"])
    passes = planned.tool_path.passes
    neighbours = np.concatenate([centres(passes[gone - 1]), centres(passes[gone + 1])])
    expected_mm = highest_near(worst["uv"], neighbours)
    assert report["scallop_mm"] == pytest.approx(expected_mm, abs=0.001)
    assert passes[gone - 1].plane.offset_mm < place[1] < passes[gone + 1].plane.offset_mm


def centres(one: Pass, count: int = 20_001) -> NDArray[np.float64]:
    """Ball centres (count, 3) along a pass, a few micrometres apart."""
    assert isinstance(one.shape, PlaneSpline)
    knots = one.shape.knots
    curve = BSpline(knots, one.shape.control_points, one.shape.degree)
    return one.plane.to_work(curve(np.linspace(knots[0], knots[-1], count)))


def highest_near(uv: tuple[float, float], balls: NDArray[np.float64], reach: float = 0.01) -> float:
    """The highest ridge that balls at these centres leave near a place: brute force, finer and finer nets."""
    (patch,) = load_surface(shipped_path("surfaces", "thesis"))
    middle = np.array(uv)
    best_mm = -np.inf
    for _ in range(4):
        u, v = (np.clip(axis + np.linspace(-reach, reach, 21), 0.0, 1.0) for axis in middle)
        for one_u in u:
            found = patch.evaluate(np.full(21, one_u), v)
            normal = np.cross(found.du.T, found.dv.T)
            normal /= np.linalg.norm(normal, axis=1)[:, None]
            normal *= np.sign(normal[:, 2])[:, None]
            for point, up, one_v in zip(found.point.T, normal, v, strict=True):
                toward = balls - point
                along = toward @ up
                inside = RADIUS_MM**2 - (toward**2).sum(axis=1) + along**2
                height_mm = (along - np.sqrt(np.maximum(inside, 0.0)))[inside > 0].min()
                if height_mm > best_mm:
                    best_mm, middle = height_mm, np.array([one_u, one_v])
        reach /= 4.0
    return float(best_mm)


def touch(centre: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Normal and contact point of a ball whose centre stands here, by Newton's method on the offset surface."""
    (patch,) = load_surface(shipped_path("surfaces", "thesis"))
    u, v = np.array([0.5]), np.array([0.5])
    for _ in range(50):
        found = patch.evaluate(u, v)
        normal = np.cross(found.du[:, 0], found.dv[:, 0])
        normal /= np.linalg.norm(normal) * np.sign(normal[2])
        short = centre - RADIUS_MM * normal - found.point[:, 0]
        step = np.linalg.lstsq(np.stack([found.du[:, 0], found.dv[:, 0]], axis=1), short, rcond=None)[0]
        u, v = u + 0.8 * step[0], v + 0.8 * step[1]
    return normal, found.point[:, 0]


def word_of(lines: list[str], at: int, axis: str) -> float:
    """The end coordinate of a POLY block, of an axis with a polynomial or of one that runs evenly."""
    found = re.search(rf"(?:PO\[{axis}\]=\(|{axis})(-?[\d.]+)", lines[at])
    assert found is not None
    return float(found[1])


def last_y(lines: list[str], at: int) -> float:
    """Where Y was left by the approach of this pass."""
    found = next(match for text in reversed(lines[:at]) if (match := re.search(r"Y(-?[\d.]+)", text)))
    return float(found[1])
