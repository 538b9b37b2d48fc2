"""What a job is called."""

from __future__ import annotations

import os
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any


@dataclass(frozen=True, slots=True)
class JobNames:
    """A job's id, the program's file, the machine profile; what a restart was made of, if it is one.

    A rehearsal goes to a mill of its own and tells nothing of any control.
    """

    job_id: str
    program: str
    machine: str
    restart: dict[str, Any] | None = None
    is_rehearsal: bool = False


def new_job_id() -> str:
    """Sortable and unique on this computer: start time and process."""
    return f"{datetime.now(UTC):%Y%m%dT%H%M%S.%f}-{os.getpid()}"
