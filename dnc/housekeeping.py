"""What the sending loop looks after once a second: foreign settings, a nap of the computer, a journal that gave up."""

from __future__ import annotations

import time

from dnc import alarms
from dnc.events import Event
from dnc.journal import Journal
from dnc.port import Port
from dnc.sender import Sender

PERIOD_S = 1.0
_SLEEP_LIMIT_S = 5.0


class Housekeeping:
    """The looks of one job; `due_s` is the moment of the next, which a loop may bring forward."""

    def __init__(self, sender: Sender, port: Port) -> None:
        self.due_s = 0.0
        self._sender, self._port = sender, port
        self._asleep_s = asleep_s()
        self._is_journal_told = False

    def look(self, journal: Journal, now_s: float) -> list[Event]:
        """What is found now, in this order; the journal's trouble is told once."""
        sender = self._sender
        self.due_s = now_s + PERIOD_S
        found: list[Event] = []
        changed = self._port.changed_settings()
        if changed:
            found += sender.disturb(alarms.FOREIGN_SETTINGS, changed, now_s)
        slept_s = asleep_s() - self._asleep_s
        if slept_s > _SLEEP_LIMIT_S:
            found += sender.disturb(alarms.SLEPT, f"{slept_s:.0f} s", now_s)
        self._asleep_s += slept_s
        if journal.problem and not self._is_journal_told:
            self._is_journal_told = True
            found.append(alarms.NO_JOURNAL.at(now_s, sender.offset_bytes, journal.problem))
        return found


def asleep_s() -> float:
    """How long this computer has slept since it started."""
    return time.clock_gettime(time.CLOCK_BOOTTIME) - time.monotonic()
