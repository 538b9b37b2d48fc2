"""What a job is called."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

_TIME = "%Y%m%dT%H%M%S.%f"


@dataclass(frozen=True, slots=True)
class JobNames:
    """A job's id, the program's file, the machine profile; what a restart was made of, if it is one.

    A rehearsal goes to a mill of its own and tells nothing of any control; that mill's status is at `mill_modbus`,
    host:port.
    """

    job_id: str
    program: str
    machine: str
    restart: dict[str, Any] | None = None
    is_rehearsal: bool = False
    mill_modbus: str = ""


def new_job_id(known: Iterable[str], now: datetime | None = None) -> str:
    """Unique on this computer, and sorted behind all `known` ones: start time and process.

    A clock that was set back would put this job before those that it followed, and a resume would take one of them:
    then the id's time is that of the latest one, and a little.

    >>> new_job_id(["20260102T000000.000000-7"], datetime(2026, 1, 1, tzinfo=UTC)).split("-")[0]
    '20260102T000000.000001'
    """
    time = datetime.now(UTC) if now is None else now
    for job in known:
        with contextlib.suppress(ValueError, OverflowError):
            started = datetime.strptime(f"{job.partition('-')[0]}+0000", f"{_TIME}%z")
            time = max(time, started + timedelta(microseconds=1))
    return f"{time:{_TIME}}-{os.getpid()}"
