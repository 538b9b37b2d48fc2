"""The planner's sidecar as a restart reads it: heights, tool, restart points, the hash of the bytes they belong to."""

from __future__ import annotations

from pathlib import Path

import msgspec

from dnc.errors import JournalMismatch


class State(msgspec.Struct, frozen=True):
    """The state at every pass start."""

    tool: int
    plunge_mm_min: float
    clearance_z_mm: float
    safe_z_mm: float
    spindle_dwell_s: float


class Point(msgspec.Struct, frozen=True):
    """A pass start: its N word, or None, and its physical line from 1."""

    line: int
    block: int | None = None


class Sidecar(msgspec.Struct, frozen=True):
    """What a restart needs of it; further keys are not its business."""

    sha256: str
    radius_mm: float
    state: State
    restart_points: tuple[Point, ...]


def load_sidecar(program: Path) -> Sidecar:
    """The sidecar beside a program; raises JournalMismatch where there is none or it cannot be read."""
    path = program.with_name(program.name + ".json")
    again = "plan the program again, or send it from its start"
    try:
        return msgspec.json.decode(path.read_bytes(), type=Sidecar)
    except OSError:
        what = "a restart needs the planner's sidecar (heights, restart points)"
        raise JournalMismatch(f"{path}: {what}; {again}") from None
    except (msgspec.DecodeError, UnicodeDecodeError) as problem:
        what = f"the planner's sidecar cannot be read: {problem}"
        raise JournalMismatch(f"{path}: {what}; {again}") from None
