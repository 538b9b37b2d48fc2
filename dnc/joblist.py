"""Jobs of the past: the append-only record, and journals of jobs that were cut off without a word."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dnc.errors import JournalMismatch
from dnc.journal import read_journal

_ENDS = frozenset({"SENT", "ABORTED", "FAULTED"})
_STARTTIME = 19
"""proc(5): field 22 of /proc/pid/stat, counted from the one behind the name; in clock ticks since boot."""
_TICK_S = 0.1
_RECORDED_ENDS = _ENDS | {"PAUSED", "NOT_STARTED"}  # by SIGTERM, or before the first byte


@dataclass(frozen=True, slots=True)
class PastJob:
    """One job; `values` is its report, or what the journal of an interrupted one still says."""

    job: str
    outcome: str
    values: dict[str, Any]


def past_jobs(state: Path) -> list[PastJob]:
    """All jobs, oldest first; a journal without a record is INTERRUPTED, or RUNNING if its process lives.

    A record of a job that a fault of ours ended in its course counts as none.
    """
    recorded = [PastJob(values["job"], values["outcome"], values) for values in _records(state)]
    known = {past.job: past for past in recorded if past.outcome in _RECORDED_ENDS}
    journals = [journal for journal in (state / "jobs").glob("*/journal") if journal.parent.name not in known]
    unended = {past.job: replace(past, outcome="INTERRUPTED") for past in recorded if past.job not in known}
    found = known | unended | {journal.parent.name: _unrecorded(journal) for journal in journals}
    return sorted(found.values(), key=lambda past: past.job)


def known_ids(state: Path) -> set[str]:
    """The ids of all jobs that left anything behind."""
    return {str(values["job"]) for values in _records(state)} | {folder.name for folder in (state / "jobs").glob("*")}


def first_broken_link(state: Path) -> int | None:
    """The first line of the record whose chain to the line before is broken; None if the record is whole."""
    previous = b""
    for number, line in enumerate(_lines(state), start=1):
        try:
            stated = json.loads(line)["previous"]
        except (ValueError, KeyError, TypeError):
            return number
        if stated != (hashlib.sha256(previous).hexdigest() if previous else ""):
            return number
        previous = line
    return None


def require_readable(state: Path) -> None:
    """Raises JournalMismatch where there is a record that nobody can look into: it is neither empty nor whole."""
    path = state / "records.jsonl"
    try:
        path.open("rb").close()
    except FileNotFoundError:
        return
    except OSError as problem:
        what = f"{path}: the record of jobs cannot be read: {problem.strerror}"
        raise JournalMismatch(f"{what}; check its rights, or set XDG_STATE_HOME to a folder of yours") from None


def require_traces(state: Path) -> None:
    """Raises JournalMismatch where the last job may have left no trace that can be read: an older one would look last.

    A job that cannot write here is sent all the same, with a warning.
    """
    require_readable(state)
    remedy = "a later job may be hidden; use --start-at and the block that the control shows"
    for path, is_of_kind in (
        (state, Path.is_dir),
        (state / "jobs", Path.is_dir),
        (state / "records.jsonl", Path.is_file),
    ):
        if path.exists() and not (is_of_kind(path) and os.access(path, os.W_OK)):
            raise JournalMismatch(f"{path} cannot be written, so jobs leave no trace there; {remedy}")
    unread = unread_lines(state)
    if unread:
        raise JournalMismatch(f"{state}/records.jsonl: lines that nobody can read: {unread}; {remedy}")


def unread_lines(state: Path) -> int:
    """How many lines of the record nobody can read: a job each that no list shows."""
    return len(_lines(state)) - len(_records(state))


def _lines(state: Path) -> list[bytes]:
    try:
        return (state / "records.jsonl").read_bytes().split(b"\n")[:-1]
    except OSError:
        return []


def _records(state: Path) -> list[dict[str, Any]]:
    records = []
    for line in _lines(state):
        try:
            values = json.loads(line)
        except ValueError:
            continue
        if isinstance(values, dict) and all(isinstance(values.get(key), str) for key in ("job", "outcome")):
            records.append(values)
    return records


def about_of(state: Path, job: str) -> dict[str, Any]:
    """What a job said of itself before its first byte; empty where that is lost, or an older dnc said nothing."""
    with contextlib.suppress(OSError, ValueError):
        found = json.loads((state / "jobs" / job / "job.json").read_text())
        return found if isinstance(found, dict) else {}
    return {}


def _unrecorded(journal: Path) -> PastJob:
    job = journal.parent.name
    about = about_of(journal.parents[2], job)
    try:
        lines = read_journal(journal)
    except JournalMismatch as problem:
        return PastJob(job, "INTERRUPTED", {**about, "note": str(problem)})
    last = lines[-1]
    is_alive = _is_ours(job.rpartition("-")[2], lines[0].monotonic_s) and last.state.value not in _ENDS
    values = {**about, "bytes_sent": last.sent_bytes, "bound_bytes": last.bound_bytes, "state": last.state.value}
    return PastJob(job, "RUNNING" if is_alive else "INTERRUPTED", values)


def _is_ours(pid: str, begun_s: float) -> bool:
    """Whether this process lives, is a dnc and is older than a journal that began at this monotonic time.

    After a power cut its number may have gone to another program, and in a container each dnc has the same one.
    """
    try:
        if not pid.isdigit() or b"dnc" not in Path(f"/proc/{pid}/cmdline").read_bytes():
            return False
        ticks = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[_STARTTIME])
    except (OSError, ValueError, IndexError):
        return False
    age_s = time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    return 0.0 <= time.monotonic() - begun_s <= age_s + _TICK_S
