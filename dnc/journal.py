"""The journal: what may have left the host, durable before it leaves.

Records of 64 bytes, each with its own check sum, appended and synced by a thread of its own. Every record holds an
upper bound of the bytes that may leave before the next record is durable; the stream never sends beyond it. After a
power cut the last good record therefore bounds what the control can have received.
"""

from __future__ import annotations

import errno
import os
import struct
import threading
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dnc.errors import JournalMismatch
from dnc.events import JobState

_LAYOUT = struct.Struct("<4sHHI16sQQddI")
_MAGIC = b"DNCJ"
_VERSION = 1
_STATES = tuple(JobState)
RECORD_BYTES = _LAYOUT.size
UNBOUNDED = 1 << 62


@dataclass(frozen=True, slots=True)
class Record:
    """One line of the journal: `sent_bytes` had left, at most `bound_bytes` could leave before the next record."""

    seq: int
    state: JobState
    job: bytes
    sent_bytes: int
    bound_bytes: int
    monotonic_s: float
    wall_s: float

    def packed(self) -> bytes:
        """The 64 bytes, check sum last."""
        state = _STATES.index(self.state)
        head = (_MAGIC, _VERSION, state, self.seq, self.job, self.sent_bytes, self.bound_bytes)
        body = _LAYOUT.pack(*head, self.monotonic_s, self.wall_s, 0)[:-4]
        return body + struct.pack("<I", zlib.crc32(body))


def unpacked(data: bytes) -> Record | None:
    """The record in these 64 bytes, or None if they are torn."""
    if len(data) != RECORD_BYTES or zlib.crc32(data[:-4]) != struct.unpack("<I", data[-4:])[0]:
        return None
    magic, version, state, seq, job, sent, bound, monotonic_s, wall_s, _ = _LAYOUT.unpack(data)
    if magic != _MAGIC or version != _VERSION or state >= len(_STATES):
        return None
    return Record(seq, _STATES[state], job, sent, bound, monotonic_s, wall_s)


def read_journal(path: Path) -> list[Record]:
    """All records up to the first torn one; raises JournalMismatch if there is none."""
    try:
        data = path.read_bytes()
    except OSError as problem:
        raise JournalMismatch(f"{path}: the journal cannot be read: {problem.strerror}") from None
    records = []
    for at in range(0, len(data), RECORD_BYTES):
        record = unpacked(data[at : at + RECORD_BYTES])
        if record is None:
            break
        records.append(record)
    if not records:
        raise JournalMismatch(f"{path}: the journal holds no whole record of this version")
    return records


class Journal:
    """Writes ahead in its own thread; the sending loop only calls `note` and reads `bound_bytes`."""

    def __init__(self, path: Path, sha256: str, ahead_bytes: int, on_progress: Callable[[], None]) -> None:
        self.bound_bytes = 0
        self.problem = ""
        self._path = path
        self._job = bytes.fromhex(sha256)[:16]
        self._ahead_bytes = max(1, ahead_bytes)
        self._on_progress = on_progress
        self._sent_bytes, self._state = 0, JobState.LOADED
        self._ask_at_bytes = 0
        self._seq = 0
        self._written: tuple[int, JobState] | None = None
        self._fd = -1
        self._wake = threading.Event()
        self._is_closing = False
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)

    def open(self, sent_bytes: int = 0) -> None:
        """Create the file, make the first bound durable, start the thread; a full disk becomes `problem`."""
        self._sent_bytes = sent_bytes
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._fd = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o640)
        except OSError as problem:
            self._give_up(problem)
            return
        self._write()
        self._thread.start()

    def note(self, sent_bytes: int, state: JobState) -> None:
        """The loop's word: this much has left. Wakes the thread when the bound comes near or the state changed."""
        self._sent_bytes = sent_bytes
        if state is not self._state or sent_bytes >= self._ask_at_bytes:
            self._state = state
            self._ask_at_bytes = UNBOUNDED
            self._wake.set()

    def close(self, sent_bytes: int, state: JobState) -> None:
        """Write the last record and stop the thread; waits at most 2 s for a stalled disk."""
        self._sent_bytes, self._state, self._is_closing = sent_bytes, state, True
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(2.0)

    def _run(self) -> None:
        is_last = False
        while not is_last and not self.problem:
            self._wake.wait(1.0)
            self._wake.clear()
            is_last = self._is_closing
            if is_last or (self._sent_bytes, self._state) != self._written:
                self._write()
                self._on_progress()
        os.close(self._fd)

    def _write(self) -> None:
        sent, state = self._sent_bytes, self._state
        bound = sent + self._ahead_bytes
        now_s, wall_s = time.monotonic(), time.time()
        record = Record(self._seq, state, self._job, sent, max(bound, self.bound_bytes), now_s, wall_s)
        try:
            if os.write(self._fd, record.packed()) < RECORD_BYTES:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fdatasync(self._fd)
        except OSError as problem:
            self._give_up(problem)
            return
        self._seq += 1
        self._written = (sent, state)
        self.bound_bytes = record.bound_bytes
        self._ask_at_bytes = sent + self._ahead_bytes // 2

    def _give_up(self, problem: OSError) -> None:
        self.problem = problem.strerror or "unknown"
        self.bound_bytes = UNBOUNDED
