"""What arrives and means nothing: own bytes coming back, noise, breaks, XON that nobody waited for."""

from __future__ import annotations

from collections import deque

from dnc import alarms
from dnc.events import Alarm, Event
from dnc.tape import Tape

_WINDOW_S = 60.0
_NOISE_WARNING_BYTES = 10
_NOISE_LIMIT_BYTES = 100
_BREAK_BYTES = 8
_UNASKED_XON = 20
_ECHO_BYTES = 8
_ECHO_REACH_BYTES = 512


class Suspicion:
    """Counts over the last minute; the warning comes once, the limit stops the job until the operator resumes."""

    def __init__(self, tape: Tape) -> None:
        self._tape = tape
        self._noise: deque[tuple[float, int]] = deque()
        self._xons: deque[float] = deque(maxlen=_UNASKED_XON)
        self._is_xon_warned = False
        self._tail = b""
        self._is_warned = False
        self.is_too_noisy = False

    def forget(self) -> None:
        """The operator has looked: count anew."""
        self._noise.clear()
        self._xons.clear()
        self._tail = b""
        self._is_warned = self._is_xon_warned = self.is_too_noisy = False

    def is_echo(self, data: bytes, offset_bytes: int) -> bool:
        """Whether the last bytes heard are bytes sent a moment ago; eight in a row are no accident."""
        self._tail = (self._tail + data)[-_ECHO_BYTES:]
        if len(self._tail) < _ECHO_BYTES or len(set(self._tail)) == 1:
            return False
        sent_from = max(0, offset_bytes - _ECHO_REACH_BYTES)
        return self._tail in self._tape.peek(sent_from, offset_bytes - sent_from)

    def noise(self, data: bytes, now_s: float, offset_bytes: int) -> Alarm | None:
        """Count bytes without meaning, up to the limit; the alarm that is due, if any."""
        if self.is_too_noisy:
            return None
        self._noise.append((now_s, len(data)))
        while self._noise[0][0] < now_s - _WINDOW_S:
            self._noise.popleft()
        count = sum(length for _, length in self._noise)
        if self._tail == bytes(_BREAK_BYTES) or count >= _NOISE_LIMIT_BYTES:
            self.is_too_noisy = True
            kind = alarms.BREAK if self._tail == bytes(_BREAK_BYTES) else alarms.TOO_NOISY
            return kind.at(now_s, offset_bytes, f"{count} in a minute")
        if count >= _NOISE_WARNING_BYTES and not self._is_warned:
            self._is_warned = True
            return alarms.NOISE.at(now_s, offset_bytes, f"{count} in a minute")
        return None

    def unasked_xon(self, now_s: float, offset_bytes: int) -> list[Event]:
        """Count an XON that nobody waited for; the warning at the twentieth in a minute, once."""
        self._xons.append(now_s)
        is_many = len(self._xons) == _UNASKED_XON and self._xons[0] >= now_s - _WINDOW_S
        if self._is_xon_warned or not is_many:
            return []
        self._is_xon_warned = True
        return [alarms.UNASKED_XON.at(now_s, offset_bytes, f"{_UNASKED_XON} in a minute")]
