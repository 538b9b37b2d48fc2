"""The sender: decides which bytes may leave now. No I/O, no clock of its own, no thread; the hard part, kept pure.

`hear` takes what the control sent, `take` gives what may leave now, `tick` lets time pass; all return frozen events.
Bytes given out are always an exact prefix of the tape. The rim (stream.py) moves them.
"""

from __future__ import annotations

import math

from dnc import alarms
from dnc.events import Event, Held, JobState, Noise, Resumed, StateChanged
from dnc.handshake import TABLE, Cause, Heard, Listener, Signal
from dnc.overhearing import Overhearing
from dnc.pacing import ByteClock
from dnc.portion import Outlet
from dnc.rules import Rules
from dnc.suspicion import Suspicion
from dnc.tally import Tally
from dnc.tape import Tape
from dnc.waits import Wait

_OVER = frozenset({JobState.SENT, JobState.ABORTED, JobState.FAULTED})
_BROKEN_OFF = {
    Signal.RESET: (Cause.CONTROL_RESET, alarms.CONTROL_RESET),
    Signal.ALARM: (Cause.CONTROL_ALARM, alarms.CONTROL_ALARM),
}


class Sender:
    """One job on one line."""

    def __init__(self, tape: Tape, clock: ByteClock, rules: Rules, offset_bytes: int = 0) -> None:
        self.tape, self.clock, self.rules = tape, clock, rules
        self._outlet = Outlet(tape, clock, offset_bytes)
        self.state = JobState.LOADED
        self.last_cause = Cause.LOAD
        self.note = ""
        self.tally = Tally(byte_s=clock.pace.byte_s)
        self._listener = Listener(rules.xon, rules.xoff)
        self._suspicion = Suspicion(tape)
        self._is_held_by_peer = self._has_early_xon = False
        self._overhearing = Overhearing(rules)
        self._wait = Wait(rules)

    @property
    def offset_bytes(self) -> int:
        """How much of the tape was given out."""
        return self._outlet.offset_bytes

    @property
    def is_over(self) -> bool:
        """Whether nothing more will ever leave, unless a program is loaded anew."""
        return self.state in _OVER

    @property
    def is_cut(self) -> bool:
        """Whether the bytes given out end inside a block."""
        return self._outlet.is_cut

    @property
    def may_be_cut(self) -> bool:
        """Whether the control may have got a part of a block only: cut off here, thrown away on its way, or overrun."""
        is_overrun = self.last_cause is Cause.CONTROL_ALARM  # for all we know: it then kept less than was sent
        return is_overrun or self._outlet.may_be_cut

    @property
    def is_pausing(self) -> bool:
        """Whether a pause was asked for and the block has not ended yet."""
        return self._outlet.stop_at is not None

    @property
    def is_one_xon_away(self) -> bool:
        """Whether the control holds us, and bytes may leave as soon as it does no longer."""
        return self.state is JobState.HELD and not self.is_pausing and self.rules.hears_xoff

    @property
    def plain_refill_bytes(self) -> int:
        """A refill that may leave as soon as the clock has room, whatever stands in it; 0 where more is to be asked."""
        return self._outlet.plain_refill_bytes if self.state is JobState.SENDING else 0

    @property
    def held_since_s(self) -> float:
        """When the present hold, pause or wait began."""
        return self._wait.since_s

    @property
    def next_wake_s(self) -> float:
        """The latest moment at which `tick` and `take` want to be called again; infinite while only a byte can help."""
        state = self.state
        if state is JobState.SENDING:
            return self._outlet.room_at_s
        if state is JobState.DRAINING:
            return self.clock.idle_at_s
        if state is JobState.HELD:
            return self._wait.hold_limit_at_s(is_trailer_left=self.offset_bytes >= self.tape.end.essential_bytes)
        return self._wait.start_limit_at_s if state is JobState.ARMED else math.inf

    def start(self, now_s: float) -> list[Event]:
        """The operator's start: send at once, or wait for the control's first XON."""
        if self.rules.waits_for_xon:
            events = self._move(Cause.START_AND_WAIT, now_s)
            return events + (self._move(Cause.XON, now_s) if self._has_early_xon else [])
        events = self._move(Cause.START, now_s)
        return events + (self._move(Cause.XOFF, now_s) if self._is_held_by_peer else [])

    def pause(self, now_s: float) -> list[Event]:
        """Stop at the end of the block that is under way; in ARMED before the first byte, once the XON has come."""
        if self.state not in (JobState.ARMED, JobState.SENDING, JobState.HELD):
            return []
        self._outlet.stop_at_block_end()
        return [] if self.state is JobState.ARMED else self._stop_if_reached(now_s)

    def resume(self, now_s: float) -> list[Event]:
        """Go on after a pause; the only way from PAUSED to SENDING."""
        self._outlet.stop_at = None
        self._suspicion.forget()
        return self._move(Cause.RESUME_HELD if self._is_held_by_peer else Cause.RESUME, now_s)

    def abort(self, now_s: float) -> list[Event]:
        """Stop at once, inside a block if need be."""
        return self._move(Cause.ABORT, now_s)

    def lost(self, now_s: float, why: str) -> list[Event]:
        """The port is gone; no fault if the control had stopped reading behind the end of the program."""
        if self._is_only_trailer_left(now_s):
            return self._leave_trailer(now_s)
        return self._alarmed(Cause.LOST, alarms.PORT_LOST, why, now_s)

    def fault(self, kind: alarms.Kind, detail: str, now_s: float) -> list[Event]:
        """Something outside was found wrong that ends the job."""
        return self._alarmed(Cause.FAULT, kind, detail, now_s)

    def disturb(self, kind: alarms.Kind, detail: str, now_s: float) -> list[Event]:
        """Something outside was found wrong: stop at once and wait for the operator."""
        return self._alarmed(Cause.DISTURBED, kind, detail, now_s)

    def hear(self, data: bytes, now_s: float) -> list[Event]:
        """What the control sent, as events; XON and XOFF take effect here."""
        if self.is_over or not data:
            return []
        if not self.rules.hears_xoff:
            return self._overhear(data, now_s)
        events: list[Event] = []
        for heard in self._listener.hear(data):
            events += self._hear_one(heard, now_s)
        return events

    def peer_is_ready(self, is_ready: bool, now_s: float) -> list[Event]:
        """The same as XON and XOFF, from a modem line or a full driver queue."""
        if is_ready != self._is_held_by_peer:
            return []
        if is_ready:
            return self._xon(now_s)
        return self._xoff(False, now_s) + self._broken_off_by(now_s)

    def take(self, room_bytes: int, now_s: float) -> bytes:
        """The bytes that may leave now: at most `room_bytes`, never more in flight than the clock allows."""
        if self.state is not JobState.SENDING or room_bytes <= 0:
            return b""
        chunk = self._outlet.take(room_bytes, now_s)
        if chunk:
            self.tally.sent(len(chunk), now_s)
        return chunk

    def answer(self, room_bytes: int, now_s: float) -> bytes:
        """What the XON that ends this hold lets leave at once; nothing where more than an XON is missing.

        The rim may lay it ready and, when it reads that XON and nothing else, write before it tells `answered`.
        """
        return self._outlet.answer(room_bytes, now_s) if self.is_one_xon_away else b""

    def answered(self, xon: bytes, written: bytes, now_s: float) -> list[Event]:
        """That XON came, and these first bytes of the answer left with it; only while `is_one_xon_away`."""
        events = self.hear(xon, now_s)
        if written:
            self._outlet.left(len(written), now_s)
            self.tally.sent(len(written), now_s)
        return events

    def give_back(self, count_bytes: int) -> None:
        """The host did not accept the last of the bytes taken; they will be taken again."""
        self._outlet.take_back(count_bytes)
        self.tally.bytes_sent -= count_bytes

    def thrown_away(self, queued_bytes: int, now_s: float) -> None:
        """The queues below are being emptied: up to so many of the last bytes, or those in flight, never arrive."""
        self._outlet.thrown_away(queued_bytes, now_s)

    def tick(self, now_s: float) -> list[Event]:
        """Let time pass: block ends reached, time-outs, the last byte gone."""
        state = self.state
        if state is JobState.SENDING:
            if self.offset_bytes >= self.tape.size_bytes:
                return self._move(Cause.ALL_TAKEN, now_s)
            return self._stop_if_reached(now_s)
        if state is JobState.DRAINING and now_s >= self.clock.idle_at_s:
            return self._broken_off_by(now_s) or self._move(Cause.DRAINED, now_s)
        if state is JobState.HELD:
            return self._tick_held(now_s)
        if state is JobState.ARMED and self._wait.is_start_over(now_s):
            return self._alarmed(Cause.START_TIMEOUT, alarms.NO_FIRST_XON, "", now_s)
        return []

    def _hear_one(self, heard: Heard, now_s: float) -> list[Event]:
        if heard.signal is Signal.XOFF:
            return self._xoff(heard.is_masked, now_s)
        if heard.signal is Signal.XON:
            return self._xon(now_s)
        if heard.signal in _BROKEN_OFF:
            return self._alarmed(*_BROKEN_OFF[heard.signal], "", now_s)
        return self._noise(heard.data, now_s)

    def _overhear(self, data: bytes, now_s: float) -> list[Event]:
        """What comes where XOFF is not read: reset and alarm of the control, an XOFF that the driver let through."""
        for heard in self._listener.hear(data):
            if heard.signal in _BROKEN_OFF:
                return self._hear_one(heard, now_s)
        if not self.rules.is_driver_asked:
            return self._noise(data, now_s)
        if self._overhearing.is_driver_deaf(data):
            return self._alarmed(Cause.DISTURBED, alarms.DEAF_DRIVER, "", now_s)
        events = self._noise(data, now_s)
        self._overhearing.note(data, self.offset_bytes)
        return events + (self._broken_off_by(now_s) if self._is_held_by_peer else [])

    def _broken_off_by(self, now_s: float) -> list[Event]:
        """What SYN or NAK came to that the driver left over; asked when a hold is seen, or all has left.

        An adapter that stopped may have taken some kilobytes since, so that a later hold may be another one: the
        operator must look. An end that may still lie in it is none.
        """
        pace = self.clock.pace
        signal, behind_bytes = self._overhearing.broken_off(self.offset_bytes, pace.beyond_recall_bytes)
        if signal is None:
            return []
        if behind_bytes <= pace.inflight_max_bytes or self.state is JobState.DRAINING:
            return self._hear_one(Heard(signal), now_s)
        return [alarms.BROKEN_OFF.at(now_s, self.offset_bytes), *self._move(Cause.DISTURBED, now_s)]

    def _xoff(self, is_masked: bool, now_s: float) -> list[Event]:
        events: list[Event] = []
        if is_masked and self.tally.masked_xoff_count == 0:
            events.append(alarms.MASKED_XOFF.at(now_s, self.offset_bytes))
        self.tally.masked_xoff_count += is_masked
        if self._is_held_by_peer:
            return events
        self._is_held_by_peer, self._has_early_xon = True, False
        inflight = self.clock.inflight_bytes(now_s)
        self.tally.held(inflight, now_s)
        self._wait.begin_hold(now_s)
        return [*events, Held(now_s, self.offset_bytes, inflight, is_masked), *self._move(Cause.XOFF, now_s)]

    def _xon(self, now_s: float) -> list[Event]:
        if not self._is_held_by_peer:
            events = self._move(Cause.XON, now_s)
            if events:
                return events
            if self.state is JobState.LOADED:
                self._has_early_xon = True
                return []
            self.tally.unasked_xon_count += 1
            return self._suspicion.unasked_xon(now_s, self.offset_bytes)
        self._is_held_by_peer = False
        held_s = self.tally.resumed(self.offset_bytes, now_s)
        return [Resumed(now_s, self.offset_bytes, held_s), *self._move(Cause.XON, now_s)]

    def _noise(self, data: bytes, now_s: float) -> list[Event]:
        self.tally.noise_bytes += len(data)
        events: list[Event] = [Noise(now_s, self.offset_bytes, data[:256])]
        if self._suspicion.is_echo(data, self.offset_bytes):
            return events + self._alarmed(Cause.FAULT, alarms.LOOPBACK, "", now_s)
        found = self._suspicion.noise(data, now_s, self.offset_bytes)
        if found is None:
            return events
        if self._suspicion.is_too_noisy:
            return [*events, found, *self._move(Cause.DISTURBED, now_s)]
        return [*events, found]

    def still_queued(self, late_s: float, now_s: float) -> list[Event]:
        """DRAINING, and blocks wait in the system's queue: the control holds, as it may for as long as in HELD."""
        return self._held_for(late_s, now_s)

    def _tick_held(self, now_s: float) -> list[Event]:
        held_s = now_s - self._wait.since_s
        if self._outlet.is_stop_reached:
            return self._stop_if_reached(now_s)
        if held_s >= self.rules.trailer_wait_s and self._is_only_trailer_left(now_s):
            return self._leave_trailer(now_s)
        return self._held_for(held_s, now_s)

    def _held_for(self, held_s: float, now_s: float) -> list[Event]:
        """What a hold of this length calls for: the time-out, or one warning."""
        due, detail = self._wait.due(held_s), f"{held_s:.0f} s"
        if due is alarms.HOLD_TIMEOUT:
            return self._alarmed(Cause.HOLD_TIMEOUT, due, detail, now_s)
        return [] if due is None else [due.at(now_s, self.offset_bytes, detail)]

    def _is_only_trailer_left(self, now_s: float) -> bool:
        is_essential_gone = self.offset_bytes >= self.tape.end.essential_bytes and now_s >= self.clock.idle_at_s
        return self.state is JobState.HELD and is_essential_gone

    def _leave_trailer(self, now_s: float) -> list[Event]:
        left = self.tape.size_bytes - self.offset_bytes
        self.note = f"the control stopped reading after the end of the program; {left} bytes of trailer not taken"
        return self._move(Cause.TRAILER_LEFT, now_s)

    def _stop_if_reached(self, now_s: float) -> list[Event]:
        if not self._outlet.is_stop_reached:
            return []
        self._outlet.stop_at = None
        return self._move(Cause.PAUSE_REACHED, now_s)

    def _alarmed(self, cause: Cause, kind: alarms.Kind, detail: str, now_s: float) -> list[Event]:
        moved = self._move(cause, now_s)
        return [kind.at(now_s, self.offset_bytes, detail), *moved] if moved else []

    def _move(self, cause: Cause, now_s: float) -> list[Event]:
        """Follow the table; a cause that it does not know in this state changes nothing."""
        old = self.state
        new = TABLE.get((old, cause))
        if new is None or new is old:
            return []
        self.state, self.last_cause = new, cause
        if new in (JobState.ARMED, JobState.PAUSED) or (new is JobState.HELD and old is JobState.PAUSED):
            self._wait.begin(now_s)
        if new is JobState.PAUSED or new in _OVER:
            self._outlet.stop_at = None
        if new is JobState.SENDING and old in (JobState.LOADED, JobState.ARMED):
            self._suspicion.forget()  # noise that could pause nothing must not keep later noise from doing it
        self.tally.moved(new, now_s, self.clock.idle_at_s)
        return [StateChanged(now_s, self.offset_bytes, old, new, cause.value)]
