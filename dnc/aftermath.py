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
from dnc.places import state_folder


def leave_mark(identity: str, report: dict[str, Any]) -> None:
    """Remember that this port's control may hold bytes of a job that did not end; forget it after a whole one."""
    path = _mark_path(identity)
    with contextlib.suppress(OSError):
        if report["outcome"] in ("SENT", "NOT_STARTED") or report["bytes_sent"] == 0:
            path.unlink(missing_ok=True)
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        keys = ("job", "program", "outcome", "is_block_cut", "bytes_sent", "in_doubt")
        path.write_text(json.dumps({key: report[key] for key in keys}))


def refuse_dirty_control(identity: str, is_yes: bool, was_reset: bool) -> None:
    """Raise JournalMismatch unless the operator says that the control was reset since the last job was cut off."""
    mark = _mark(identity)
    if mark is None or was_reset:
        return
    is_cut = bool(mark.get("is_block_cut", True))
    if is_yes and not is_cut:
        return
    what = f"the last job on this port ended {mark.get('outcome')} and the control may still hold bytes of it"
    if is_cut:
        what += ", the last block cut"
    if sys.stdin.isatty() and click.confirm(f"{what}. Has the control been reset?", default=False, err=True):
        return
    raise JournalMismatch(f"{what}; reset the control, then send with --control-was-reset")


def _mark(identity: str) -> dict[str, Any] | None:
    try:
        found = json.loads(_mark_path(identity).read_text())
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None


def _mark_path(identity: str) -> Path:
    return state_folder() / "ports" / f"{hashlib.sha256(identity.encode()).hexdigest()[:16]}.json"
