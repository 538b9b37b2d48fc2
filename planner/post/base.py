"""The door of this room: a tool path and a control's limits become a program, its rounding and its restart points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from planner.errors import InputRejected
from planner.job import Job, Operation
from planner.path.model import Array, ToolPath


@dataclass(frozen=True, slots=True)
class ControlLimits:
    """What the post must know of the control that will read the program.

    `decimals` is the most decimals the control reads, None for no limit; `retract_z_mm` the machine (not work) height
    of a safe tool change, None where the program must not move to one; `min_spline_blocks` the least number of
    successive BSPLINE blocks; `knot_rule_verified` whether somebody proved the knot rule at this control. With
    `is_inch` the program is in inches, and `decimals` counts those of inches.
    """

    resolution_mm: float = 0.001
    decimals: int | None = None
    min_spline_blocks: int = 6
    knot_rule: Literal["nx", "genua"] = "nx"
    knot_rule_verified: bool = False
    retract_z_mm: float | None = None
    has_tool_changer: bool = True
    is_inch: bool = False


@dataclass(frozen=True, slots=True)
class Written:
    """A program with its counts.

    `blocks` counts blocks with words; the cutting ones run along passes, plunges and retracts not among them, and
    `cutting_bytes` holds their line ends. `rounding_mm` is what the numbers add to the deviation of the worst pass: no
    pass as written is further from its exact curve, anywhere, than the largest deviation of all plus `rounding_mm`.
    `sidecar` is JSON data: restart points, each with block, position and modal state. `warnings` are sentences.
    """

    data: bytes
    blocks: int
    cutting_blocks: int
    cutting_bytes: int
    rounding_mm: float
    sidecar: dict[str, Any]
    warnings: tuple[str, ...] = ()


def write_program(
    job: Job, operation: Operation, tool_path: ToolPath, control: ControlLimits, *, lift_mm: float = 0.0
) -> Written:
    """The program of one operation for the job's control; `lift_mm` raises the whole frame for an air cut.

    Raises InputRejected with one sentence where this control, these blocks or this name cannot be written.
    """
    if not tool_path.passes:
        raise InputRejected("the tool path has no pass", remedy="check that the passes meet the part")
    if job.post.control == "sinumerik-840d":
        from planner.post.sinumerik import write_sinumerik

        return write_sinumerik(job, operation, tool_path, control, lift_mm=lift_mm)
    raise InputRejected(f"post.control {job.post.control} is not built yet", remedy='use "sinumerik-840d"')


def rounding_budgets_mm(path_mm: float, tool_path: ToolPath) -> Array:
    """What the numbers may add to each pass (passes,), mm: what its deviation left of `path_mm`, at least a tenth."""
    deviations_mm = np.array([one.deviation_mm for one in tool_path.passes])
    return np.maximum(0.1 * path_mm, path_mm - deviations_mm)
