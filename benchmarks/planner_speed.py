"""How fast the planner is: fixed passes over the thesis surface and the wave, and pick feeds for a scallop.

Processor seconds of this process, so that other work on the computer counts little; the best of three for short cases.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np

from dnc.shipped import shipped_path
from planner.path.model import DrivingPlane
from planner.path.peaks import Ground
from planner.path.strategy.parallel import Wishes, lay_parallel, prepare
from planner.path.trace import TracedCurve, trace
from planner.plan import plan_job
from planner.post.written import ControlLimits
from planner.report import segments
from planner.shapes import Kind, shape_passes
from planner.surface.load import load_surface

R_MM = 4.0
KINDS: tuple[Kind, ...] = ("poly", "free")


def main() -> None:
    """Print one line a case."""
    (thesis,) = load_surface(shipped_path("surfaces", "thesis"))
    (wave,) = load_surface(shipped_path("surfaces", "wave"))
    job = shipped_path("jobs", "thesis")
    limits = ControlLimits(poly_degree=5)
    report("thesis job 0.08 mm, 1 um, to bytes", 3, lambda: plan_job(Path(job), limits).report["bytes"])
    on_thesis = prepare(thesis, Wishes(R_MM, 0.0, None, 1.0))
    planes = 1.3 + np.arange(49.0)
    for kind in KINDS:
        name = f"thesis, 49 passes 1 mm apart, 1 um, {kind}"
        report(name, 3, lambda: spans(fixed(on_thesis, planes, 1.6, 49.4), 0.001, kind))  # noqa: B023
    for scallop_mm in (0.01, 0.005):
        wishes = Wishes(R_MM, 0.0, scallop_mm, None)
        report(f"thesis, pick feeds for {scallop_mm} mm", 3, lambda: passes(thesis, wishes))  # noqa: B023
    wishes = Wishes(R_MM, 0.0, 0.005, None)
    report("wave, pick feeds for 0.005 mm", 1, lambda: passes(wave, wishes))
    on_wave = prepare(wave, Wishes(R_MM, 0.0, None, 0.5))
    planes = 0.5 * np.arange(601)
    report("wave, 601 passes traced", 1, lambda: len(fixed(on_wave, planes, 1.2, 298.8)))
    for path_mm, kind in product((0.010, 0.001), KINDS):
        name = f"wave, 601 passes, {path_mm} mm, {kind}"
        report(name, 1, lambda: spans(fixed(on_wave, planes, 1.2, 298.8, path_mm), path_mm, kind))  # noqa: B023
    print(f"{'peak memory':45s} {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:8.0f} MB")


def fixed(
    ground: Ground, planes_mm: np.ndarray, start_mm: float, stop_mm: float, path_mm: float = 0.001
) -> list[TracedCurve]:
    """Passes between two places x in planes y = const."""
    runs = np.tile([start_mm, stop_mm], (len(planes_mm), 1))
    planes = [DrivingPlane(0.0, float(y)) for y in planes_mm]
    return trace(
        ground.surface, ground.seeds, planes, runs, spacing_mm=ground.station_mm / 2, accuracy_mm=1e-2 * path_mm
    )


def spans(curves: list[TracedCurve], path_mm: float, kind: Kind) -> int:
    """Spans of all fitted splines."""
    return sum(segments(one.shape) for one in shape_passes(curves, kind, path_mm, R_MM))


def passes(patch: object, wishes: Wishes) -> int:
    """How many passes the pick feeds make."""
    return len(lay_parallel(patch, wishes, accuracy_mm=1e-7).curves)  # type: ignore[arg-type]


def report(name: str, times: int, run: Callable[[], int]) -> None:
    """Time one case and print what it returned."""
    best, result = np.inf, 0
    for _ in range(times):
        begin = time.process_time()
        result = run()
        best = min(best, time.process_time() - begin)
    print(f"{name:45s} {best:8.3f} s   -> {result}", flush=True)


if __name__ == "__main__":
    main()
