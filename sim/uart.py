"""The control's serial interface: line in, receive buffer, line out, and what can go wrong on the wire.

I/O-free; times in machine seconds. `host_wrote` and `to_host` are the host's end of the cable, `fetch`, `take` and the
other verbs are the control's. The same seed and the same calls give the same bytes.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator

from sim.faults import Faults, ReplyParity, StartRule
from sim.line import Line, Run
from sim.messages import Began, BrokeOff, Completed, Order, Power, StopReading, Took
from sim.profile import MillProfile
from sim.receiver import Marks, Receiver, Word


class Uart:
    """Both directions of the line and the ring between them."""

    def __init__(self, profile: MillProfile, faults: Faults, seed: int) -> None:
        self.faults = faults
        self.byte_time_s = profile.bits_per_byte / profile.baud
        self.incoming = Line(self.byte_time_s, faults.fifo)
        self.outgoing = Line(self.byte_time_s, 1 << 20)
        marks = Marks(profile.receive_buffer_bytes, profile.xoff_free_bytes, profile.xon_fill_bytes)
        self.receiver = Receiver(marks, self._say_word)
        self.is_on = True
        self._codes = {Word.XON: profile.xon, Word.XOFF: profile.xoff}
        self._start = faults.start or (StartRule.REPEATED_XON if profile.says_xon_at_start else StartRule.IMMEDIATE)
        self._mask = 0x7F if profile.format[0] == "7" else 0xFF
        self._said = {Word.XON: 0, Word.XOFF: 0}
        self._damage = random.Random(seed)  # two streams: how often the clock is asked must not change what is drawn
        self._noise = random.Random(seed + 1)
        self._noise_s = self._noise.expovariate(faults.noise) if faults.noise else math.inf
        self._repeat_s = math.inf
        self._now_s = 0.0

    @property
    def room_bytes(self) -> int:
        """How much the host may hand to its adapter now."""
        return max(0, self.incoming.room_bytes)

    @property
    def is_unplugged(self) -> bool:
        """The host's adapter has been pulled out."""
        moment = self.faults.unplug
        return moment is not None and moment.has_come(self._now_s, self.receiver.received_bytes)

    @property
    def next_wake_s(self) -> float:
        """The next time at which something must happen even if nobody calls: a byte to the host, DC3, noise."""
        wake_s = min(self.outgoing.next_arrival_s, self._noise_s, self._repeat_s)
        if not self.receiver.is_held:
            wake_s = min(wake_s, self.incoming.arrival_s(self.receiver.until_xoff_bytes))
        unplug = self.faults.unplug
        if unplug is not None and unplug.at_s is not None:
            wake_s = min(wake_s, unplug.at_s)
        return wake_s

    def host_wrote(self, data: bytes, now_s: float) -> None:
        """The host handed these bytes to its adapter."""
        self.advance(now_s)
        self.incoming.write(data, now_s)

    def to_host(self, now_s: float) -> bytes:
        """What has reached the host by now."""
        self.advance(now_s)
        return b"".join(run.data for run in self.outgoing.carried(now_s))

    def advance(self, now_s: float) -> None:
        """Let the lines run up to now."""
        self._now_s = now_s
        for run in self.incoming.carried(now_s):
            for part in self._damaged(run):
                self._arrive(part)
        while self._noise_s <= now_s:
            self.outgoing.write(bytes([self._noise.randrange(256)]), self._noise_s)
            self._noise_s += self._noise.expovariate(self.faults.noise)
        while self._repeat_s <= now_s:
            self._say_word(Word.XON, self._repeat_s)
            self._repeat_s += 1.0

    def fetch(self) -> bytes:
        """What has reached the ring since the last call."""
        return self.receiver.fetch()

    def obey(self, order: Order, now_s: float) -> None:
        """What the control wants of its interface."""
        self.advance(now_s)
        match order:
            case Took(count):
                self.receiver.take(count, now_s)
            case Began():
                self._begin(now_s)
            case StopReading():
                if not self.receiver.is_held:
                    self.receiver.hold(now_s)
            case BrokeOff(mark):
                self.receiver.clear(now_s)
                self.receiver.hold(now_s)
                self._say(mark, now_s)
            case Power(is_on):
                self._power(now_s, is_on=is_on)
            case Completed():
                pass

    def _begin(self, now_s: float) -> None:
        """Cycle start: say DC1 where the start rule wants it."""
        if self.receiver.is_held:
            self.receiver.release(now_s)
        elif self._start is not StartRule.IMMEDIATE:
            self._say_word(Word.XON, now_s)
        if self._start is StartRule.REPEATED_XON:
            self._repeat_s = now_s + 1.0

    def _power(self, now_s: float, *, is_on: bool) -> None:
        """Switch the control off (deaf and dumb, ring lost) or on (it says DC1 where its start rule has one)."""
        self.is_on = is_on
        self.receiver.clear(now_s)
        self.outgoing.drop()
        if is_on:
            self._say_word(Word.XON, now_s)

    def _arrive(self, run: Run) -> None:
        if not self.is_on:
            return
        self._repeat_s = math.inf
        if self._mask != 0xFF:
            run = Run(run.first_s, run.byte_time_s, bytes(byte & self._mask for byte in run.data))
        self.receiver.arrive(run)

    def _damaged(self, run: Run) -> Iterator[Run]:
        """The run as the faults let it through: bytes missing, bits turned."""
        if not (self.faults.drop or self.faults.flip):
            yield run
            return
        for index, byte in enumerate(run.data):
            if self._damage.random() < self.faults.drop:
                continue
            if self._damage.random() < self.faults.flip:
                byte ^= 1 << self._damage.randrange(8)
            yield Run(run.first_s + index * run.byte_time_s, run.byte_time_s, bytes([byte]))

    def _say_word(self, word: Word, now_s: float) -> float:
        """Say DC1 or DC3 as the faults allow; when it begins to leave, infinite if it never does."""
        self._said[word] += 1
        number, faults = self._said[word], self.faults
        is_stop = word is Word.XOFF
        if (faults.lose_xoff if is_stop else faults.lose_xon).names(number):
            return math.inf
        delay_s = faults.reaction + faults.xoff_delay if is_stop else faults.xon_delay
        code = bytes([self._codes[word]])
        begin_s = self._say(code, now_s + delay_s)
        if (faults.double_xoff if is_stop else faults.double_xon).names(number):
            self._say(code, now_s + delay_s)
        return begin_s

    def _say(self, data: bytes, now_s: float) -> float:
        silence = self.faults.silence
        if not self.is_on or (silence is not None and silence.has_come(now_s, self.receiver.received_bytes)):
            return math.inf
        if self.faults.parity is ReplyParity.EVEN:
            data = bytes(byte | 0x80 * (byte.bit_count() % 2) for byte in data)
        return self.outgoing.write(data, now_s)
