"""What a program's sidecar says: restart points with their state, and the hash of the bytes they belong to."""

from __future__ import annotations

import hashlib
from typing import Any

from planner.job import Job, Operation

RestartRow = dict[str, Any]


def restart_row(
    *, number: int, block: int | None, line: int, offset_bytes: int, position_mm: list[float], feed_mm_min: float
) -> RestartRow:
    """One pass start: the N word (or None), physical line from 1, byte offset, where the cut begins."""
    return {
        "pass": number,
        "block": block,
        "line": line,
        "offset_bytes": offset_bytes,
        "position_mm": position_mm,
        "feed_mm_min": feed_mm_min,
    }


def sidecar(
    job: Job, operation: Operation, name: str, data: bytes, modal: list[str], rows: list[RestartRow], lift_mm: float
) -> dict[str, Any]:
    """The sidecar as JSON data; `modal` are the codes in force at every restart point."""
    tool = job.tool_of(operation)
    return {
        "schema": "dripmill.sidecar",
        "version": 1,
        "program": name,
        "sha256": hashlib.sha256(data).hexdigest(),
        "control": job.post.control,
        "reference": job.post.reference,
        "radius_mm": tool.radius_mm,
        "path_mm": operation.path_mm,
        "lift_mm": lift_mm,
        "state": {
            "modal": modal,
            "tool": tool.number,
            "edge": tool.edge,
            "spindle_rpm": operation.spindle_rpm,
            "spindle_dwell_s": operation.spindle_dwell_s,
            "coolant": operation.coolant,
            "plunge_mm_min": operation.plunge_mm_min,
            "clearance_z_mm": job.setup.clearance_z_mm,
            "safe_z_mm": job.setup.safe_z_mm,
        },
        "restart_points": rows,
    }
