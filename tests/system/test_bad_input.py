"""2,000 mutated jobs, surfaces, profiles and programs: one sentence or success, never another exception (2.7)."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dnc.check.limits import Limits
from dnc.check.run import check_program
from dnc.profile import load_profile
from planner.errors import ExitCode, UserError
from planner.job import load_job
from planner.surface.load import load_surface
from sim.nominal import load_nominal
from sim.profile import load_mill_profile
from tests.helpers.mutate import mutated

CONFIGS = Path(__file__).parents[2] / "configs"
PROGRAM = Path(__file__).parents[1] / "golden/check/rapids.mpf"
SINUMERIK = load_profile(CONFIGS / "machines/sinumerik-840d.toml")
KINDS: dict[str, tuple[Path, Callable[[Path], object]]] = {
    "job": (CONFIGS / "jobs/thesis.toml", load_job),
    "nominal": (CONFIGS / "jobs/thesis.toml", load_nominal),
    "surface": (CONFIGS / "surfaces/thesis.toml", load_surface),
    "program": (PROGRAM, lambda path: check_program(path, Limits(SINUMERIK))),
    "profile": (CONFIGS / "machines/sinumerik-840d.toml", load_profile),
    "mill-profile": (CONFIGS / "machines/sinumerik-840d.toml", load_mill_profile),
}


@pytest.mark.parametrize("kind", sorted(KINDS))
@settings(max_examples=340, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_mutated_file_is_accepted_or_refused_in_one_sentence(kind: str, tmp_path: Path, data: st.DataObject) -> None:
    original, load = KINDS[kind]
    path = tmp_path / "jobs" / original.name
    path.parent.mkdir(exist_ok=True)
    shutil.copytree(CONFIGS / "surfaces", tmp_path / "surfaces", dirs_exist_ok=True)
    path.write_bytes(data.draw(mutated(original.read_bytes())))
    refusal = _refusal(load, path)
    if refusal is not None:
        assert refusal.exit_code in (ExitCode.REJECTED, ExitCode.SETTINGS)
        assert str(tmp_path) in str(refusal)
        assert "\n" not in str(refusal)


def _refusal(load: Callable[[Path], object], path: Path) -> UserError | None:
    try:
        load(path)
    except UserError as error:
        return error
    return None
