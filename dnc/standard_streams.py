"""stdin, stdout and stderr as every command may rely on them, whatever the shell or a full disk has made of them."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from typing import Any


def open_standard_streams() -> None:
    """The null device for those that are closed: a port would get their number, and messages would go to the mill."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            os.dup2(os.open(os.devnull, os.O_RDWR), number)
            if name != "stderr":
                setattr(sys, name, os.fdopen(number, "r" if number == 0 else "w"))
    sys.stderr = io.TextIOWrapper(
        io.BufferedWriter(_Lossy(2, "w", closefd=False)),
        encoding=getattr(sys.stderr, "encoding", "utf-8"),
        errors="backslashreplace",
        line_buffering=True,
    )


class _Lossy(io.FileIO):
    """What stderr cannot take is lost: no full disk or gone reader behind it may end a job or change its exit code."""

    def write(self, data: Any, /) -> int:
        """As a file does, but what meets an error, or would have to wait where nothing may, counts as written."""
        written: int | None = None
        with contextlib.suppress(OSError):
            written = super().write(data)
        return len(data) if written is None else written
