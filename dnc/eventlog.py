"""Where the events of a running job go: kept for the report, and handed on, each listener in a thread of its own."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Callable

from dnc.events import Alarm, Event, Severity, StateChanged

_KEPT_ALARMS = 100
_PATIENCE_S = 5.0
_LAST_S = 16.0
_LAST_EVENTS = 3
"""The alarm that ended a job, its last change of state, a port that did not close."""
Listener = Callable[[Event], None]


class _Outlet:
    """One listener with its own queue, so that a slow one (a web address) delays no other (the operator's lines)."""

    def __init__(self, listener: Listener) -> None:
        self.queue: queue.SimpleQueue[Event | None] = queue.SimpleQueue()
        self._listener = listener
        self.thread = threading.Thread(target=self._run, name="events", daemon=True)
        self.thread.start()

    def forget_all_but_the_last(self) -> int:
        """For a listener that is behind when the job is over; returns how many events it will not hear."""
        waiting: list[Event] = []
        with contextlib.suppress(queue.Empty):
            while (event := self.queue.get_nowait()) is not None:
                waiting.append(event)
        last = [event for event in waiting if isinstance(event, Alarm | StateChanged)][-_LAST_EVENTS:]
        for event in [*last, None]:
            self.queue.put(event)
        return len(waiting) - len(last)

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

    def close(self, patience_s: float = _PATIENCE_S, last_s: float = _LAST_S) -> int:
        """Let the listeners finish, but not for ever; returns how many events one of them did not hear.

        Who has not heard all after `patience_s` gets the last events only, and `last_s` for them.
        """
        for outlet in self._outlets:
            outlet.queue.put(None)
        self._join(patience_s)
        unheard = sum(outlet.forget_all_but_the_last() for outlet in self._outlets if outlet.thread.is_alive())
        self._join(last_s)
        # The end mark that still waits stands for the event under way.
        return unheard + sum(outlet.queue.qsize() for outlet in self._outlets if outlet.thread.is_alive())

    def _join(self, timeout_s: float) -> None:
        until_s = time.monotonic() + timeout_s
        for outlet in self._outlets:
            outlet.thread.join(max(0.0, until_s - time.monotonic()))
