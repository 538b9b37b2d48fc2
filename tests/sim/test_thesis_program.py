"""(2.4, 2.5) What the thesis's program, as printed, makes of its surface."""

from pathlib import Path

import pytest

from sim.deviation import Verdict, judge
from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import Settings
from sim.nominal import load_nominal
from sim.tool import BallTool

ROOT = Path(__file__).parents[2]


def motions() -> list[canon.Motion]:
    data = (ROOT / "tests/golden/thesis-5000.mpf").read_bytes()
    return [command for command in interpret(data, Settings()) if isinstance(command, canon.Motion)]


@pytest.fixture(scope="module")
def verdict() -> Verdict:
    nominal = load_nominal(ROOT / "configs/jobs/thesis.toml")
    return judge(nominal, BallTool(4.0), motions(), reference="tip", probe_pitch_mm=0.2)


def test_contact_points_driven_as_tips_gouge(verdict: Verdict) -> None:
    """(2.4) 38 um, on the steep side near X2; the page in docs says the same."""
    assert verdict.gouge_mm == pytest.approx(0.0384, abs=0.0002)
    assert verdict.gouges[0].position_mm[0] < 3.0
    assert "38.4" in (ROOT / "docs/thesis.md").read_text()


def test_a_third_of_the_surface_was_never_cut(verdict: Verdict) -> None:
    """(2.4) The paths end at Y30: 37 % has over 1 mm left."""
    assert 1.0 - verdict.coverage == pytest.approx(0.371, abs=0.003)
    assert verdict.inaccessible == 0.0


def test_the_way_home_cuts_the_ridges(verdict: Verdict) -> None:
    """(2.4) N396 crosses the part at Z2, as a rapid: some of the surface is its work."""
    mapped = verdict.maps[0]
    way_home = [index for index, each in enumerate(motions()) if each.block == 396 and isinstance(each, canon.Rapid)]
    area = sum(float(mapped.net.area_mm2[mapped.motion == index].sum()) for index in way_home)
    assert area == pytest.approx(4.7, abs=0.5)
