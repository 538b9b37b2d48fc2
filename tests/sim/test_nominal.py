import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sim.errors import InputRejected
from sim.nominal import load_nominal, load_patches
from sim.nominal_patch import NominalPatch
from tests.sim.surfaces import cylinder, plane, sphere_cap

ROOT = Path(__file__).parents[2]
THESIS = load_patches(ROOT / "configs/surfaces/thesis.toml")[0]


@pytest.mark.parametrize(
    "patch", [THESIS, sphere_cap(30.0, half_angle_rad=0.4), cylinder(9.0, half_angle_rad=0.7, length_mm=4.0)]
)
def test_the_grid_gives_what_single_points_give(patch: NominalPatch) -> None:
    """(1.5) Two ways through scipy to the same points, tangents, normals and curvatures."""
    u, v = np.linspace(0, 1, 7), np.linspace(0, 1, 5)
    uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    single, grid = patch.frames(uv), patch.grid_frames(u, v)
    for name in ("points", "along_u", "along_v", "normals", "areas"):
        np.testing.assert_allclose(getattr(grid, name), getattr(single, name), atol=1e-10)
    np.testing.assert_allclose(patch.grid_concave_curvature(u, v), patch.concave_curvature(uv), atol=1e-10)


def test_a_sphere_is_one() -> None:
    """(1.5) Rational evaluation: radius, outward normal and curvature of a sphere of radius 30."""
    patch = sphere_cap(30.0, half_angle_rad=0.4)
    uv = np.random.default_rng(1).uniform(0, 1, (50, 2))
    frames = patch.frames(uv)
    np.testing.assert_allclose(np.linalg.norm(frames.points, axis=1), 30.0, atol=1e-12)
    np.testing.assert_allclose(frames.normals, frames.points / 30.0, atol=1e-12)
    np.testing.assert_allclose(patch.concave_curvature(uv), -1.0 / 30.0, atol=1e-8)


def test_derivatives_are_those_of_the_points() -> None:
    """(1.5) Tangents against central differences."""
    uv, step = np.array([[0.3, 0.6], [0.8, 0.1]]), 1e-6
    frames = THESIS.frames(uv)
    for axis, along in ((0, frames.along_u), (1, frames.along_v)):
        change = np.zeros(2)
        change[axis] = step
        difference = (THESIS.frames(uv + change).points - THESIS.frames(uv - change).points) / (2 * step)
        np.testing.assert_allclose(along, difference, atol=1e-6)


def test_normals_point_to_the_tool() -> None:
    """(1.5) Whatever the order of u and v, up."""
    for patch in (THESIS, plane(slope_x=0.5)):
        assert (patch.frames(np.array([[0.5, 0.5], [0.0, 1.0]])).normals[:, 2] > 0).all()


def test_stock_to_leave_raises_the_design(tmp_path: Path) -> None:
    """(1.5) The verdict measures against the surface that was asked for."""
    job = tmp_path / "job.toml"
    text = (ROOT / "configs/jobs/thesis.toml").read_text()
    text = text.replace("../surfaces/thesis.toml", str(ROOT / "configs/surfaces/thesis.toml"))
    job.write_text(text.replace("scallop_mm = 0.08", "scallop_mm = 0.08\nstock_to_leave_mm = 0.3"))
    uv = np.array([[0.4, 0.7]])
    raised, plain = load_nominal(job).patches[0].frames(uv), THESIS.frames(uv)
    np.testing.assert_allclose(raised.points, plain.points + 0.3 * plain.normals, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("degree = [3, 3]", "degree = [4, 3]"), "degree 4 needs at least 5 control points"),
        (("knots_u = [0, 0, 0, 0, 1, 1, 1, 1]", "knots_u = [0, 0, 0, 0, 1, 1, 1]"), "has 7 values where 8 are needed"),
        (("knots_v = [0, 0, 0, 0, 1, 1, 1, 1]", "knots_v = [0, 0, 0, 0, 1, 1, 1, 0]"), "knots_v does not rise"),
        (("[1, 1, 2],", ""), "rows of different length"),
        (("degree = [3, 3]", "degre = [3, 3]"), "did you mean degree"),
    ],
)
def test_a_surface_that_cannot_be_used_names_its_line(tmp_path: Path, change: tuple[str, str], words: str) -> None:
    """(2.7)"""
    path = tmp_path / "surface.toml"
    path.write_text((ROOT / "configs/surfaces/thesis.toml").read_text().replace(*change))
    with pytest.raises(InputRejected, match=words) as caught:
        load_patches(path)
    assert caught.value.line is not None


def test_without_numba_the_probes_still_measure() -> None:
    """(3.4) With numba out of reach the numpy twin answers."""
    code = (
        "import sys; sys.modules['numba'] = None\n"
        "import numpy as np\n"
        "from sim.interpreter.canon import Line\n"
        "from sim.probe import probes_of\n"
        "from sim.sweep import sweep_of\n"
        "from sim.tool import BallTool\n"
        "line = Line(1, None, (-9.0, 0.0, 4.5), (9.0, 0.0, 4.5), 1.0)\n"
        "sweep = sweep_of([line], 0.0, sag_mm=0.005, length_mm=1.0, fit_mm=1e-7)\n"
        "probes = probes_of(sweep, BallTool(4.0), reach_mm=1.0)\n"
        "print(probes.measure(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])).height_mm[0])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert float(done.stdout) == pytest.approx(0.5, abs=1e-12)
