"""What the control said that meant nothing, kept with the job: up to a limit, never obeyed, never shown raw."""

from __future__ import annotations

import contextlib
from pathlib import Path

from dnc.events import Event, Noise


class Capture:
    """A listener that appends bytes without meaning to a file, up to `limit_bytes`."""

    def __init__(self, path: Path, limit_bytes: int) -> None:
        self._path, self._left_bytes = path, limit_bytes

    def __call__(self, event: Event) -> None:
        """Keep the bytes of a Noise event."""
        if isinstance(event, Noise) and self._left_bytes > 0:
            data = event.data[: self._left_bytes]
            self._left_bytes -= len(data)
            with contextlib.suppress(OSError), self._path.open("ab") as file:
                file.write(data)
