"""The figures of one job: bytes, holds, how far bytes ran on after XOFF, how full the line was."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from statistics import median

from dnc.events import JobState

_RUN_BYTES = 50
_RUNS_KEPT = 4096
_STOPS_KEPT = 2000


@dataclass(slots=True)
class Tally:
    """Counters that the sender keeps; times in seconds on the monotonic clock."""

    byte_s: float
    bytes_sent: int = 0
    xoff_count: int = 0
    masked_xoff_count: int = 0
    unasked_xon_count: int = 0
    noise_bytes: int = 0
    inflight_at_xoff_bytes_max: int = 0
    held_s: float = 0.0
    xon_offset_bytes: int | None = None
    first_s: float | None = None
    active_s: float = 0.0
    xoff_heard_s: deque[float] = field(default_factory=lambda: deque(maxlen=_STOPS_KEPT))
    last_s: float = 0.0
    _held_since_s: float | None = None
    _active_since_s: float | None = None
    _active_until_s: float = 0.0
    _run_from_bytes: int = 0
    _runs: deque[float] = field(default_factory=lambda: deque(maxlen=_RUNS_KEPT))

    def sent(self, count_bytes: int, now_s: float) -> None:
        """These bytes left now."""
        if self.first_s is None:
            self.first_s = now_s
        self.bytes_sent += count_bytes

    def held(self, inflight_bytes: int, now_s: float) -> None:
        """The control said XOFF while this many bytes were beyond recall."""
        self.xoff_count += 1
        self.inflight_at_xoff_bytes_max = max(self.inflight_at_xoff_bytes_max, inflight_bytes)
        self._held_since_s = now_s
        self.xoff_heard_s.append(now_s)

    def resumed(self, offset_bytes: int, now_s: float) -> float:
        """The control said XON, and this much had been sent; returns how long it had held."""
        self.xon_offset_bytes = offset_bytes
        held_s = 0.0 if self._held_since_s is None else now_s - self._held_since_s
        self._held_since_s = None
        self.held_s += held_s
        return held_s

    def moved(self, new: JobState, now_s: float, idle_at_s: float) -> None:
        """The job changed state; the line counts as in use from SENDING until its last byte has gone."""
        if new is JobState.SENDING:
            self._active_since_s = max(now_s, self._active_until_s)
            self._run_from_bytes = self.bytes_sent
        elif self._active_since_s is not None:
            self._active_until_s = max(now_s, idle_at_s)
            run_s = max(0.0, self._active_until_s - self._active_since_s)
            run_bytes = self.bytes_sent - self._run_from_bytes
            if run_bytes >= _RUN_BYTES and run_s > 0:
                self._runs.append(run_bytes * self.byte_s / run_s)
            self.active_s += run_s
            self._active_since_s = None
        self.last_s = now_s

    def held_now_s(self, now_s: float) -> float:
        """All time held so far, the present hold included."""
        return self.held_s + (0.0 if self._held_since_s is None else now_s - self._held_since_s)

    def utilisation(self, now_s: float) -> float:
        """Bytes over what the line could have carried in the time not held and not paused."""
        active_s = self.active_s + (0.0 if self._active_since_s is None else max(0.0, now_s - self._active_since_s))
        return min(1.0, self.bytes_sent * self.byte_s / active_s) if active_s > 0 else 0.0

    def utilisation_median(self) -> float | None:
        """The middle one of the runs between two holds; None without a run of at least 50 bytes."""
        return min(1.0, median(self._runs)) if self._runs else None
