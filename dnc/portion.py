"""What has left of the tape and what may leave next: a refill, no further than a pause asked for, the end whole.

The last block's end and the closing % go together (TapeEnd), because a control may stop reading after M30.
"""

from __future__ import annotations

from dnc.pacing import ByteClock
from dnc.tape import Tape

_OF_RESERVE = 4
"""Default bytes in flight are at most this part of what the control keeps free when it stops us."""


class Outlet:
    """The one place where bytes leave the tape: `offset_bytes` have; none beyond `stop_at` do, where a pause waits."""

    __slots__ = ("_clock", "_tape", "_thrown_bytes", "offset_bytes", "stop_at")

    def __init__(self, tape: Tape, clock: ByteClock, offset_bytes: int) -> None:
        self._tape, self._clock = tape, clock
        self.offset_bytes = offset_bytes
        self.stop_at: int | None = None
        self._thrown_bytes = 0

    @property
    def plain_refill_bytes(self) -> int:
        """A refill that may leave as soon as the clock has room, whatever stands in it; 0 where more is to be asked."""
        refill_bytes = self._clock.refill_bytes
        return refill_bytes if self._is_plain(refill_bytes) else 0

    @property
    def room_at_s(self) -> float:
        """When the clock has room for the next write that is worth while."""
        return self._clock.room_at_s(self._wanted_bytes())

    @property
    def is_stop_reached(self) -> bool:
        """Whether a pause waits for nothing more."""
        return self.stop_at is not None and self.offset_bytes >= self.stop_at

    @property
    def is_cut(self) -> bool:
        """Whether what has left ends inside a block."""
        return not self._tape.is_block_end(self.offset_bytes)

    @property
    def may_be_cut(self) -> bool:
        """Whether a part of a block only may have arrived: cut off here, or thrown away on its way."""
        tape, thrown_from = self._tape, self.offset_bytes - self._thrown_bytes
        is_thrown = thrown_from < self.offset_bytes and self.offset_bytes > tape.leader_bytes
        return self.is_cut or (is_thrown and thrown_from < tape.trailer_from)

    def stop_at_block_end(self) -> None:
        """Let nothing leave behind the block that is under way."""
        at, tape = self.offset_bytes, self._tape
        self.stop_at = at if tape.is_block_end(at) else tape.next_block_end(at)

    def take(self, room_bytes: int, now_s: float) -> bytes:
        """The bytes that leave now: at most `room_bytes`, never more in flight than the clock allows."""
        clock = self._clock
        count = clock.room_bytes(now_s)
        if clock.refill_bytes <= count <= room_bytes and self._is_plain(count):
            chunk = self._tape.read(self.offset_bytes, count)
            self.left(count, now_s)
            return chunk
        wanted = self._wanted_bytes()
        if count < wanted:
            if clock.idle_at_s > now_s:
                return b""
            count = wanted  # the end of the tape may be longer than what may be in flight
        chunk = self._next(min(count, room_bytes), wanted)
        if chunk:
            self.left(len(chunk), now_s)
        return chunk

    def answer(self, room_bytes: int, now_s: float) -> bytes:
        """What may leave at once behind a hold; nothing on a busy line, nothing of the end that leaves whole."""
        if self._clock.idle_at_s > now_s:
            return b""
        count = min(self._clock.pace.inflight_max_bytes, room_bytes)
        at, stop_at, whole_from = self.offset_bytes, self._write_stop(), self._tape.end.whole_from
        count = min(count, (whole_from if stop_at is None else min(stop_at, whole_from)) - at)
        return self._tape.read(at, count) if count > 0 else b""

    def left(self, count_bytes: int, now_s: float) -> None:
        """The next bytes of the tape left now."""
        self.offset_bytes += count_bytes
        self._clock.note(count_bytes, now_s)
        delay_s = self._clock.pace.line_delay_s
        if delay_s and self.offset_bytes > self._tape.leader_bytes and self._tape.is_block_end(self.offset_bytes):
            self._clock.delay(delay_s)

    def take_back(self, count_bytes: int) -> None:
        """The last of the bytes did not leave after all."""
        self.offset_bytes -= count_bytes
        self._clock.take_back(count_bytes)

    def thrown_away(self, queued_bytes: int, now_s: float) -> None:
        """The queues below are being emptied: up to so many of the last bytes, or those in flight, never arrive.

        Where an adapter may hold bytes unseen, it may lose or keep them.
        """
        clock = self._clock
        unseen_bytes = clock.pace.beyond_recall_bytes if clock.pace.unseen_bytes else 0
        self._thrown_bytes = max(queued_bytes, clock.inflight_bytes(now_s), unseen_bytes)

    def _is_plain(self, count_bytes: int) -> bool:
        """Whether no pause, delay or end of the tape makes a write of so many bytes shorter or another."""
        is_before_end = self.offset_bytes + count_bytes <= self._tape.end.whole_from
        return self.stop_at is None and is_before_end and not self._clock.pace.line_delay_s

    def _write_stop(self) -> int | None:
        """Where the next write ends at the latest: at a pause; where each block is followed by a delay, at its end."""
        if not self._clock.pace.line_delay_s:
            return self.stop_at
        block_end = self._tape.next_block_end(self.offset_bytes)
        return block_end if self.stop_at is None else min(block_end, self.stop_at)

    def _wanted_bytes(self) -> int:
        """How much room makes the next write worth while: a refill, or all that is left to send before it must stop."""
        at, stop_at, end, refill_bytes = self.offset_bytes, self._write_stop(), self._tape.end, self._clock.refill_bytes
        if stop_at is None and at + refill_bytes <= end.whole_from:
            return refill_bytes
        if at == end.whole_from and self._ends_in_one_write():
            return end.whole_to - at
        stop = self._tape.size_bytes if stop_at is None else stop_at
        if at < end.whole_from < stop:
            stop = end.whole_from
        return max(1, min(refill_bytes, stop - at))

    def _next(self, count: int, wanted: int) -> bytes:
        """At most `count` bytes, none behind where it must stop, none of the end unless it fits (`wanted`) whole."""
        at, stop_at, end = self.offset_bytes, self._write_stop(), self._tape.end
        if stop_at is not None:
            count = min(count, stop_at - at)
        if at < end.whole_from < at + count < end.whole_to:
            count = end.whole_from - at
        elif at == end.whole_from and count < wanted:
            return b""
        return self._tape.read(at, count)

    def _ends_in_one_write(self) -> bool:
        """Whether the end may leave in one write on an empty line: the control's reserve must have room for it."""
        end = self._tape.end
        return end.whole_to - end.whole_from <= self._clock.pace.inflight_max_bytes * _OF_RESERVE
