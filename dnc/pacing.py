"""The byte clock: how many bytes may be beyond recall now, and when the next may follow.

Whatever leaves the host sits in queues that nobody can call back (driver, adapter, UART), so the sender never hands
over more than the line can have carried away in the meantime. The clock runs `slack` slower than the nominal line: a
line that is slower than its nominal rate does not fill the queues unseen, and what a late driver or kernel thread has
piled up there drains again while bytes go on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

_LEFT_S = 0.08e-3
_YOUNG_S = 0.01
_PAUSE_S = 0.002
_ANSWER_S = 0.002


def bits_per_byte(form: str) -> float:
    """Start bit, data bits, parity bit, stop bits of a format such as 7E2.

    >>> bits_per_byte("8N1"), bits_per_byte("7E2")
    (10.0, 11.0)
    """
    return 1 + int(form[0]) + (form[1] != "N") + float(form[2:])


def default_inflight_bytes(baud: int, form: str, reserve_bytes: int) -> int:
    """Bytes in flight that keep the line busy over 0.6 ms of host delay, at least 2: 2 to 38400 baud, 7 at 115200.

    Never more than a quarter of the bytes that the control keeps free when it stops us, `reserve_bytes`.

    >>> [default_inflight_bytes(baud, "8N1", 120) for baud in (1200, 38400, 115200, 1152000)]
    [2, 2, 7, 30]
    """
    busy_bytes = max(2, round(0.6e-3 * baud / bits_per_byte(form)))
    return max(1, min(busy_bytes, reserve_bytes // 4))


def default_slack(baud: int) -> float:
    """How much slower than the line the clock runs: what the demanded utilisation leaves, 0.98 and 0.96 at most."""
    return 0.012 if baud <= 38400 else 0.018


def default_lag_s(baud: int) -> float:
    """How late the first byte after a silence may start: less than this, and the bytes after it would add to it.

    Up to 38400 baud, where 2 bytes are in flight, at most half a byte, or each refill would come as the line falls dry.
    """
    return min(0.45e-3, 4.8 / baud) if baud <= 38400 else 0.2e-3


def answer_delay_s(byte_s: float, reserve_bytes: int) -> float:
    """What each byte is stretched by, so that a full-speed line fills the control's reserve in no less than 2 ms.

    A host that is late by so much is common; on a faster line its answer to XOFF would come after the reserve is gone.
    Nothing up to 115200 baud where the control keeps 24 bytes free.

    >>> answer_delay_s(10 / 115200, 24), round(1e6 * answer_delay_s(10 / 1152000, 40))
    (0.0, 41)
    """
    return max(0.0, _ANSWER_S / max(1, reserve_bytes) - byte_s)


@dataclass(frozen=True, slots=True)
class Pace:
    """The line's measure: time of one byte, how many may be in flight, how late a run may begin.

    `lag_s` is the time that a byte may need to reach the line; `char_delay_s` stretches every byte and
    `line_delay_s` follows every block end, for controls without a handshake. `unseen_bytes` is what an adapter that is
    stopped may hold while this clock runs on: nobody sees a hold before that is full.
    """

    byte_s: float
    inflight_max_bytes: int
    lag_s: float
    slack: float
    char_delay_s: float = 0.0
    line_delay_s: float = 0.0
    unseen_bytes: int = 0

    @property
    def beyond_recall_bytes(self) -> int:
        """The most that may have left this computer and never reach the control."""
        return self.inflight_max_bytes + self.unseen_bytes


class ByteClock:
    """Knows when the last byte handed over will have left the line, and how much room makes a write worth a wake-up.

    `refill_bytes` is that room: a third of the bytes in flight while a run is young, because the control may stop it
    soon and every gap counts; then all but 0.08 ms of line, because every wake-up costs the processor 40 us.
    """

    __slots__ = (
        *("_busy_until_s", "_byte_s", "_lag_s", "_max_bytes", "_run_from_s"),
        *("_settled_refill_bytes", "_young_refill_bytes", "pace", "refill_bytes"),
    )

    def __init__(self, pace: Pace) -> None:
        self.pace = pace
        self._byte_s = pace.byte_s * (1.0 + pace.slack) + pace.char_delay_s
        self._lag_s = pace.lag_s
        self._max_bytes = pace.inflight_max_bytes
        self._young_refill_bytes = max(1, self._max_bytes // 3)
        left_bytes = math.ceil(_LEFT_S / pace.byte_s)
        self._settled_refill_bytes = max(self._young_refill_bytes, self._max_bytes - left_bytes)
        self.refill_bytes = self._young_refill_bytes
        self._busy_until_s = self._run_from_s = -math.inf

    @property
    def idle_at_s(self) -> float:
        """When the line will be silent if nothing more is handed over."""
        return self._busy_until_s

    def inflight_bytes(self, now_s: float) -> int:
        """Upper bound of the bytes that have left the program and not yet the line."""
        left_s = self._busy_until_s - now_s
        return 0 if left_s <= 0 else math.ceil(left_s / self._byte_s - 1e-6)

    def room_bytes(self, now_s: float) -> int:
        """How many more bytes may be handed over now."""
        left_s = self._busy_until_s - now_s
        return self._max_bytes if left_s <= 0 else max(0, self._max_bytes - math.ceil(left_s / self._byte_s - 1e-6))

    def room_at_s(self, count_bytes: int) -> float:
        """The moment at which there is room for this many bytes (at most the whole of what may be in flight)."""
        return self._busy_until_s - max(0, self._max_bytes - count_bytes) * self._byte_s

    def note(self, count_bytes: int, now_s: float) -> None:
        """These bytes were handed over now."""
        start_s = self._busy_until_s
        if start_s <= now_s:
            if now_s - start_s > _PAUSE_S:  # a shorter silence was a late wake-up, not a stop
                self._run_from_s, self.refill_bytes = now_s, self._young_refill_bytes
            start_s = now_s + self._lag_s
        elif now_s - self._run_from_s > _YOUNG_S:
            self.refill_bytes = self._settled_refill_bytes
        self._busy_until_s = start_s + count_bytes * self._byte_s

    def delay(self, delay_s: float) -> None:
        """Keep silent this much longer."""
        self._busy_until_s += delay_s

    def take_back(self, count_bytes: int) -> None:
        """These bytes were not accepted after all."""
        self._busy_until_s -= count_bytes * self._byte_s
