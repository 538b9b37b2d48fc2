"""The pipeline from job file to program, report and picture, and every refusal as one sentence."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.interpolate import BSpline

from dnc.cli.main import run_with
from dnc.cli.plan import command
from dnc.shipped import shipped_path
from planner.errors import InputRejected
from planner.path.gouge import tool_side
from planner.path.strategy.angle import best_angle_rad
from planner.path.strategy.parallel import Wishes, lay_parallel
from planner.plan import plan_job
from planner.surface.curvature import survey
from tests.planner.jobs import LIMITS, SURFACE, job_in
from tests.planner.surfaces import cylinder_patch

SCHEMA = Path(__file__).parents[2] / "docs/schemas/plan.schema.json"
PLATE_OF_5_M = """degree = [1, 1]
knots_u = [0, 0, 1, 1]
knots_v = [0, 0, 1, 1]
control_points = [[[0, 0, 0], [5000, 0, 0]], [[0, 5000, 0], [5000, 5000, 1]]]
"""


def test_the_main_job_keeps_its_promises(tmp_path: Path) -> None:
    """(1.2, 4.1) Scallop within target less the budget, path within path_mm; the report fits its schema."""
    planned = plan_job(job_in(tmp_path), LIMITS)
    report = planned.report
    jsonschema.validate(report, json.loads(SCHEMA.read_text()))
    assert report["path_deviation_mm"] <= 0.001
    assert report["gouge_mm"] <= 0.001
    assert report["scallop_mm"] <= 0.08 - report["path_deviation_mm"]
    assert min(report["scallop_gaps_mm"][:-1]) >= 0.08 - 2 * (0.001 + report["rounding_mm"])
    assert report["bytes"] == len(planned.program)
    assert len(planned.sidecar["restart_points"]) == report["passes"] == 32


@pytest.mark.parametrize("blocks", ["poly", "linear"])
def test_rapids_move_z_alone_or_xy_alone(tmp_path: Path, blocks: str) -> None:
    """(1.2) No G0 block names Z together with X or Y; every pass has its own start and its own retract."""
    text = plan_job(job_in(tmp_path), LIMITS, post={"blocks": blocks}).program.decode()
    rapids = [line for line in text.splitlines() if re.search(r"G0(?![0-9])", line)]
    assert len(rapids) >= 64
    assert not [line for line in rapids if "Z" in line and ("X" in line or "Y" in line)]


@pytest.mark.parametrize("reference", ["tip", "centre"])
def test_the_way_in_air_is_that_of_the_program(tmp_path: Path, reference: str) -> None:
    """(5) Rapids and plunges of the blocks, from the first place at safe height on, whichever point is programmed."""
    planned = plan_job(job_in(tmp_path), LIMITS, post={"blocks": "linear", "reference": reference})
    at, mode, air_mm = np.array([np.nan, np.nan, 50.0]), "0", 0.0
    for line in planned.program.decode().splitlines():
        if line.startswith(("%", ";", "G0 Z", "G4", "T", "D", "S", "M")):
            continue
        text = re.sub(r"^N\d+ ?", "", line)
        mode = (re.findall(r"G([01])(?!\d)", text) or [mode])[0]
        before = at.copy()
        for axis, value in re.findall(r"([XYZ])(-?[0-9.]+)", text):
            at["XYZ".index(axis)] = float(value)
        run_mm = float(np.linalg.norm(at - before))
        air_mm += run_mm if (mode == "0" or text.startswith("G1G9Z")) and np.isfinite(run_mm) else 0.0
    assert planned.report["air_length_mm"] == pytest.approx(air_mm, abs=0.01)


@pytest.mark.parametrize(
    ("reference", "top_mm", "is_warned"), [("tip", 10, False), ("tip", 11, True), ("centre", 7, True)]
)
def test_rapids_inside_the_billet_are_warned_of(tmp_path: Path, reference: str, top_mm: int, is_warned: bool) -> None:
    """(2.7) `dnc check` calls them an error; the plan knows of the billet too, and that it may be roughed."""
    path = job_in(tmp_path, ("[52, 52, 4]]", f"[52, 52, {top_mm}]]"))
    warnings = plan_job(path, LIMITS, post={"reference": reference}).warnings
    assert any(f"below the top of the billet at Z{top_mm}" in text for text in warnings) is is_warned


def test_zigzag_turns_every_pass_and_one_way_none(tmp_path: Path) -> None:
    starts = {}
    for pattern in ("zigzag", "one-way"):
        path = plan_job(job_in(tmp_path, ('pattern = "zigzag"', f'pattern = "{pattern}"')), LIMITS).tool_path
        starts[pattern] = [one.shape.control_points[0, 0] for one in path.passes]  # type: ignore[union-attr]
    middle = 25.0
    assert [x < middle for x in starts["zigzag"][:4]] == [True, False, True, False]
    assert all(x > middle for x in starts["one-way"]), "climb: uncut material (+y) on the right of a tool going -x"


def test_the_papers_rule_is_kept_for_comparison(tmp_path: Path) -> None:
    """(1.2, 4.4) fit = "paper": break points until the checked deviation holds."""
    planned = plan_job(job_in(tmp_path, ('edge = "to-border"', 'edge = "to-border"\nfit = "paper"')), LIMITS)
    assert planned.report["break_points"] >= 32 * 5
    assert planned.report["path_deviation_mm"] <= 0.001


def test_planning_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    """(4.6)"""
    path = job_in(tmp_path)
    assert plan_job(path, LIMITS).program == plan_job(path, LIMITS).program


@pytest.mark.parametrize(
    ("changes", "surface", "words"),
    [
        ([], ("[30, 20, 1.5]", "[30, 20, nan]"), r"surface\.toml:\d+: .*nan"),
        ([], ("[[1, 12, 1], [8, 15, 3]", "[[1, 1, 2], [1, 1, 2]"), r"patch 1 is singular at \(u, v\)"),
        ([], ("[25, 35, 3]", "[25, 35, -140]"), r"patch 1 has a concave radius .* at \(u, v\) = \("),
        ([("diameter_mm = 8.0", "diameter_mm = 90.0")], None, r"concave radius of \d+\.\d+ mm at \(u, v\)"),
        ([("scallop_mm = 0.08", "scallop_mm = 0.0")], None, r"job\.toml:\d+: .*scallop_mm"),
        ([("scallop_mm = 0.08", "scallop_mm = 4.5")], None, r"job\.toml:\d+: scallop_mm 4\.5"),
        (
            [("path_mm = 0.001", "path_mm = 0.09")],
            None,
            r"job\.toml:\d+: .* leaves nothing beside path_mm",
        ),
        ([("path_mm = 0.001", "path_mm = 1e-9")], None, r"job\.toml:\d+: path_mm 1e-09 is finer"),
        ([('strategy = "parallel"', 'strategy = "isoparametric"')], None, r"job\.toml:\d+: strategy .* not built yet"),
        (
            [('kind = "ball"', 'kind = "bull"\ncorner_radius_mm = 1.0')],
            None,
            r"toml:\d+: a bull tool is not built yet",
        ),
        ([("angle_deg = 0.0", "angle_deg = 0.0\nboundary = [[[0, 0], [1, 0], [1, 1]]]")], None, "not built yet"),
        (
            [("clearance_z_mm = 10.0", "clearance_z_mm = 2.5")],
            None,
            r"job\.toml:\d+: clearance_z_mm 2\.5 is not above patch 1, .* Z3\.000",
        ),
        (
            [("scallop_mm = 0.08", "scallop_mm = 0.0010003")],
            None,
            r"toml:\d+: patch 1 is 49 x 49 mm: scallop_mm asks for .* passes, .*; give .* or a smaller path_mm",
        ),
        ([("scallop_mm = 0.08", "pick_feed_mm = 1e-5")], None, r"patch 1 is .* mm: pick_feed_mm asks for .* passes"),
        ([("angle_deg = 0.0", "angle_deg = 1e20")], None, r"job\.toml:\d+: .*angle_deg: is out of range"),
        (
            [("scallop_mm = 0.08", "pick_feed_mm = 1.0")],
            (SURFACE, PLATE_OF_5_M),
            r"patch 1 is 5000 mm long along X, the machine goes over 1500; cut the part in pieces",
        ),
        (
            [("scallop_mm = 0.08", "pick_feed_mm = 0.05")],
            (SURFACE, PLATE_OF_5_M.replace("5000", "800")),
            r"patch 1 is 800 x 800 mm: pick_feed_mm asks for about 12\.8 km of passes, more than 5 km",
        ),
        (
            [("angle_deg = 0.0", "angle_deg = 30.0")],
            (SURFACE, PLATE_OF_5_M.replace("[5000", "[300").replace("5000", "1600")),
            r"1600 mm long along Y",
        ),
        ([("surface.toml", "absent.toml")], None, r"absent\.toml: cannot be read"),
        (
            [("safe_z_mm = 50.0", "safe_z_mm = 1e5")],
            None,
            r"job\.toml:\d+: .* over 1e\+05 mm along Z, the machine over 1000; lower",
        ),
        ([("plunge_mm_min = 100.0", "plunge_mm_min = 1e-9")], None, r"job\.toml:\d+: .*plunge_mm_min"),
        ([("cut_mm_min = 250.0", "cut_mm_min = 1e9")], None, r"job\.toml:\d+: .*cut_mm_min"),
        ([("spindle_rpm = 1000.0", "spindle_rpm = 1e9")], None, r"job\.toml:\d+: .*spindle_rpm"),
        ([("spindle_dwell_s = 2.0", "spindle_dwell_s = 1e9")], None, r"job\.toml:\d+: .*spindle_dwell_s"),
        ([("[52, 52, 4]", "[52, 52, -20]")], None, r"job\.toml:\d+: stock_box_mm runs from Z-20 to Z-20"),
        ([('work_offset = "G54"', 'work_offset = "G53"')], None, r"job\.toml:\d+: setup\.work_offset 'G53' is no"),
        ([('name = "5000"', 'name = "a b"')], None, r"job\.toml:\d+: post\.name 'a b' is no SINUMERIK"),
        (
            [('control = "sinumerik-840d"', 'control = "fanuc-30i"')],
            None,
            r"toml:\d+: .* fanuc-30i is not built yet",
        ),
        ([("length_mm = 60.0", "length_mm = 4.0")], None, r"job\.toml:\d+: length_mm 4 is not above"),
    ],
)
def test_what_cannot_be_planned_is_one_sentence_and_leaves_no_file(
    tmp_path: Path,
    changes: list[tuple[str, str]],
    surface: tuple[str, str] | None,
    words: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """(2.7, 4.7) Exit 3, place and remedy on one line, no traceback, nothing written."""
    path = job_in(tmp_path, *changes, surface=surface)
    assert run_with(["plan", str(path), "-o", str(tmp_path / "out.mpf")]) == 3
    said = capsys.readouterr().err.strip()
    assert len(said.splitlines()) == 1
    assert re.search(words, said), said
    assert ";" in said
    assert sorted(file.name for file in tmp_path.iterdir()) == ["job.toml", "surface.toml"]


def test_the_angle_can_be_left_to_the_planner(tmp_path: Path) -> None:
    """(4.1) "auto" takes the shortest of four directions on a cylinder, where they differ, to 3 % of its length."""
    patch = cylinder_patch(10.0, 12.0)
    lengths = {}
    for angle_deg in (0.0, 45.0, 90.0, 135.0):
        layout = lay_parallel(patch, Wishes(4.0, np.radians(angle_deg), 0.05, None), accuracy_mm=1e-7)
        lengths[angle_deg] = sum(curve.length_mm for curve in layout.curves)
    assert max(lengths.values()) > 1.1 * min(lengths.values())
    best = best_angle_rad(patch, tool_side(survey(patch)), 4.0, 0.05)
    layout = lay_parallel(patch, Wishes(4.0, best, 0.05, None), accuracy_mm=1e-7)
    assert sum(curve.length_mm for curve in layout.curves) <= 1.03 * min(lengths.values())
    path = job_in(tmp_path, ("angle_deg = 0.0", 'angle_deg = "auto"'), ("path_mm = 0.001", "path_mm = 0.01"))
    assert plan_job(path, LIMITS, post={"blocks": "linear"}).report["angle_deg"] % 5 == pytest.approx(0, abs=1e-9)


def test_several_patches_are_refused_by_name(tmp_path: Path) -> None:
    path = job_in(tmp_path)
    shape = SURFACE[SURFACE.index("degree") :]
    (tmp_path / "surface.toml").write_text(f"[[patch]]\n{shape}[[patch]]\n{shape}")
    with pytest.raises(InputRejected, match=r"2 patches .* not built yet"):
        plan_job(path, LIMITS)


def test_the_command_writes_program_sidecar_report_and_picture(tmp_path: Path) -> None:
    """(4.9) Data to files, words to stderr; rivals at four tolerances; the picture is a PNG of some size."""
    path, out = job_in(tmp_path), tmp_path / "part.mpf"
    options = ["--report", str(tmp_path / "r.json"), "--plot", str(tmp_path / "p.png")]
    found = CliRunner().invoke(command, [str(path), "-o", str(out), *options])
    assert found.exit_code == 0, found.output
    report = json.loads((tmp_path / "r.json").read_text())
    jsonschema.validate(report, json.loads(SCHEMA.read_text()))
    assert {row["way"] for row in report["rivals"]} == {"poly", "free", "paper", "arcs", "linear"}
    assert {row["path_mm"] for row in report["rivals"]} == {0.01, 0.001, 0.00025, 0.0001}
    assert json.loads((tmp_path / "part.mpf.json").read_text())["schema"] == "dripmill.sidecar"
    assert out.stat().st_size == report["bytes"]
    picture = (tmp_path / "p.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert len(picture) > 30_000


def test_a_feed_beyond_the_line_is_warned_of(tmp_path: Path) -> None:
    """(4.8) Straight moves at 20 m/min starve a 600 baud line; the warning names baud, override and limit."""
    path = job_in(tmp_path, ("cut_mm_min = 250.0", "cut_mm_min = 20000.0"))
    planned = plan_job(path, LIMITS, post={"blocks": "linear"}, line=(600, 10.0))
    limits = planned.report["feed_limit_mm_min"]["600"]
    assert limits["120"] < limits["100"] < 20000
    assert any(f"600 baud and 120 % override the line feeds {limits['120']:.0f} mm/min" in w for w in planned.warnings)
    assert not any("starve" in warning for warning in plan_job(job_in(tmp_path), LIMITS).warnings)


def test_the_blocks_of_a_bspline_fall_due_with_the_span_that_wants_their_point(tmp_path: Path) -> None:
    """(4.8) Read anew from the program: no 2 s window of a pass starves below the limit, one does above it."""
    job = shipped_path("jobs", "wave").read_text().replace("../surfaces/wave.toml", "surface.toml")
    (tmp_path / "surface.toml").write_bytes(shipped_path("surfaces", "wave").read_bytes())
    (tmp_path / "job.toml").write_text(job.replace("pick_feed_mm = 0.5", "pick_feed_mm = 7.5"))
    planned = plan_job(tmp_path / "job.toml", LIMITS, post={"blocks": "bspline"}, line=(600, 10.0))
    limit = planned.report["feed_limit_mm_min"]["600"]["100"]
    passes = [due_blocks(text) for text in planned.program.decode().split("BSPLINE ")[1:]]

    def starves(start_mm: np.ndarray, size_bytes: np.ndarray, feed_mm_s: float) -> bool:
        """Windows that begin with a span; the first two blocks come during the plunge."""
        start_s = start_mm / feed_mm_s
        return any(size_bytes[2:][(start_s[2:] >= at) & (start_s[2:] < at + 2.0)].sum() > 120 for at in start_s[2:])

    assert not any(starves(*one, 0.99 * limit / 60) for one in passes)
    assert any(starves(*one, 1.01 * limit / 60) for one in passes)


@pytest.mark.parametrize("blocks", ["poly", "bspline", "arcs", "linear"])
def test_every_way_of_writing_goes_over_the_edge(tmp_path: Path, blocks: str) -> None:
    """(4.2, 4.8) Splines with knots that stand several times at a place have fewer spans than their points say."""
    planned = plan_job(job_in(tmp_path, ('edge = "to-border"', 'edge = "roll-over"')), LIMITS, post={"blocks": blocks})
    assert planned.report["path_deviation_mm"] <= 0.001
    assert set(planned.report["feed_limit_mm_min"]["9600"]) == {"100", "120"}


def due_blocks(text: str) -> tuple[np.ndarray, np.ndarray]:
    """Of one pass, from behind the word BSPLINE: how far the pass has got when each block falls due, and its bytes."""
    lines = text.split("\n")
    last = next(number for number, line in enumerate(lines) if "G9" in line)
    sizes = np.array([len(line) + 1.0 for line in lines[: last + 1]]) + 8.0 * (np.arange(last + 1) == 0)
    intervals = [float(re.search(r"PL=([\d.]+)", line)[1]) for line in lines[: last + 1]]  # type: ignore[index]
    knots = np.cumsum([0.0, 0.0, 0.0, *intervals, 0.0, 0.0])
    points = np.array([[float(w) for w in re.findall(r"[XZ](-?[\d.]+)", line)] for line in lines[: last + 1]])
    first = 2 * points[0] - points[1]  # nearly: the point itself stands before the BSPLINE
    curve = BSpline(knots, np.vstack([first, points]), 3)
    at = knots[3:-3]
    runs = [np.hypot(*np.diff(curve(np.linspace(*pair, 200)), axis=0).T).sum() for pair in pairwise(at)]
    return np.concatenate([[0.0, 0.0], np.cumsum([0.0, *runs[:-1]])]), sizes


def test_a_plunge_of_the_tip_is_measured_at_the_tip(tmp_path: Path) -> None:
    """(4.8) From Z10 a plunge lasts over 4 s at 120 %: no 2 s hold two passes, and one has less than 240 bytes."""
    planned = plan_job(job_in(tmp_path), LIMITS)
    assert planned.report["feed_limit_mm_min"]["1200"] == {"100": None, "120": None}


def test_planning_needs_neither_scipy_nor_matplotlib() -> None:
    """(4.5) Start-up decides small jobs: the pipeline imports numpy alone of the heavy libraries."""
    code = "import sys, planner.plan; print([m for m in ('scipy', 'matplotlib', 'numba') if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert found.stdout.strip() == "[]"


def test_without_numba_the_program_is_the_same(tmp_path: Path) -> None:
    """(4.6) Byte for byte, with numba within reach and out of it."""
    programs = []
    for block in ("", "sys.modules['numba'] = None; "):
        code = f"import sys; {block}from dnc.cli.main import run; run()"
        command = [sys.executable, "-c", code, "plan", shipped_path("jobs", "thesis"), "-o", "part.mpf"]
        subprocess.run(command, check=True, cwd=tmp_path, capture_output=True)
        programs.append((tmp_path / "part.mpf").read_bytes())
    assert programs[0] == programs[1]
