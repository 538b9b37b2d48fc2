"""The virtual mill as a child process, for `dnc send --dry-run`; it sees only the bytes on its pty."""

from __future__ import annotations

import contextlib
import json
import select
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dnc.errors import PortUnavailable

_READY_S = 30.0
_END_S = 5.0


@contextlib.contextmanager
def rehearsal_mill(machine: str, speed: float, programs: Path, job: Path | None = None) -> Iterator[tuple[str, int]]:
    """Start `dnc mill` and give its pty and effective baud rate; ends it afterwards.

    `programs` is the folder of the subprograms that it has in its memory, `job` tells it the tool radii.
    """
    words = [
        sys.executable,
        "-m",
        "dnc",
        "mill",
        "--machine",
        machine,
        "--speed",
        str(speed),
        "--programs",
        str(programs),
    ]
    words += [] if job is None else ["--nominal", str(job)]
    child = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, start_new_session=True)
    try:
        ready = _first_line(child)
        yield str(ready["pty"]), round(float(ready["effective_baud"]))
    finally:
        _end(child)


def _first_line(child: subprocess.Popen[bytes]) -> dict[str, Any]:
    assert child.stdout is not None
    readable, _, _ = select.select([child.stdout], [], [], _READY_S)
    line = child.stdout.readline() if readable else b""
    try:
        ready = json.loads(line)
        return {"pty": ready["pty"], "effective_baud": ready["effective_baud"]}
    except (ValueError, KeyError, TypeError):
        raise PortUnavailable("the virtual mill did not start; run dnc mill to see why") from None


def _end(child: subprocess.Popen[bytes]) -> None:
    child.terminate()
    try:
        child.wait(_END_S)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()
    if child.stdout is not None:
        child.stdout.close()
