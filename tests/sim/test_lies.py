"""(1.7) Whatever is changed in the program's bytes shows in the verdict, at its place, to the micrometre."""

import re
from pathlib import Path

import numpy as np
import pytest

from sim.deviation import Verdict, judge
from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import Settings
from sim.nominal import Nominal, load_nominal
from sim.tool import BallTool
from tests.sim.passes import centres_at

JOB = Path(__file__).parents[2] / "configs/jobs/thesis.toml"
R = 4.0
PICK = 1.5


@pytest.fixture(scope="module")
def nominal() -> Nominal:
    return load_nominal(JOB)


@pytest.fixture(scope="module")
def program(nominal: Nominal) -> list[str]:
    """G1 passes over the thesis surface, tips written to 0.1 um, one block every 0.6 mm or less."""
    blocks = ["G17 G90 G54 G71", "G0 X0 Y0 Z50"]
    patch = nominal.patches[0]
    for k, y in enumerate(np.arange(1.2, 50.0, PICK)):
        tips = centres_at(patch, R, float(y), np.linspace(0, 1, 120), u_runs_along_y=True) - [0.0, 0.0, R]
        blocks.append(f"G0 X{tips[0, 0]:.4f} Y{tips[0, 1]:.4f}")
        blocks += [f"N{1000 * (k + 1) + i} G1 X{x:.4f} Y{y:.4f} Z{z:.4f} F250" for i, (x, y, z) in enumerate(tips)]
        blocks.append("G0 Z50")
    return [*blocks, "M30"]


def verdict(program: list[str], nominal: Nominal) -> Verdict:
    data = "\n".join(program).encode() + b"\n"
    motions = [command for command in interpret(data, Settings()) if isinstance(command, canon.Motion)]
    return judge(nominal, BallTool(R), motions, reference="tip", probe_pitch_mm=0.2)


def test_the_honest_program_is_clean(program: list[str], nominal: Nominal) -> None:
    found = verdict(program, nominal)
    assert found.gouge_mm < 0.0006
    assert found.coverage == 1.0


def test_a_block_lowered_by_20_um_shows_there(program: list[str], nominal: Nominal) -> None:
    """(1.7) Depth within 1 um, block named, place within a block's length."""
    at = next(i for i, block in enumerate(program) if block.startswith("N17060 "))
    z = float(re.search(r"Z(\S+)", program[at])[1])
    x, y = (float(re.search(rf"{axis}(\S+)", program[at])[1]) for axis in "XY")
    lowered = [*program[:at], re.sub(r"Z\S+", f"Z{z - 0.020:.4f}", program[at]), *program[at + 1 :]]
    found = verdict(lowered, nominal)
    worst = found.gouges[0]
    assert found.gouge_mm == pytest.approx(0.020, abs=0.001)
    assert worst.block in (17060, 17061)
    assert np.hypot(worst.position_mm[0] - x, worst.position_mm[1] - y) < 0.6


def test_a_deleted_pass_shows_there(program: list[str], nominal: Nominal) -> None:
    """(1.7) The scallop of a doubled pick feed, between the neighbours of the pass that is gone."""
    honest = verdict(program, nominal)
    without = [block for block in program if not re.match(r"N20\d\d\d ", block)]
    found = verdict(without, nominal)
    gap = R - np.sqrt(R * R - PICK**2)
    assert found.scallop_mm == pytest.approx(gap, rel=0.06)
    assert found.scallop_mm > 3 * honest.scallop_mm
    assert abs(found.scallops[0].position_mm[1] - (1.2 + 19 * PICK)) < 0.3
    assert {found.scallops[0].block // 1000} <= {19, 21}
