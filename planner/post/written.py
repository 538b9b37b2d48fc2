"""What every post is given and gives back: the control's limits, and the program with its counts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from planner.path.model import Array, ToolPath


@dataclass(frozen=True, slots=True)
class ControlLimits:
    """What the post must know of the control that will read the program.

    `decimals` is the most decimals the control reads, None for no limit; `retract_z_mm` the machine (not work) height
    of a safe tool change, None where the program must not move to one; `min_spline_blocks` the least number of
    successive BSPLINE blocks; `knot_rule_verified` whether somebody proved the knot rule at this control;
    `poly_degree` the highest degree of POLY it is known to read. With `is_inch` the program is in inches, and
    `decimals` counts those of inches.
    """

    resolution_mm: float = 0.001
    decimals: int | None = None
    min_spline_blocks: int = 6
    knot_rule: Literal["nx", "genua"] = "nx"
    knot_rule_verified: bool = False
    poly_degree: int = 3
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


def rounding_budgets_mm(path_mm: float, tool_path: ToolPath) -> Array:
    """What the numbers may add to each pass (passes,), mm: what its deviation left of `path_mm`, at least a tenth."""
    deviations_mm = np.array([one.deviation_mm for one in tool_path.passes])
    return np.maximum(0.1 * path_mm, path_mm - deviations_mm)
