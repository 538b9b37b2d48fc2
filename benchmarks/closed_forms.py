"""The verdict where the answer is known in closed form: `python -m benchmarks.closed_forms` (3.2, 3.6).

Prints, for every case and probe pitch, the value that geometry asks for and the error of the figure found.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from sim.deviation import judge
from sim.interpreter.canon import Line, Motion
from sim.nominal import Nominal
from sim.tool import BallTool, BluntTool, Tool
from tests.sim.surfaces import cylinder, nominal_of, plane
from tests.sim.test_closed_forms import R, passes
from tests.sim.test_closed_forms_blunt import touching

Case = tuple[str, Nominal, Tool, list[Motion], float]


def cases() -> Iterator[Case]:
    """(name, design, cutter, motions, scallop in mm) of every case."""
    ball = BallTool(R)
    for slope in (0.0, 0.6):
        gap = math.hypot(1.0, slope)
        height = R - math.sqrt(R * R - gap**2 / 4)
        yield (
            f"ball, plane at {slope:g}",
            nominal_of(plane(size=5.0, slope_y=slope)),
            ball,
            passes(1.0, 0, slope),
            height,
        )
    r, step = 30.0, 0.04
    along: list[Motion] = [
        Line(k + 1, None, *((x, (r + R) * math.sin(a), (r + R) * math.cos(a)) for x in (-6.0, 14.0)), 250.0)
        for k, a in enumerate(np.arange(-15, 16) * step)
    ]
    cusp = (r + R) * math.cos(step / 2) - math.sqrt(R**2 - ((r + R) * math.sin(step / 2)) ** 2)
    yield "ball, along a cylinder", nominal_of(cylinder(r, half_angle_rad=0.4, length_mm=8.0)), ball, along, cusp - r
    bull, flat = BluntTool(1.5, 2.5), BluntTool(0.0, 4.0)
    inclined = nominal_of(plane(size=5.0, slope_y=0.5))
    gap = 0.4 * math.hypot(1.0, 0.5)
    yield "bull, plane at 0.5", inclined, bull, touching(bull, 0.4, 0.5), 1.5 - math.sqrt(1.5**2 - gap**2 / 4)
    yield "flat, plane at 0.5", inclined, flat, touching(flat, 0.5, 0.5), 0.5 * math.sin(math.atan(0.5))


def main() -> None:
    """The table."""
    print(f"{'case':<26}{'pitch mm':>9}{'scallop um':>13}{'error um':>12}{'gouge um':>12}")
    for name, nominal, tool, motions, height_mm in cases():
        for pitch_mm in (0.07, 0.1, 0.2):
            verdict = judge(nominal, tool, motions, reference="centre", probe_pitch_mm=pitch_mm)
            error_um = 1000 * (verdict.scallop_mm - height_mm)
            print(f"{name:<26}{pitch_mm:>9}{1000 * height_mm:>13.4f}{error_um:>12.1e}{1000 * verdict.gouge_mm:>12.1e}")


if __name__ == "__main__":
    main()
