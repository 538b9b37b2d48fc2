"""(2.7) Surface files: every complaint is one sentence with file, line and remedy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dnc.shipped import shipped_path
from planner.errors import InputRejected
from planner.surface.load import load_surface

GOOD = """degree = [1, 1]
knots_u = [0, 0, 1, 1]
knots_v = [0, 0, 1, 1]
control_points = [
  [[0, 0, 0], [10, 0, 0]],
  [[0, 10, 0], [10, 10, 1]],
]
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "s.toml"
    path.write_text(text)
    return path


def test_the_shipped_surfaces_load() -> None:
    (thesis,) = load_surface(shipped_path("surfaces", "thesis"))
    assert thesis.control_points.shape == (4, 4, 3)
    assert thesis.control_points[2, 2, 1] == 35
    (wave,) = load_surface(shipped_path("surfaces", "wave"))
    assert wave.control_points.shape == (60, 60, 3)


def test_patch_tables_are_named_in_order(tmp_path: Path) -> None:
    two = "".join(f"[[patch]]\n{GOOD}" for _ in range(2))
    assert [patch.name for patch in load_surface(write(tmp_path, two))] == ["patch 1", "patch 2"]


def test_weights_are_read(tmp_path: Path) -> None:
    (patch,) = load_surface(write(tmp_path, GOOD + "weights = [[1, 2], [1, 1]]\n"))
    assert patch.weights is not None
    assert np.array_equal(patch.weights, [[1, 2], [1, 1]])


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("knots_u = [0, 0, 1, 1]", "knots_u = [0, 0, 1]", 2, "3 knots"),
        ("knots_v = [0, 0, 1, 1]", "knots_v = [0, 1, 0, 1]", 3, "falls at its element 3"),
        ("knots_v = [0, 0, 1, 1]", "knots_v = [0, 1, 1, 1]", 3, "no span"),
        ("[[0, 10, 0], [10, 10, 1]]", "[[0, 10, 0]]", 6, "full grid"),
        ("[10, 10, 1]", "[10, 10, nan]", 6, "nan"),
        ("[10, 10, 1]", "[10, 10]", 6, "list of 3"),
        ("[10, 10, 1]", "[10, 1e12, 1]", 6, "beyond 100000 mm"),
        ("degree = [1, 1]", "degree = [0, 1]", 1, ">= 1"),
        ("degree = [1, 1]", "degre = [1, 1]", 1, "did you mean degree"),
        ("control_points", "weights = [[1, 0], [1, 1]]\ncontrol_points", 4, "not above 0"),
        (
            "control_points",
            "weights = [[1, 1e300], [1, 1]]\ncontrol_points",
            4,
            "weights[0][1] is more than 1e+06 times",
        ),
        ("control_points", "weights = [[1, 1e-300], [1, 1]]\ncontrol_points", 4, "times the lightest"),
        ("control_points", "weights = [[1, 1]]\ncontrol_points", 4, "shape"),
    ],
)
def test_a_bad_surface_is_one_sentence(tmp_path: Path, old: str, new: str, line: int, words: str) -> None:
    path = write(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(InputRejected) as caught:
        load_surface(path)
    sentence = str(caught.value)
    assert sentence.startswith(f"{path}:{line}:"), sentence
    assert words in sentence
    assert ";" in sentence, "a remedy follows"


def test_an_empty_grid_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputRejected):
        load_surface(write(tmp_path, GOOD[: GOOD.index("control_points")] + "control_points = []\n"))


def test_a_million_control_points_are_refused_before_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """(4.7) The sentence comes at once: the file is counted, not parsed."""
    row = "[" + "[0, 0, 0]," * 1000 + "],\n"
    path = write(tmp_path, "degree = [1, 1]\ncontrol_points = [\n" + row * 1000 + "]\n")
    monkeypatch.setattr("tomllib.loads", lambda text: pytest.fail("was parsed"))
    with pytest.raises(InputRejected, match="more than 250000 control points; split"):
        load_surface(path)
