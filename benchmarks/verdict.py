"""Speed of the verdict: `python -m benchmarks.verdict` (3.4). Programs are planned in the same run.

Prints probes per second after warm-up and the time to judge the thesis surface at 0.1 mm and the 300 mm wave at 0.5 mm,
refinement of the extremes included, with the processor's time beside the wall's. The thesis program is judged again as
if a bull-nose cutter and a flat one of the same diameter had run it; it gouges, which is more work than a good program.
"""

from __future__ import annotations

import dataclasses
import resource
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from dnc.cli.main import run_with
from dnc.shipped import shipped_path
from sim.deviation import Verdict, judge
from sim.interpreter import canon
from sim.interpreter.run import interpret
from sim.interpreter.settings import Settings
from sim.nominal import CutterData, Nominal, load_nominal
from sim.tool import tool_of


def main() -> None:
    """Plan, judge twice (the first run warms up), print the second."""
    with tempfile.TemporaryDirectory() as folder:
        fine = Path(folder) / "thesis-fine.toml"
        text = shipped_path("jobs", "thesis").read_text().replace("scallop_mm = 0.08", "scallop_mm = 0.01")
        fine.write_text(text.replace("../surfaces", str(shipped_path("surfaces", "thesis").parent)))
        for name, job, pitch_mm in (("thesis", fine, 0.1), ("wave", shipped_path("jobs", "wave"), 0.5)):
            program = Path(folder) / f"{name}.mpf"
            if run_with(["plan", str(job), "-o", str(program)]) != 0:
                raise SystemExit(f"planning {name} failed")
            motions = [each for each in interpret(program.read_bytes(), Settings()) if isinstance(each, canon.Motion)]
            nominal = load_nominal(job)
            _report(name, nominal, motions, pitch_mm)
            if name == "thesis":
                kinds: tuple[tuple[Literal["bull", "flat"], float], ...] = (("bull", 1.5), ("flat", 0.0))
                for kind, corner_mm in kinds:
                    cutter = CutterData(kind, nominal.cutter.radius_mm, corner_mm)
                    _report(f"{name}, {kind}", dataclasses.replace(nominal, cutter=cutter), motions, pitch_mm)


def _report(name: str, nominal: Nominal, motions: Sequence[canon.Motion], pitch_mm: float) -> None:
    _judge(nominal, motions, pitch_mm)
    wall_s, busy_s = time.perf_counter(), time.process_time()
    verdict = _judge(nominal, motions, pitch_mm)
    wall_s, busy_s = time.perf_counter() - wall_s, time.process_time() - busy_s
    net = verdict.maps[0].net
    points, normals = net.points.reshape(-1, 3), net.normals.reshape(-1, 3)
    probe_s, probe_busy_s = time.perf_counter(), time.process_time()
    verdict.probes.measure(points, normals)
    probe_s, probe_busy_s = time.perf_counter() - probe_s, time.process_time() - probe_busy_s
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{name}: {len(motions)} motions, {len(points)} probes at {pitch_mm} mm judged in {wall_s:.2f} s wall,"
        f" {busy_s:.2f} s processor; probes alone {len(points) / probe_s / 1e6:.2f} million/s"
        f" ({len(points) / probe_busy_s / 1e6:.2f} million/s of one processor); peak memory {memory_mb:.0f} MB"
    )


def _judge(nominal: Nominal, motions: Sequence[canon.Motion], pitch_mm: float) -> Verdict:
    return judge(nominal, tool_of(nominal.cutter), motions, reference=nominal.reference, probe_pitch_mm=pitch_mm)


if __name__ == "__main__":
    main()
