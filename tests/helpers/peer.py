"""A small control behind a pty, for tests of the sending side: byte clock, ring buffer, XON/XOFF; as a process.

`python tests/helpers/peer.py KEY=VALUE...` prints one JSON line with its pty when ready and one with what it saw: when
`expect_bytes` have come and the line has then been silent for `quiet_s`, or on SIGTERM, once it has read what still
lies in the pty. A busy computer may silence the line for long, so a test says how many bytes it expects, or stops the
peer. On SIGUSR1 it says `say_first`. It is a test tool, not the virtual mill.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import math
import os
import select
import signal
import sys
import time
import tty
from dataclasses import dataclass, field
from pathlib import Path

XON, XOFF = 0x11, 0x13


@dataclass
class Settings:
    """The peer's side of the cable; `eat_bytes_s` is how fast the control uses up its buffer."""

    baud: int = 9600
    bits: float = 10.0
    buffer_bytes: int = 1024
    xoff_free_bytes: int = 120
    xon_fill_bytes: int = 256
    eat_bytes_s: float = 1e9
    fifo_bytes: int = 16
    expect_bytes: int = 1
    quiet_s: float = 0.5
    mask_bytes: int = 0
    say_first: str = ""
    never_xon: int = 0
    hang_up_after_bytes: int = 0
    reset_after_bytes: int = 0
    say_after_bytes: int = 0
    say: str = ""
    stop_reading_after: str = ""
    echo: int = 0
    record: str = ""


@dataclass
class Seen:
    """What the control noticed."""

    bytes_received: int = 0
    overrun_bytes: int = 0
    xoff_sent: int = 0
    overshoot_bytes_max: int = 0
    late_s_max: float = 0.0
    data: bytearray = field(default_factory=bytearray)


class Peer:
    """The byte clock moves bytes from the pty into the buffer; thresholds send XOFF and XON back."""

    def __init__(self, settings: Settings) -> None:
        self.settings, self.seen = settings, Seen()
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        self.name = os.ttyname(self.slave)
        self.byte_s = settings.bits / settings.baud
        self.fifo = bytearray()
        self.fill = 0.0
        self.is_holding = False
        self.since_xoff = 0
        self.next_byte_s = math.inf
        self.last_s = time.monotonic()
        self.heard_s: float | None = None
        self.outgoing: list[tuple[float, int]] = []
        self.has_stopped_reading = False

    def run(self) -> None:
        while not self.is_done():
            now_s = time.monotonic()
            due = min([self.next_byte_s, now_s + 0.02, *(at for at, _ in self.outgoing)])
            if self.is_holding:
                due = min(due, now_s + 0.002)
            readers = [self.master] if len(self.fifo) < self.settings.fifo_bytes else []
            ready, _, _ = select.select(readers, [], [], max(0.0, due - now_s))
            self.step(time.monotonic(), bool(ready))

    def step(self, now_s: float, is_readable: bool) -> None:
        if is_readable:
            with contextlib.suppress(BlockingIOError):
                try:
                    self.fifo += os.read(self.master, self.settings.fifo_bytes - len(self.fifo))
                except OSError as problem:
                    if problem.errno != errno.EIO:
                        raise
            if self.fifo and self.next_byte_s == math.inf:
                self.next_byte_s = now_s + self.byte_s
        while self.fifo and self.next_byte_s <= now_s:
            self.seen.late_s_max = max(self.seen.late_s_max, now_s - self.next_byte_s)
            self.receive(self.fifo.pop(0), now_s)
            self.next_byte_s = self.next_byte_s + self.byte_s if self.fifo else math.inf
        self.fill = max(0.0, self.fill - (now_s - self.last_s) * self.settings.eat_bytes_s)
        self.last_s = now_s
        is_stuck = self.settings.never_xon or self.has_stopped_reading
        if self.is_holding and self.fill <= self.settings.xon_fill_bytes and not is_stuck:
            self.is_holding = False
            self.send(XON, now_s)
        while self.outgoing and self.outgoing[0][0] <= now_s:
            os.write(self.master, bytes([self.outgoing.pop(0)[1]]))

    def receive(self, byte: int, now_s: float) -> None:
        settings, seen = self.settings, self.seen
        self.heard_s = now_s
        seen.data.append(byte)
        seen.bytes_received += 1
        if self.is_holding:
            self.since_xoff += 1
            seen.overshoot_bytes_max = max(seen.overshoot_bytes_max, self.since_xoff)
        if self.fill >= settings.buffer_bytes:
            seen.overrun_bytes += 1
        else:
            self.fill += 1
        if settings.echo:
            self.send(byte, now_s)
        if settings.stop_reading_after and seen.data.endswith(settings.stop_reading_after.encode()):
            self.has_stopped_reading = True
            self.hold(now_s)
        if settings.buffer_bytes - self.fill <= settings.xoff_free_bytes:
            self.hold(now_s)
        if seen.bytes_received == settings.reset_after_bytes:
            self.send(XOFF, now_s)
            self.send(0x16, now_s)
        if seen.bytes_received == settings.say_after_bytes:
            for code in bytes.fromhex(settings.say):
                self.send(code, now_s)
        if seen.bytes_received == settings.hang_up_after_bytes:
            os.close(self.slave)
            os.close(self.master)
            raise SystemExit(self.report())

    def hold(self, now_s: float) -> None:
        if not self.is_holding:
            self.is_holding, self.since_xoff = True, 0
            self.seen.xoff_sent += 1
            self.send(XOFF, now_s)

    def send(self, code: int, now_s: float) -> None:
        start = max(now_s, self.outgoing[-1][0] if self.outgoing else now_s)
        parity = (code.bit_count() & 1) << 7 if self.settings.mask_bytes else 0
        self.outgoing.append((start + self.byte_s, code | parity))

    def is_done(self) -> bool:
        if self.heard_s is None or self.settings.quiet_s <= 0:
            return False
        if self.seen.bytes_received < self.settings.expect_bytes:
            return False
        is_waiting = self.is_holding and not self.has_stopped_reading
        return not is_waiting and time.monotonic() - max(self.heard_s, self.last_heard_hold()) > self.settings.quiet_s

    def read_the_rest(self) -> None:
        now_s = time.monotonic()
        while select.select([self.master], [], [], 0.1)[0]:
            self.fifo += os.read(self.master, 4096)
        for byte in self.fifo:
            self.receive(byte, now_s)

    def last_heard_hold(self) -> float:
        return self.outgoing[-1][0] if self.outgoing else 0.0

    def report(self) -> None:
        seen = self.seen
        if self.settings.record:
            Path(self.settings.record).write_bytes(seen.data)
        values = {
            "bytes_received": seen.bytes_received,
            "overrun_bytes": seen.overrun_bytes,
            "xoff_sent": seen.xoff_sent,
            "overshoot_bytes_max": seen.overshoot_bytes_max,
            "late_s_max": seen.late_s_max,
            "sha256": hashlib.sha256(bytes(seen.data)).hexdigest(),
        }
        sys.stdout.write(json.dumps(values) + "\n")
        sys.stdout.flush()


def main(words: list[str]) -> None:
    settings = Settings()
    for word in words:
        key, _, value = word.partition("=")
        setattr(settings, key, type(getattr(settings, key))(value))
    peer = Peer(settings)

    def on_term(_number: int, _frame: object) -> None:
        peer.read_the_rest()
        raise SystemExit(peer.report())

    signal.signal(signal.SIGTERM, on_term)
    sys.stdout.write(json.dumps({"pty": peer.name}) + "\n")
    sys.stdout.flush()
    signal.signal(signal.SIGUSR1, lambda *_: [peer.send(code, 0.0) for code in bytes.fromhex(settings.say_first)])
    peer.run()
    peer.report()


if __name__ == "__main__":
    main(sys.argv[1:])
