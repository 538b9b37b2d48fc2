import json
from pathlib import Path

import jsonschema
import pytest

from dnc.cli.main import run_with

ROOT = Path(__file__).parents[2]
JOB = str(ROOT / "configs/jobs/thesis.toml")
TABLES = ROOT / "tests/sim/data/cmm-tables.csv"


def measure(table: Path, tmp_path: Path) -> dict[str, object]:
    report = tmp_path / "measured.json"
    assert run_with(["measure", str(table), "--job", JOB, "--report", str(report)]) == 0
    found = json.loads(report.read_text())
    jsonschema.validate(found, json.loads((ROOT / "docs/schemas/measure.schema.json").read_text()))
    return found


def test_the_tables_of_the_thesis_show_one_offset(tmp_path: Path) -> None:
    """(2.5) 0.054 mm of set-up offset, 0.016 mm left after registration; the design points lie on the surface."""
    found = measure(TABLES, tmp_path)
    assert found["points"] == 36
    assert found["offset_mm"] == pytest.approx(-0.0544, abs=5e-5)
    assert found["residual_mm"] == pytest.approx(0.0160, abs=5e-5)
    assert found["design_mismatch_mm"] < 1e-5


def test_points_with_y_are_found_on_the_design(tmp_path: Path) -> None:
    """(2.5) Points of known places, raised by 0.1 and 0.3 mm: offset 0.2, residual 0.1 sqrt 2."""
    table = tmp_path / "points.csv"
    table.write_text("x_mm,y_mm,z_mm\n1,1,2.1\n50,50,2.3\n")
    found = measure(table, tmp_path)
    assert found["offset_mm"] == pytest.approx(0.2, abs=1e-9)
    assert found["residual_mm"] == pytest.approx(0.1 * 2**0.5, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x_mm,y_mm\n1,2\n", "no column z_mm"),
        ("x_mm,z_mm\n1,2\n", "neither y_mm nor z_design_mm"),
        ("x_mm,y_mm,z_mm\n", "no points"),
        ("x_mm,y_mm,z_mm\n1,2,nan\n", "points.csv:2: z_mm is 'nan'"),
        ("x_mm,y_mm,z_mm\n1,2,1e308\n", "points.csv:2: z_mm is '1e308'; give a number in mm"),
        ("x_mm,y_mm,z_mm\n1,2\n", "points.csv:2: has 2 columns where 3 are named"),
        ("x_mm,y_mm,z_mm\n1,2," + 200_000 * "3", "points.csv:2: is no table: field larger than field limit"),
        ("", "points.csv: is empty; name a table of points"),
        ("x_mm,y_mm,z_mm\n-30,2,1\n", "point 1 lies more than 1 mm beside"),
    ],
)
def test_a_table_that_cannot_be_used_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, words: str
) -> None:
    """(2.7)"""
    table = tmp_path / "points.csv"
    table.write_text(text)
    assert run_with(["measure", str(table), "--job", JOB]) == 3
    assert words in capsys.readouterr().err
