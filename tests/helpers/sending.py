"""What the tests of `dnc send` share: a program, the report against its schema, a look at the running job."""

from __future__ import annotations

import json
import signal
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema

from tests.helpers.line import runtime_of

SCHEMA = json.loads((Path(__file__).parents[2] / "docs/schemas/send.schema.json").read_text())
FAST = "--baud=38400"


def program_at(folder: Path, blocks: int = 100, end: bytes = b"M30\n") -> Path:
    path = folder / "part.mpf"
    path.write_bytes(b"".join(b"N%d G1 X%d.%03d\n" % (n * 10, n, n) for n in range(1, blocks + 1)) + end)
    return path


def checked(report: dict[str, object]) -> dict[str, object]:
    jsonschema.validate(report, SCHEMA)
    return report


def only_alarm(report: dict[str, object]) -> str:
    """The id of the one alarm of this job; it must say what it means and what to do."""
    (alarm,) = report["alarms"]  # type: ignore[misc]
    assert alarm["text"]
    assert alarm["remedy"]
    return str(alarm["id"])


def wait_for_pausing(folder: Path) -> None:
    """Watch the job's socket until a pause has been asked for, or the job has come to rest."""
    wait_for(folder, lambda values: bool(values["is_pausing"]) or values["state"] not in ("SENDING", "HELD"))


def wait_for_state(folder: Path, *wanted: str, sent: int = 1) -> dict[str, Any]:
    """Watch the job's socket until it is in one of these states with this many bytes sent."""
    return wait_for(folder, lambda values: values["state"] in wanted and values["bytes_sent"] >= sent)


def wait_for(folder: Path, is_so: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Watch the job's socket until this is so of what it tells."""
    sockets = runtime_of(folder) / "dnc"
    for _ in range(2000):
        found = list(sockets.glob("job-*.sock")) if sockets.is_dir() else []
        if found:
            break
        signal.sigtimedwait([], 0.01)
    with socket.socket(socket.AF_UNIX) as watcher:
        watcher.settimeout(20)
        watcher.connect(str(found[0]))
        with watcher.makefile("rb") as lines:
            for line in lines:
                values = json.loads(line)
                assert isinstance(values, dict)
                if is_so(values):
                    return values
    raise AssertionError("the job never came so far")
