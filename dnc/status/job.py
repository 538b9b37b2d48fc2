"""Watches the running job over its Unix socket, and passes orders to it; the other end is `dnc.service`.

Watching changes nothing: the job neither knows nor cares when a watcher dies.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_LINE_LIMIT_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class JobReading:
    """The newest snapshot, its age, and whether the job's process still publishes."""

    snapshot: dict[str, Any]
    age_s: float
    is_attached: bool


class JobWatcher:
    """Attaches to the newest job of a folder and stays with it; goes on to the next job when that one has ended."""

    def __init__(self, folder: Path, retry_s: float = 0.5, monotonic: Callable[[], float] = time.monotonic) -> None:
        self.folder = folder
        self.retry_s = retry_s
        self.answer = ""
        self._monotonic = monotonic
        self._snapshot: dict[str, Any] | None = None
        self._read_s = 0.0
        self._followed: object = None
        self._writer: asyncio.StreamWriter | None = None
        self._heard = asyncio.Event()

    def reading(self) -> JobReading | None:
        """What is known of the job; None if there never was one."""
        if self._snapshot is None:
            return None
        return JobReading(self._snapshot, self._monotonic() - self._read_s, self._followed is not None)

    @property
    def job(self) -> object:
        """The id of the job that is known and publishes now; None without one."""
        return self._followed

    async def wait_for_snapshot(self, timeout_s: float) -> None:
        """Until the next snapshot has come."""
        self._heard.clear()
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._heard.wait(), timeout_s)

    def order(self, what: str, job: object) -> bool:
        """Take the lease and give an order (pause, resume, abort) to this job; False if it is not there any more."""
        if self._writer is None or job is None or job != self._followed:
            return False
        self.answer = ""
        for verb in ("lease", what, "release"):
            self._writer.write(json.dumps({"do": verb}).encode() + b"\n")
        return True

    async def run(self) -> None:
        """Attach, read, attach again, until cancelled."""
        while True:
            for path in newest_first(self.folder):
                with contextlib.suppress(OSError):
                    await self._follow(path)
                    break
            await asyncio.sleep(self.retry_s)

    async def _follow(self, path: Path) -> None:
        reader, writer = await _connect(path)
        self._writer = writer
        try:
            while line := await reader.readline():
                self._hear(line)
        except ValueError:
            return
        finally:
            self._writer = self._followed = None
            writer.close()

    def _hear(self, line: bytes) -> None:
        try:
            values = json.loads(line)
        except ValueError:
            return
        if not isinstance(values, dict):
            return
        if "answer" in values:
            if values["answer"] != "ok":
                self.answer = str(values.get("why", "refused"))
            return
        self._snapshot, self._read_s, self._followed = values, self._monotonic(), values.get("job")
        self._heard.set()


async def _connect(path: Path) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """Connect by the folder's descriptor: the path of a socket may hold 107 bytes only, a user's folders more."""
    folder = os.open(path.parent, os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        return await asyncio.open_unix_connection(f"/proc/self/fd/{folder}/{path.name}", limit=_LINE_LIMIT_BYTES)
    finally:
        os.close(folder)


def newest_first(folder: Path) -> list[Path]:
    """The sockets of this folder, newest first."""
    found: list[tuple[float, Path]] = []
    with contextlib.suppress(OSError):
        for path in folder.glob("job-*.sock"):
            with contextlib.suppress(OSError):
                found.append((path.stat().st_mtime, path))
    return [path for _, path in sorted(found, reverse=True)]
