"""The setup sheet: what it says, that nothing comes from outside, and what Chromium makes of it."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from planner.plan import plan_job
from planner.post.written import ControlLimits
from planner.sheet import SheetFacts, SheetTool, plan_sheet, render_sheet

THESIS = Path(__file__).parents[2] / "configs/jobs/thesis.toml"


def facts(**changes: object) -> SheetFacts:
    known: dict[str, object] = {
        "title": "5000",
        "sha256": "ab" * 32,
        "reference": "tip",
        "work_offset": "G54",
        "origin": "corner <left> & front",
        "tools": (SheetTool(2, "ball, diameter 8 mm", "at least 60 mm"),),
        "stock_box_mm": (np.array([0.0, 0, -20]), np.array([52.0, 52, 4])),
        "low_mm": np.array([0.0, 1.5, -1.25]),
        "high_mm": np.array([50.0, 49.0, 2.5]),
        "cutting_s": 378.0,
        "air_s": 88.4,
        "rows": (("Spindle", "1000 rpm"),),
        "warnings": ("mind the clamp",),
        "lines": [np.array([[0.0, 1.5, 2.0], [50.0, 1.5, -1.25]]), np.array([[50.0, 49.0, 2.5], [0.0, 49.0, 1.0]])],
    }
    return SheetFacts(**{**known, **changes})  # type: ignore[arg-type]


def test_everything_a_setter_needs_is_said() -> None:
    """Extents, lowest Z, tools and stick-out, zero point, stock, both times (2.6)."""
    page = render_sheet(facts())
    for words in ("0.000 to 50.000 mm", "-1.250 mm", "at least 60 mm", "0:06:18", "0:01:28", "mind the clamp", "G54"):
        assert words in page, words
    assert "0 to 52 x 0 to 52 x -20 to 4 mm" in page


def test_the_pictures_say_what_their_marks_are() -> None:
    """(2.6) A green dot had no meaning, and the side view showed three cuts without saying so."""
    page = render_sheet(facts())
    for words in ("Y up", "zero point (red)", "where the cut begins (green)", "the first, the middle and the last cut"):
        assert words in page, words


@pytest.mark.parametrize("edge", ["roll-over", "to-border"])
def test_who_clamps_hears_of_a_ball_that_goes_down_beside_the_part(edge: str, tmp_path: Path) -> None:
    """(2.6) Over the edge the tip goes outside the part and below its border."""
    job = THESIS.read_text().replace("../surfaces", str(THESIS.parents[1] / "surfaces"))
    (tmp_path / "job.toml").write_text(job.replace('edge = "to-border"', f'edge = "{edge}"'))
    page = plan_sheet(plan_job(tmp_path / "job.toml", ControlLimits()))
    assert ("keep clamps clear of that strip" in page) == (edge == "roll-over")


HOLLOW = """degree = [2, 1]
knots_u = [0, 0, 0, 1, 1, 1]
knots_v = [0, 0, 1, 1]
control_points = [[[-24, 0, -18], [-24, 20, -18]], [[0, 0, -50], [0, 20, -50]], [[24, 0, -18], [24, 20, -18]]]
weights = [[1, 1], [0.6, 0.6], [1, 1]]
"""


@pytest.mark.parametrize("blocks", ["arcs", "poly", "linear"])
def test_the_lowest_z_is_that_of_the_curve(tmp_path: Path, blocks: str) -> None:
    """(2.6) A trough of radius 30 about X0 Z0 is cut down to Z-30; the ends of its arcs are 8 mm higher."""
    (tmp_path / "surface.toml").write_text(HOLLOW)
    job = THESIS.read_text().replace("../surfaces/thesis.toml", "surface.toml")
    (tmp_path / "job.toml").write_text(job)
    planned = plan_job(tmp_path / "job.toml", ControlLimits(), post={"blocks": blocks})
    lowest = re.search(r"Lowest Z</th><td>(-[0-9.]+) mm", plan_sheet(planned))
    assert lowest
    assert float(lowest[1]) == pytest.approx(-30.0, abs=0.0011)


def test_nothing_comes_from_outside_and_text_is_escaped() -> None:
    """One page, no external assets (2.6)."""
    page = render_sheet(facts())
    assert not re.search(r"(src|href)=|url\(|@import|<script|<link", page)
    assert "corner &lt;left&gt; &amp; front" in page
    assert page.count("<svg") == page.count("</svg>") == 2


def test_a_long_program_keeps_the_picture_small() -> None:
    many = [np.random.default_rng(seed).uniform(0, 50, (500, 3)) for seed in range(200)]
    assert len(render_sheet(facts(lines=many))) < 400_000


@pytest.mark.debian
def test_chromium_shows_one_a4_page_with_both_views(tmp_path: Path) -> None:
    """The thesis job's sheet in a real browser: the picture has ink, and the print is one page (2.6)."""
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("chromium is not installed")
    page, png, pdf = (tmp_path / name for name in ("sheet.html", "sheet.png", "sheet.pdf"))
    page.write_text(plan_sheet(plan_job(THESIS, ControlLimits())))
    common = [chromium, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}"]
    for wanted in (
        ["--window-size=860,1220", f"--screenshot={png}"],
        ["--no-pdf-header-footer", f"--print-to-pdf={pdf}"],
    ):
        subprocess.run([*common, *wanted, page.as_uri()], check=True, capture_output=True, timeout=120)
    import matplotlib.image

    image = matplotlib.image.imread(png)[:, :, :3]
    blue = (image[:, :, 2] > image[:, :, 0] + 0.25) & (image[:, :, 2] > 0.5)
    red = (image[:, :, 0] > image[:, :, 2] + 0.3) & (image[:, :, 0] > 0.5)
    rows, columns = np.nonzero(blue)
    assert blue.sum() > 1500
    assert rows.min() > 0.6 * image.shape[0]
    assert columns.min() < 0.45 * image.shape[1] < 0.55 * image.shape[1] < columns.max()
    assert red.sum() > 100
    assert len(re.findall(rb"/Type\s*/Page[^s]", pdf.read_bytes())) == 1
