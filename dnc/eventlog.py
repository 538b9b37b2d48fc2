"""Where the events of a running job go: kept for the report, printed and handed on by a thread of its own."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

from dnc.events import Alarm, Event

_KEPT_ALARMS = 100
Listener = Callable[[Event], None]


class EventLog:
    """`add` returns at once; the listeners run in a thread and may be slow. The first alarm of a kind is kept."""

    def __init__(self, listeners: list[Listener]) -> None:
        self.alarms: list[Alarm] = []
        self._seen: set[str] = set()
        self._listeners = listeners
        self._queue: queue.SimpleQueue[Event | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="events", daemon=True)
        self._thread.start()

    def add(self, event: Event) -> None:
        """Take an event of the sending loop."""
        if isinstance(event, Alarm):
            if event.id in self._seen or len(self.alarms) >= _KEPT_ALARMS:
                return
            self._seen.add(event.id)
            self.alarms.append(event)
        self._queue.put(event)

    def close(self, timeout_s: float = 5.0) -> None:
        """Let the listeners finish, but not for ever."""
        self._queue.put(None)
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while (event := self._queue.get()) is not None:
            for listener in self._listeners:
                listener(event)
