"""Who may act: one watcher at a time holds the lease, the others look on."""

from __future__ import annotations

import json
from collections.abc import Callable

from dnc.events import JobState
from dnc.stream import Command

_ORDERS = {"pause": Command.PAUSE, "resume": Command.RESUME, "abort": Command.ABORT}

_UNDER_WAY = frozenset({JobState.ARMED, JobState.SENDING, JobState.HELD})
_FOR = {
    Command.PAUSE: _UNDER_WAY,
    Command.RESUME: frozenset({JobState.PAUSED}),
    Command.ABORT: _UNDER_WAY | {JobState.PAUSED, JobState.DRAINING},
}


class Lease:
    """Takes orders as JSON lines: {"do": "lease"}, then {"do": "pause"}, "resume", "abort"; {"do": "release"}."""

    def __init__(self, command: Callable[[Command], None], state: Callable[[], JobState]) -> None:
        self._command, self._state = command, state
        self._holder: int | None = None

    @property
    def is_held(self) -> bool:
        """Whether somebody may act now."""
        return self._holder is not None

    def release(self, watcher: int) -> None:
        """This watcher has gone or gives the lease back."""
        if self._holder == watcher:
            self._holder = None

    def order(self, watcher: int, line: bytes) -> dict[str, object]:
        """Obey one line and say what became of it."""
        try:
            values = json.loads(line)
            wanted = values["do"]
        except (ValueError, KeyError, TypeError, RecursionError):
            return {"answer": "refused", "why": 'an order is one line such as {"do": "pause"}'}
        if wanted == "lease":
            if self._holder not in (None, watcher):
                return {"answer": "refused", "why": "another console holds the lease"}
            self._holder = watcher
            return {"answer": "ok", "do": wanted}
        if self._holder != watcher:
            return {"answer": "refused", "why": 'take the lease first: {"do": "lease"}'}
        if wanted == "release":
            self.release(watcher)
            return {"answer": "ok", "do": wanted}
        command = _ORDERS.get(wanted) if isinstance(wanted, str) else None
        if command is None:
            return {"answer": "refused", "why": f"orders are {', '.join(_ORDERS)}"}
        state = self._state()
        if state not in _FOR[command]:
            return {"answer": "refused", "why": f"{wanted} changes nothing while the job is {state.value}"}
        self._command(command)
        return {"answer": "ok", "do": wanted}
