"""How much of the tape leaves in one write: a refill, no further than a pause that was asked for, the end whole.

The last block's end and the closing % go together (TapeEnd), because a control may stop reading after M30.
"""

from __future__ import annotations

from dnc.pacing import Pace
from dnc.tape import Tape


def wanted_bytes(tape: Tape, at: int, stop_at: int | None, pace: Pace) -> int:
    """How much room makes the next write worth while: a refill, or all that is left to send before `stop_at`."""
    end = tape.end
    if at == end.whole_from and end.whole_to - at <= pace.inflight_max_bytes:
        return end.whole_to - at
    stop = tape.size_bytes if stop_at is None else stop_at
    if at < end.whole_from < stop:
        stop = end.whole_from
    return max(1, min(pace.refill_bytes, stop - at))


def next_bytes(tape: Tape, at: int, stop_at: int | None, count: int, wanted: int) -> bytes:
    """At most `count` bytes from `at`, none beyond `stop_at`, and none of the end unless it fits (`wanted`) whole."""
    end = tape.end
    if stop_at is not None:
        count = min(count, stop_at - at)
    if at < end.whole_from < at + count < end.whole_to:
        count = end.whole_from - at
    elif at == end.whole_from and count < wanted:
        return b""
    return tape.read(at, count)
