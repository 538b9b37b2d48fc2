import csv
import math
import struct
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from sim.deviation import Verdict, judge
from sim.errors import InputRejected
from sim.export import write_map
from sim.interpreter.canon import Line, Motion
from sim.plot import PlotUnavailable, ends_beyond, plot_deviation, require_drawing
from sim.section import section_at
from sim.stock import stock_after
from sim.tool import BallTool, BluntTool
from sim.view import page_of, write_page
from tests.sim.surfaces import bilinear, nominal_of, plane

R = 4.0
CHROMIUM = Path("/usr/bin/chromium")


def motions() -> list[Motion]:
    """Passes 1 mm apart over y 0 to 6 of a plane of 10 mm; line 7 stands 30 um too low."""
    return [
        Line(k + 2, 10 * (k + 2), (-5.0, float(k), R - 0.03 * (k == 5)), (15.0, float(k), R - 0.03 * (k == 5)), 250.0)
        for k in range(7)
    ]


@pytest.fixture(scope="module")
def verdict() -> Verdict:
    return judge(nominal_of(plane(size=10.0)), BallTool(R), motions(), reference="centre", probe_pitch_mm=0.25)


def test_stock_is_exact_at_its_nodes(verdict: Verdict) -> None:
    """(3.5) Over a pass the stock is as high as the ball's lowest point, half way between as high as the cusp."""
    stock = stock_after(verdict.probes, (2.0, 2.0), (4.0, 4.0), 1.0, 0.5)
    assert stock.z_mm[0, 0] == pytest.approx(0.0, abs=1e-12)
    assert stock.z_mm[0, 1] == pytest.approx(R - math.sqrt(R * R - 0.25), abs=1e-12)
    untouched = stock_after(verdict.probes, (2.0, 40.0), (4.0, 42.0), 1.0, 0.5)
    assert (untouched.z_mm == 1.0).all()


def test_a_section_shows_the_cusps_between_passes(verdict: Verdict) -> None:
    """(3.5) Through the highest scallop, square to the passes: a parabola to either side, down to the passes."""
    worst = verdict.scallops[0]
    section = section_at(verdict, worst, 0.5, 101)
    assert np.nanmax(section.deviation_mm) == pytest.approx(worst.deviation_mm, abs=1e-6)
    assert section.deviation_mm[[1, -2]] == pytest.approx(0.0, abs=0.04)


def test_csv_has_every_probe(verdict: Verdict, tmp_path: Path) -> None:
    """(3.5)"""
    path = tmp_path / "map.csv"
    write_map(verdict, path)
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == verdict.maps[0].height_mm.size
    lowest = min((row for row in rows if row["deviation_mm"]), key=lambda row: float(row["deviation_mm"]))
    assert float(lowest["deviation_mm"]) == pytest.approx(-0.03, abs=1e-4)
    assert float(lowest["y_mm"]) == pytest.approx(5.0, abs=0.01)


def test_ply_is_as_long_as_its_head_says(verdict: Verdict, tmp_path: Path) -> None:
    """(3.5) 20 bytes a vertex, 17 a face; the first vertex is the corner of the plane."""
    path = tmp_path / "map.ply"
    write_map(verdict, path)
    head, body = path.read_bytes().split(b"end_header\n", 1)
    n, m = verdict.maps[0].height_mm.shape
    assert f"element vertex {n * m}\n".encode() in head
    assert len(body) == 20 * n * m + 17 * (n - 1) * (m - 1)
    assert struct.unpack("<3f", body[:12]) == (0.0, 0.0, 0.0)


def test_another_ending_is_refused(verdict: Verdict, tmp_path: Path) -> None:
    """(2.7)"""
    with pytest.raises(InputRejected, match=r"\.csv or \.ply"):
        write_map(verdict, tmp_path / "map.stl")


def test_picture_is_a_png(verdict: Verdict, tmp_path: Path) -> None:
    """(3.5) A picture of some size, and no half-written file beside it."""
    path = tmp_path / "map.png"
    plot_deviation(verdict, path)
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG")
    assert struct.unpack(">II", data[16:24]) > (1000, 800)
    assert list(tmp_path.iterdir()) == [path]


def test_picture_says_that_it_is_simulated_and_where_its_scale_ends(
    verdict: Verdict, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """(3.5, O7) It bore no SIMULATED, and 1 mm of material had the colour of 0.1 mm without a word."""
    said: list[str] = []
    monkeypatch.setattr(matplotlib.figure.Figure, "suptitle", lambda _figure, text: said.append(text))
    plot_deviation(verdict, tmp_path / "map.png")
    assert [text.split(":")[0] for text in said] == ["SIMULATED"]
    assert ends_beyond(verdict, 1e6) == "neither"
    assert [ends_beyond(verdict, limit_um) for limit_um in (29.0, 31.0)] == ["both", "max"]


def test_picture_of_a_perfect_part(tmp_path: Path) -> None:
    """(3.5) Without scallop and gouge the colours span 1 um, and the section says why it is empty."""
    flat = BluntTool(0.0, R)
    level = [Line(k + 1, k + 1, (-9.0, 4.0 * k, 0.0), (19.0, 4.0 * k, 0.0), 250.0) for k in range(-1, 5)]
    perfect = judge(nominal_of(plane(size=10.0)), flat, level, reference="tip", probe_pitch_mm=0.5)
    assert (perfect.scallop_mm, perfect.gouge_mm) == (0.0, 0.0)
    assert perfect.scale_mm == 1e-3
    plot_deviation(perfect, tmp_path / "perfect.png")
    assert (tmp_path / "perfect.png").read_bytes().startswith(b"\x89PNG")


def test_picture_of_a_part_that_was_never_reached(tmp_path: Path) -> None:
    """(3.5) After an alarm in the first block the drawing library's own warning went to the terminal."""
    above = [Line(1, 1, (0.0, 0.0, 60.0), (10.0, 0.0, 60.0), 250.0)]
    untouched = judge(nominal_of(plane(size=10.0)), BallTool(R), above, reference="centre", probe_pitch_mm=0.5)
    assert untouched.coverage == 0.0
    plot_deviation(untouched, tmp_path / "untouched.png")
    assert (tmp_path / "untouched.png").read_bytes().startswith(b"\x89PNG")


def test_picture_shows_where_the_tool_stood(verdict: Verdict, tmp_path: Path) -> None:
    """(7.4) A wait for blocks is a yellow square on the map, at its place, and the picture says how many there are."""
    plain, marked = tmp_path / "plain.png", tmp_path / "marked.png"
    plot_deviation(verdict, plain)
    plot_deviation(verdict, marked, [(3.0, 2.0, R), (7.0, 5.0, R)])
    pixels = [np.round(255 * matplotlib.image.imread(path)[:, :, :3]) for path in (plain, marked)]
    gold = [(picture == (255, 215, 0)).all(axis=2) for picture in pixels]
    assert not gold[0].any()
    rows, columns = np.nonzero(gold[1])
    first, second = columns < np.median(columns), columns > np.median(columns)
    assert rows[first].mean() > rows[second].mean() + 20


def test_page_cannot_be_broken_by_the_program(verdict: Verdict) -> None:
    """(3.5) What looks like HTML in the program stays text."""
    program = b"N10 ;</script><script>alert(1)</script>\n"
    page = page_of(verdict, motions(), program, "t", nodes=1000, pieces=1000)
    assert "</script><script>alert" not in page
    assert "http" not in page


@pytest.fixture(scope="module")
def groove() -> Verdict:
    """A V of two planes: no ball touches nearer than R to its crease."""
    sides = (((-12.0, 12.0), (0.0, 0.0)), ((0.0, 0.0), (12.0, 12.0)))
    patches = [bilinear(np.array([[[x, y, z] for y in (0.0, 8.0)] for x, z in side])) for side in sides]
    high = R * math.sqrt(2.0)
    made = [Line(1, 1, (0.0, -5.0, high), (0.0, 13.0, high), 250.0)]
    return judge(nominal_of(*patches), BallTool(R), made, reference="centre", probe_pitch_mm=0.25, reach_mm=2.0)


def test_what_no_ball_can_touch_stands_apart(groove: Verdict, tmp_path: Path) -> None:
    """(3.3) The crease is no scallop; CSV, PLY and picture tell it from ground that the program left out."""
    assert groove.scallop_mm < 1e-6
    assert groove.inaccessible == pytest.approx(R / (12.0 * math.sqrt(2.0)), abs=0.02)
    write_map(groove, tmp_path / "map.csv")
    rows = list(csv.DictReader((tmp_path / "map.csv").read_text().splitlines()))
    crease = [row for row in rows if abs(float(row["x_mm"])) < 2.5]
    assert {row["is_accessible"] for row in crease} == {"0"}
    write_map(groove, tmp_path / "map.ply")
    body = (tmp_path / "map.ply").read_bytes().split(b"end_header\n", 1)[1]
    kind = np.dtype([("place", "<f4", 3), ("deviation", "<f4"), ("colour", "u1", 3), ("is_accessible", "u1")])
    vertices = np.frombuffer(body, kind, len(rows))
    assert [bool(each) for each in vertices["is_accessible"]] == [row["is_accessible"] == "1" for row in rows]
    assert {tuple(each) for each in vertices["colour"][vertices["is_accessible"] == 0].tolist()} == {(250, 220, 70)}
    plot_deviation(groove, tmp_path / "cut.png")
    image = matplotlib.image.imread(tmp_path / "cut.png")
    yellow = (image[..., 0] > 0.85) & (image[..., 1] > 0.85) & (image[..., 2] < 0.6)
    assert yellow.mean() > 0.01


@pytest.mark.debian
@pytest.mark.skipif(not CHROMIUM.exists(), reason="needs the Debian package chromium")
def test_page_says_where_no_ball_can_touch(groove: Verdict, tmp_path: Path) -> None:
    """(3.3) In Chromium the crease has a colour and a word of its own."""
    from playwright.sync_api import sync_playwright

    path = tmp_path / "cut.html"
    write_page(page_of(groove, motions(), b"N1 G1", "groove", nodes=5000, pieces=1000), path)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 1100, "height": 700})
        page.goto(path.as_uri())
        page.wait_for_selector("body[data-ready=yes]")
        said = []
        for place in ("0.5, 4", "9, 4"):
            x, y = page.evaluate(
                f"(() => {{ const b = canvas.getBoundingClientRect(), p = toScreen({place});"
                " return [b.left + p[0], b.top + p[1]]; })()"
            )
            page.mouse.move(x, y)
            said.append(page.inner_text("#status"))
        is_told = page.is_visible("#apart")
        browser.close()
    assert is_told
    assert "cannot touch here" in said[0]
    assert "cannot touch here" not in said[1]


@pytest.mark.debian
@pytest.mark.skipif(not CHROMIUM.exists(), reason="needs the Debian package chromium")
def test_page_in_a_real_browser(verdict: Verdict, tmp_path: Path) -> None:
    """(3.5) In Chromium the cursor over the gouged pass shows its depth and its block, without any script error."""
    from playwright.sync_api import sync_playwright

    blocks = ["G90", *(f"N{10 * (k + 2)} G1 X15 Y{k}" for k in range(7)), "M30"]
    program = "\n".join(blocks).encode()
    path = tmp_path / "cut.html"
    write_page(page_of(verdict, motions(), program, "test part", nodes=5000, pieces=1000), path)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 1100, "height": 700})
        faults: list[str] = []
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", lambda request: faults.append(request.url) if request.url != path.as_uri() else None)
        page.goto(path.as_uri())
        page.wait_for_selector("body[data-ready=yes]")
        x, y = page.evaluate(
            "(() => { const b = canvas.getBoundingClientRect(), p = toScreen(6, 5);"
            " return [b.left + p[0], b.top + p[1]]; })()"
        )
        page.mouse.move(x, y)
        status, marked = page.inner_text("#status"), page.inner_text("#program .here")
        page.mouse.wheel(0, -300)
        scale = page.evaluate("view.scale")
        key = page.inner_text("#key")
        page.mouse.move(x + 1, y)
        browser.close()
    assert faults == []
    assert "deviation -30.00 µm" in status
    assert "line 7" in status
    assert "N70 G1 X15 Y5" in marked
    assert scale > 0
    assert "not reached" in key
    assert "µm left" in key


def test_a_missing_drawing_library_is_known_before_the_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    """(2.7) One sentence that names what to install, before an hour of cutting and not after it."""
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(PlotUnavailable, match=r"matplotlib is not installed; pip install 'dripmill\[plot\]'"):
        require_drawing()
