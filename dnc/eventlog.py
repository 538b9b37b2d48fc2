"""Where the events of a running job go: kept for the report, and handed on, each listener in a thread of its own."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable

from dnc.events import Alarm, Event, Severity

_KEPT_ALARMS = 100
Listener = Callable[[Event], None]


class _Outlet:
    """One listener with its own queue, so that a slow one (a web address) delays no other (the operator's lines)."""

    def __init__(self, listener: Listener) -> None:
        self.queue: queue.SimpleQueue[Event | None] = queue.SimpleQueue()
        self._listener = listener
        self.thread = threading.Thread(target=self._run, name="events", daemon=True)
        self.thread.start()

    def _run(self) -> None:
        while (event := self.queue.get()) is not None:
            self._listener(event)


class EventLog:
    """`add` returns at once; the listeners may be slow.

    The report keeps the first alarm of a kind. Listeners hear a warning once and an alarm each time: the operator who
    resumed must learn why the job has stopped again.
    """

    def __init__(self, listeners: list[Listener]) -> None:
        self.alarms: list[Alarm] = []
        self._seen: set[str] = set()
        self._outlets = [_Outlet(listener) for listener in listeners]

    def add(self, event: Event) -> None:
        """Take an event of the sending loop."""
        if isinstance(event, Alarm):
            if event.id not in self._seen and len(self.alarms) < _KEPT_ALARMS:
                self._seen.add(event.id)
                self.alarms.append(event)
            elif event.severity is not Severity.ALARM:
                return
        for outlet in self._outlets:
            outlet.queue.put(event)

    def close(self, timeout_s: float = 5.0) -> None:
        """Let the listeners finish, but not for ever."""
        until_s = time.monotonic() + timeout_s
        for outlet in self._outlets:
            outlet.queue.put(None)
        for outlet in self._outlets:
            outlet.thread.join(max(0.0, until_s - time.monotonic()))
