"""A port that fails or hangs in a chosen way, for the loop that must say so."""

from __future__ import annotations

import os

from dnc.port import Flow

PROGRAM = b"G1 X1\n" * 400 + b"M30\n%\n"


class BrokenPort:
    """A port that fails in a chosen way at its first write."""

    name = identity = "broken"
    flow = Flow.BYTES
    is_simulated = True
    is_bound_assured = True

    def __init__(self, fails: Exception) -> None:
        self._read, self._write = os.pipe()
        self.fails = fails
        self.is_purged = False

    def fileno(self) -> int:
        return self._read

    def hear(self, data: bytes) -> None:
        os.write(self._write, data)

    def read(self) -> bytes:
        return os.read(self._read, 100)

    def write(self, data: bytes) -> int:
        raise self.fails

    def queued_bytes(self) -> int:
        return 0

    def changed_settings(self) -> str:
        return ""

    def purge(self) -> None:
        self.is_purged = True

    def close(self) -> bool:
        os.close(self._read)
        os.close(self._write)
        return True
