"""The door of this room: a tool path and a control's limits become a program, its rounding and its restart points."""

from __future__ import annotations

from planner.errors import InputRejected
from planner.job import Job, Operation
from planner.path.model import ToolPath
from planner.post.sinumerik import write_sinumerik
from planner.post.written import ControlLimits, Written


def write_program(
    job: Job, operation: Operation, tool_path: ToolPath, control: ControlLimits, *, lift_mm: float = 0.0
) -> Written:
    """The program of one operation for the job's control; `lift_mm` raises the whole frame for an air cut.

    Raises InputRejected with one sentence where this control, these blocks or this name cannot be written.
    """
    if not tool_path.passes:
        raise InputRejected("the tool path has no pass", remedy="check that the passes meet the part")
    if job.post.control == "sinumerik-840d":
        return write_sinumerik(job, operation, tool_path, control, lift_mm=lift_mm)
    raise InputRejected(
        f"post.control {job.post.control} is not built yet", remedy='use "sinumerik-840d"', key=("post", "control")
    )
