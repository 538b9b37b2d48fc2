"""The sending loop: one select, one read, one write at a time, between the port and the sender.

It sleeps until the byte clock has room or the control speaks. Nothing here waits for a disk, a display or a network:
events go to a sink that must return at once, the journal works ahead in its own thread.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections import deque
from collections.abc import Callable, Iterable
from enum import Enum
from select import select

from dnc.errors import PortLost
from dnc.events import Event, JobState
from dnc.housekeeping import Housekeeping
from dnc.journal import Journal
from dnc.port import Flow, Port
from dnc.priority import HoldUps
from dnc.sender import Sender

_LEAVE_S = 2.0
_HOLD_UP_S = 0.0005
_HOLD_UPS_KEPT = 2000
_STUCK_S = 0.05
_STUCK_BYTES = 3
_DRAIN_S = 2.0
_FLOW_POLL_S = 0.002
_WATCHFUL_S = 0.25
_WATCH_S = 0.001
"""A loop that has slept long answers XON 0.1 ms later: a young hold, which may end soon, is passed in naps."""
Sink = Callable[[Event], None]


class Command(Enum):
    """What may be asked of a running job, from any thread or signal handler."""

    PAUSE = "pause"
    RESUME = "resume"
    ABORT = "abort"
    LEAVE = "pause at a block end and end the process"


class Stream:
    """Runs one job to its end; `command` is safe from anywhere, `run` belongs to one thread."""

    def __init__(
        self, sender: Sender, port: Port, journal: Journal, sink: Sink, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.sender, self.port, self.journal = sender, port, journal
        self.last_command: Command | None = None
        self._sink, self._clock = sink, clock
        self._commands: deque[Command] = deque()
        self._wake_read, self._wake_write = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        self._fd = port.fileno()
        self._readers = self._fd, self._wake_read
        self._flow = port.flow
        self._is_full = False
        self._xon, self._answer = bytes([sender.rules.xon]), b""
        self._retry_at_s = 0.0
        self._moving_at_s = 0.0
        self._housekeeping = Housekeeping(sender, port)
        self._leave_at_s: float | None = None
        self._waited_from_s = 0.0
        self.hold_ups = HoldUps(_HOLD_UP_S, _HOLD_UPS_KEPT)

    @property
    def is_leaving(self) -> bool:
        """Whether the process ends as soon as the job is paused."""
        return self.last_command is Command.LEAVE

    def command(self, command: Command) -> None:
        """Ask something of the running job."""
        self._commands.append(command)
        self.wake()

    def wake(self) -> None:
        """Make the loop look around; safe from any thread or signal handler."""
        with contextlib.suppress(OSError):
            os.write(self._wake_write, b"!")

    def run(self) -> None:
        """Start the job and move bytes until it is over, paused for leaving, or never started."""
        sender = self.sender
        self._report(sender.start(self._clock()))
        try:
            while not self._is_done():
                self._step()
                self._coast()
            if sender.state is JobState.PAUSED:
                self._let_go()
        except PortLost as problem:
            self._report(sender.lost(self._clock(), str(problem)))
        if sender.state in (JobState.ABORTED, JobState.FAULTED):
            self._purge()

    def close(self) -> None:
        """Let go of the pipe."""
        os.close(self._wake_read)
        os.close(self._wake_write)

    def _is_done(self) -> bool:
        sender = self.sender
        if sender.is_over or sender.state is JobState.LOADED:
            return True
        return self._leave_at_s is not None and sender.state is JobState.PAUSED

    def _let_go(self) -> None:
        """Leave when the last block has left the system's queue: what a closing port drops would be missing in it."""
        while self.port.queued_bytes():
            now_s = self._clock()
            if self._commands or self._leave_at_s is None or now_s >= self._leave_at_s:
                self._report(self.sender.abort(now_s))
                return
            select((self._wake_read,), (), (), _FLOW_POLL_S)

    def _purge(self) -> None:
        queued_bytes = 0
        with contextlib.suppress(PortLost):
            queued_bytes = self.port.queued_bytes()
        self.sender.thrown_away(queued_bytes, self._clock())
        self.port.purge()

    def _step(self) -> None:
        sender = self.sender
        readers, writers = self._readers, (self._fd,) if self._is_full else ()
        wait_s = self._wait_s()
        due_s = self._waited_from_s + wait_s
        ready, writable, _ = select(readers, writers, (), wait_s)
        now_s = self._clock()
        if now_s - due_s > self.hold_ups.least_s:
            self.hold_ups.note(now_s, now_s - due_s)
        if writable:
            self._is_full = False
        heard = self._look(ready, now_s) if ready else []
        try:
            if self._flow is not Flow.BYTES:
                heard += self._watch_flow(now_s)
            if sender.state is JobState.SENDING:
                self._send(now_s)
        finally:  # told after the write: it wakes other threads, and the control waits for the first byte
            if heard:
                self._report(heard)
        if sender.state is not JobState.DRAINING or self._is_drained(now_s):
            events = sender.tick(now_s)
            if events:
                self._report(events)
        if not self._answer and sender.is_one_xon_away:
            self._lay_ready(now_s)
        if now_s >= self._housekeeping.due_s:
            self._housekeep(now_s)

    def _coast(self) -> None:
        """A run in which nobody speaks: the clock alone says when the next bytes leave, until anything else matters.

        It does what `_step` does then, for half of the processor's time; whoever speaks is heard by the next `_step`.
        """
        sender, port, journal, clock = self.sender, self.port, self.journal, self._clock
        if self._flow is not Flow.BYTES or self._is_full:
            return
        while (refill_bytes := sender.plain_refill_bytes) and sender.offset_bytes + refill_bytes <= journal.bound_bytes:
            from_s = clock()
            due_s = max(from_s, sender.clock.room_at_s(refill_bytes))  # behind a hold there has long been room
            if due_s > self._housekeeping.due_s or select(self._readers, (), (), due_s - from_s)[0]:
                return
            now_s = clock()
            if now_s - due_s > _HOLD_UP_S:
                self.hold_ups.note(now_s, now_s - due_s)
            if port.queued_bytes():  # how much more may leave then, `_send` knows
                return
            chunk = sender.take(journal.bound_bytes - sender.offset_bytes, now_s)
            if chunk and not self._hand_over(chunk):
                return

    def _wait_s(self) -> float:
        """How long nothing can happen unless a byte or a command arrives."""
        now_s = self._waited_from_s = self._clock()
        sender = self.sender
        until_s = self._housekeeping.due_s
        is_blocked = self._is_full or self._journal_room() <= 0
        if not (is_blocked and sender.state is JobState.SENDING):
            until_s = min(until_s, max(sender.next_wake_s, self._retry_at_s))
        if self._flow is not Flow.BYTES:
            until_s = min(until_s, now_s + _FLOW_POLL_S)
        elif sender.state is JobState.HELD and now_s - sender.held_since_s < _WATCHFUL_S:
            until_s = min(until_s, now_s + _WATCH_S)
        return max(0.0, until_s - now_s)

    def _journal_room(self) -> int:
        return self.journal.bound_bytes - self.sender.offset_bytes

    def _look(self, ready: Iterable[object], now_s: float) -> list[Event]:
        heard: list[Event] = []
        for found in ready:
            if found == self._fd:
                heard += self._hear(self.port.read(), now_s)
            else:
                with contextlib.suppress(BlockingIOError):
                    os.read(self._wake_read, 4096)
        while self._commands:
            heard += self._obey(self._commands.popleft(), now_s)
        return heard

    def _hear(self, data: bytes, now_s: float) -> list[Event]:
        """An XON that ends a hold is answered first and thought about afterwards: that takes 60 us less."""
        sender, answer = self.sender, self._answer
        self._answer = b""
        if not answer or data != self._xon or self._commands or not sender.is_one_xon_away:
            return sender.hear(data, now_s)
        accepted = self.port.write(answer)
        self._is_full = accepted < len(answer)
        return sender.answered(data, answer[:accepted], now_s)

    def _lay_ready(self, now_s: float) -> None:
        """Have the first bytes at hand for the end of the hold, once everything sent before has left."""
        if self._flow is Flow.BYTES and not self.port.queued_bytes():
            self._answer = self.sender.answer(self._journal_room(), now_s)

    def _obey(self, command: Command, now_s: float) -> list[Event]:
        sender = self.sender
        if self._leave_at_s is not None and command is not Command.ABORT:
            return []  # the process ends, and a second SIGTERM does not put that off
        self.last_command = command
        if command is Command.ABORT:
            return sender.abort(now_s)
        if command is Command.RESUME:
            return sender.resume(now_s)
        events = sender.pause(now_s)
        if command is Command.LEAVE:
            self._leave_at_s = self._housekeeping.due_s = now_s + _LEAVE_S
            if sender.state is JobState.ARMED:
                events += sender.abort(now_s)
        return events

    def _send(self, now_s: float) -> None:
        sender, port = self.sender, self.port
        room = self._journal_room()
        queued = port.queued_bytes()
        if queued:
            room = min(room, sender.clock.pace.inflight_max_bytes - queued)
        chunk = sender.take(room, now_s)
        if not chunk:
            self._retry_at_s = now_s + sender.clock.pace.byte_s if queued else 0.0
            return
        self._hand_over(chunk)

    def _hand_over(self, chunk: bytes) -> bool:
        """Write what the sender gave; False where the system did not take all of it."""
        sender = self.sender
        accepted = self.port.write(chunk)
        self._is_full = accepted < len(chunk)
        if self._is_full:
            sender.give_back(len(chunk) - accepted)
        self.journal.note(sender.offset_bytes, sender.state)
        return not self._is_full

    def _is_drained(self, now_s: float) -> bool:
        """Whether the system's queue is empty, or holds no block that a control still reads; it may hold for long."""
        queued, sender = self.port.queued_bytes(), self.sender
        if not queued:
            return True
        self._retry_at_s = now_s + _FLOW_POLL_S
        late_s = now_s - sender.clock.idle_at_s
        if late_s < _DRAIN_S:
            return False
        if sender.offset_bytes - queued < sender.tape.end.essential_bytes:
            self._report(sender.still_queued(late_s, now_s))
            return False
        sender.note = f"the control stopped reading; {queued} bytes were still in the system's queue"
        self.port.purge()  # close would wait for them
        return True

    def _watch_flow(self, now_s: float) -> list[Event]:
        """Where no XOFF can be read: a modem line, or a driver that takes nothing more, says that the control holds."""
        if self._flow is Flow.MODEM:
            return self.sender.peer_is_ready(self.port.may_send(), now_s)
        if self._flow is Flow.DRIVER:
            if not self._is_full and self.port.queued_bytes() < self.sender.clock.pace.inflight_max_bytes:
                self._moving_at_s = now_s
            stuck_s = max(_STUCK_S, _STUCK_BYTES * self.sender.clock.pace.byte_s)  # a byte takes 0.1 s at 110 baud
            return self.sender.peer_is_ready(now_s - self._moving_at_s < stuck_s, now_s)
        return []

    def _report(self, events: Iterable[Event]) -> None:
        for event in events:
            self._sink(event)
        if events:
            self.journal.note(self.sender.offset_bytes, self.sender.state)

    def _housekeep(self, now_s: float) -> None:
        """Once a second: what is found beside the bytes, and a leave that is due."""
        self._report(self._housekeeping.look(self.journal, now_s))
        if self._leave_at_s is not None and now_s >= self._leave_at_s:
            self._report(self.sender.abort(now_s))
