"""Programs broken on purpose, and the thesis's, against their expected findings; `make golden` writes them anew."""

from __future__ import annotations

import json
import os
from pathlib import Path

import jsonschema
import pytest

from dnc.check.run import check_program
from dnc.check.limits import Limits
from dnc.profile import load_profile
from dnc.shipped import shipped_path

HERE = Path(__file__).parent
CLEAN = sorted((HERE / "clean").glob("*.mpf"))
THESIS = HERE.parent / "thesis-5000.mpf"
PROGRAMS = [*sorted(HERE.glob("*.mpf")), THESIS]
SCHEMA = json.loads((HERE.parents[2] / "docs/schemas/check.schema.json").read_text())
LIMITS = Limits(load_profile(shipped_path("machines", "sinumerik-840d")))


def report(program: Path) -> dict[str, object]:
    done = check_program(program, LIMITS)
    return {"program": program.name, **done.found.report(), "blocks": done.track.blocks}


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_findings(program: Path) -> None:
    """(6.10, 2.4)"""
    found = report(program)
    jsonschema.validate(found, SCHEMA)
    expected = HERE / f"{program.stem}.json"
    if os.environ.get("DRIPMILL_GOLDEN") == "write":
        expected.write_text(json.dumps(found, indent=1) + "\n")
    assert found == json.loads(expected.read_text())


def test_there_are_at_least_ten_broken_programs_and_the_thesis() -> None:
    """(6.10)"""
    assert len(PROGRAMS) >= 11
    assert len(CLEAN) >= 8


def test_the_thesis_program() -> None:
    """Reversal in N389, N308 twice, empty G1 in N145, G28, feed moves in air, no spindle dwell (2.4)."""
    found = {(one["id"], one["block"]) for one in report(THESIS)["findings"]}
    assert {("reversal", 389), ("number-duplicate", 308), ("empty-motion", 145), ("wrong-dialect", 396)} <= found
    assert {"feed-in-air", "no-spindle-dwell"} <= {name for name, _ in found}
    air = next(one for one in report(THESIS)["findings"] if one["id"] == "feed-in-air")
    assert "433 mm in air, beside 1254 mm of cutting" in air["text"]


@pytest.mark.parametrize("program", CLEAN, ids=lambda path: path.stem)
def test_clean_programs_in_the_styles_of_cam_systems_raise_no_alarm(program: Path) -> None:
    """(6.10) Retracts in machine coordinates, variables, letters, pecking, zero at the bottom: notes at most."""
    assert [one for one in report(program)["findings"] if one["severity"] != "note"] == []  # type: ignore[attr-defined]


def test_every_broken_program_shows_another_fault() -> None:
    """No golden may turn empty unseen."""
    for program in PROGRAMS:
        assert report(program)["errors"] > 0, program.name
