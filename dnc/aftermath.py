"""What the last job left in the control: after a stop in the middle, the next start asks for a reset of the control."""

from __future__ import annotations

import contextlib
import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import click

from dnc.errors import JournalMismatch
from dnc.places import state_folder, write_whole


def begin_mark(identity: str, job: str, program: str) -> None:
    """Before the first byte: from here on the control may hold bytes of this job, whatever becomes of this process.

    What an earlier job left is kept inside, until it is known whether this one sent anything. Raises OSError.
    """
    before = _mark(identity)
    if before is not None:
        before.pop("before", None)
    _write_mark(identity, {"job": job, "program": program, "outcome": "INTERRUPTED", "before": before})


def leave_mark(identity: str, report: dict[str, Any]) -> None:
    """Remember that this port's control may hold bytes of a job that did not end; forget it after a whole one.

    A job that sent nothing leaves what was known before it. Raises OSError; the mark is then that of `begin_mark`.
    """
    mark: dict[str, Any] | None = None
    if report["bytes_sent"] == 0 or report["outcome"] == "NOT_STARTED":
        mark = (_mark(identity) or {}).get("before")
    elif report["outcome"] != "SENT":
        keys = ("job", "program", "outcome", "is_block_cut", "bytes_sent", "in_doubt")
        mark = {key: report[key] for key in keys}
    if mark is None:
        _mark_path(identity).unlink(missing_ok=True)
    else:
        _write_mark(identity, mark)


def refuse_dirty_control(identity: str, is_yes: bool, was_reset: bool) -> None:
    """Raise JournalMismatch unless the operator says that the control was reset since the last job was cut off."""
    mark = _mark(identity)
    if mark is None:
        return
    if was_reset:
        _forget(identity)
        return
    is_cut = bool(mark.get("is_block_cut", True))
    if is_yes and not is_cut:
        return
    what = f"the last job on this port ended {mark.get('outcome')} and the control may still hold bytes of it"
    if is_cut:
        what += ", the last block cut"
    if sys.stdin.isatty() and click.confirm(f"{what}. Has the control been reset?", default=False, err=True):
        _forget(identity)
        return
    raise JournalMismatch(f"{what}; reset the control, then send with --control-was-reset")


def _forget(identity: str) -> None:
    with contextlib.suppress(OSError):
        _mark_path(identity).unlink(missing_ok=True)


def _write_mark(identity: str, mark: dict[str, Any]) -> None:
    path = _mark_path(identity)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, json.dumps(mark), to_disk=True)


def _mark(identity: str) -> dict[str, Any] | None:
    """What stands for this port; a mark that cannot be read is one all the same."""
    try:
        found = json.loads(_mark_path(identity).read_text())
    except FileNotFoundError:
        return None
    except (OSError, ValueError):
        found = None
    return found if isinstance(found, dict) else {"outcome": "in a way that cannot be read any more"}


def _mark_path(identity: str) -> Path:
    return state_folder() / "ports" / f"{hashlib.sha256(identity.encode()).hexdigest()[:16]}.json"
