"""How much of the tape leaves in one write: a refill, no further than a pause that was asked for, the end whole.

The last block's end and the closing % go together (TapeEnd), because a control may stop reading after M30.
"""

from __future__ import annotations

from dnc.pacing import ByteClock
from dnc.tape import Tape, TapeEnd

_OF_RESERVE = 4
"""Default bytes in flight are at most this part of what the control keeps free when it stops us."""


def write_stop(tape: Tape, at: int, stop_at: int | None, clock: ByteClock) -> int | None:
    """Where the next write ends at the latest: at a pause; where each block is followed by a delay, at its end."""
    if not clock.pace.line_delay_s:
        return stop_at
    block_end = tape.next_block_end(at)
    return block_end if stop_at is None else min(block_end, stop_at)


def wanted_bytes(tape: Tape, at: int, stop_at: int | None, clock: ByteClock) -> int:
    """How much room makes the next write worth while: a refill, or all that is left to send before `stop_at`."""
    end = tape.end
    if stop_at is None and at + clock.refill_bytes <= end.whole_from:
        return clock.refill_bytes
    if at == end.whole_from and _leaves_whole(end, clock):
        return end.whole_to - at
    stop = tape.size_bytes if stop_at is None else stop_at
    if at < end.whole_from < stop:
        stop = end.whole_from
    return max(1, min(clock.refill_bytes, stop - at))


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


def bytes_before_end(tape: Tape, at: int, stop_at: int | None, count: int) -> bytes:
    """At most `count` bytes from `at`, none beyond `stop_at`, and none of the end that leaves whole."""
    last = tape.end.whole_from if stop_at is None else min(stop_at, tape.end.whole_from)
    count = min(count, last - at)
    return tape.read(at, count) if count > 0 else b""


def _leaves_whole(end: TapeEnd, clock: ByteClock) -> bool:
    """Whether the end may leave in one write on an empty line: the control's reserve must have room for it."""
    return end.whole_to - end.whole_from <= clock.pace.inflight_max_bytes * _OF_RESERVE
