"""The mill's end of the cable: a pseudo-terminal under the byte clock, with the control in a child process.

A pseudo-terminal carries 4 kB at once, whatever its baud rate says. So a byte is on the wire only when the byte clock
says so: what was written is read no faster than the adapter's FIFO has room, and DC3 is handed to the host when its own
stop bit would have come. Nothing is decided late in the host's favour: a late look at the pseudo-terminal makes bytes
arrive later, a late DC3 makes the overshoot larger, and both are recorded as hold-ups of this process.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import select
import statistics
import time
import tty
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from planner.errors import SettingsRejected, UserError
from sim.clock import HoldUps, MachineClock, punctual
from sim.messages import BrokeOff, Completed, Failed, Finish, Heard, Message, Ready, Result, Start, Wire
from sim.receiver import Cycle
from sim.uart import Uart


@dataclass(frozen=True, slots=True)
class Patience:
    """How long the line process waits for what; seconds on the wall."""

    quiet_s: float = 0.3
    """without a byte after the program's end until the mill is done"""
    ends_on_alarm: bool = False
    """whether an alarm or a reset ends it as the program's end does; else somebody may go on afterwards"""
    forward_s: float = 0.002
    """between two deliveries to the control"""
    idle_s: float = 0.05
    """at most between two looks at everything"""
    spin_s: float = 0.0001
    """before a byte is due, during which the clock is watched without sleeping"""
    disturbed_s: float = 0.0006
    """hold-up above which a stop does not count as measured"""
    priority: int = 20
    """of the process, in real time, where that is allowed"""
    cycles_reported: int = 10_000
    """stops listed one by one in the report"""


class Pty:
    """A raw pseudo-terminal, and a symbolic link to it where one is wanted."""

    def __init__(self, link: Path | None) -> None:
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self.master, False)
        self.name = os.ttyname(self._slave)
        self._link = link
        if link is not None:
            try:
                if link.is_symlink():
                    link.unlink()
                link.symlink_to(self.name)
            except OSError as problem:
                raise SettingsRejected(f"--link {link}: {problem.strerror}", remedy="choose another place") from None

    def close(self) -> None:
        """Pull the adapter out; harmless twice."""
        for end in (self.master, self._slave):
            with contextlib.suppress(OSError):
                os.close(end)
        self.master = self._slave = -1
        if self._link is not None and self._link.is_symlink():
            self._link.unlink()


class LineProcess:
    """Carries bytes between pseudo-terminal, interface and the control's process until the program has ended."""

    def __init__(self, pty: Pty, uart: Uart, wire: Wire, clock: MachineClock, patience: Patience) -> None:
        self.pty, self.uart, self.wire, self.clock, self.patience = pty, uart, wire, clock, patience
        self.hold_ups = HoldUps(patience.spin_s)
        self.is_completed = self.is_real_time = False
        self._sha256 = hashlib.sha256()
        self._unsent = bytearray()
        self._forward_s = 0.0
        self._told_overrun_bytes = 0
        self._last_byte_s = time.monotonic()
        self._cycle_s = 0.0
        self._cycles: list[tuple[Cycle, float]] = []

    def run(self, stop_fd: int) -> bool:
        """Until the program has ended and the line is quiet (True), or a signal comes (False)."""
        with punctual(self.patience.priority) as self.is_real_time:
            while not self._is_over():
                if self._turn(stop_fd):
                    return False
        return True

    def report(self) -> dict[str, Any]:
        """The line's half of the report."""
        receiver = self.uart.receiver
        self._close_cycles()
        quiet = [cycle for cycle, held_up_s in self._cycles if held_up_s <= self.patience.disturbed_s]
        used = [cycle.utilisation for cycle in quiet if cycle.utilisation is not None]
        open_stop = receiver.overshoot_bytes if receiver.is_held else 0
        return {
            "bytes_received": receiver.received_bytes,
            "sha256": self._sha256.hexdigest(),
            "overrun_bytes": receiver.overrun_bytes,
            "xoff_sent": receiver.xoff_sent,
            "overshoot_bytes_max": max([open_stop, *(cycle.overshoot_bytes for cycle, _ in self._cycles)]),
            "overshoot_bytes_max_undisturbed": max((cycle.overshoot_bytes for cycle in quiet), default=0),
            "utilisation_median_undisturbed": statistics.median(used) if used else None,
            "xoff_cycles_undisturbed": len(quiet),
            "hold_up_s_max": self.hold_ups.worst_s,
            "is_real_time": self.is_real_time,
            "xoff_cycles": [
                {
                    "monotonic_s": self.clock.wall_s(cycle.xoff_s),
                    "overshoot_bytes": cycle.overshoot_bytes,
                    "run_bytes": cycle.run_bytes,
                    "utilisation": cycle.utilisation,
                    "hold_up_s": held_up_s,
                }
                for cycle, held_up_s in self._cycles[: self.patience.cycles_reported]
            ],
        }

    def _is_over(self) -> bool:
        quiet = time.monotonic() - self._last_byte_s > self.patience.quiet_s
        return self.wire.is_closed or (self.is_completed and quiet)

    def _turn(self, stop_fd: int) -> bool:
        """One look at everything; True if a signal asks for the end."""
        if self.uart.is_unplugged and self.pty.master >= 0:
            self.pty.close()
        self._speak()
        self._forward()
        begun_s = time.monotonic()
        exact_s, deadline_s = self._deadlines_s(begun_s)
        timeout_s = max(0.0, min(deadline_s, exact_s - self.patience.spin_s) - begun_s)
        port = [self.pty.master] if self.pty.master >= 0 and self.uart.room_bytes > 0 else []
        reads: list[int | Wire] = [stop_fd, self.wire, *port]
        ready, _, _ = select.select(reads, [self.wire] if self.wire.has_unsent else [], [], timeout_s)
        woken_s = time.monotonic()
        self.hold_ups.note(woken_s, woken_s - max(deadline_s, begun_s))
        if port and self.pty.master in ready:
            self._listen()
        if self.wire in ready:
            self._obey(self.wire.receive())
        self.wire.flush()
        self.hold_ups.note(time.monotonic(), time.monotonic() - woken_s)
        return stop_fd in ready

    def _deadlines_s(self, now_s: float) -> tuple[float, float]:
        """Monotonic times: of something that must happen on the spot, and when to look at the latest.

        Looking when the line runs dry tells a late host from a late mill: if this look is in time, the host was late.
        """
        incoming = self.uart.incoming
        exact_s = self._wall_s(self.uart.next_wake_s)
        if self.uart.room_bytes <= 0:
            exact_s = min(exact_s, self._wall_s(incoming.arrival_s(max(1, self.uart.faults.fifo // 2))))
        due_s = min(exact_s, now_s + self.patience.idle_s)
        if incoming.waiting_bytes:
            due_s = min(due_s, self._wall_s(incoming.idle_from_s))
        if self._unsent or incoming.waiting_bytes:
            due_s = min(due_s, max(now_s, self._forward_s))
        return exact_s, due_s

    def _wall_s(self, machine_s: float) -> float:
        return self.clock.wall_s(machine_s) if math.isfinite(machine_s) else math.inf

    def _speak(self) -> None:
        """Hand to the host what has reached it; a host that does not listen loses it, as on a wire."""
        data = self.uart.to_host(self.clock.now_s())
        if data and self.pty.master >= 0:
            with contextlib.suppress(BlockingIOError):
                os.write(self.pty.master, data)

    def _listen(self) -> None:
        try:
            data = os.read(self.pty.master, self.uart.room_bytes)
        except BlockingIOError:
            return
        except OSError:
            self.pty.close()
            return
        self._last_byte_s = time.monotonic()
        self.uart.host_wrote(data, self.clock.now_s())

    def _forward(self) -> None:
        """Give the control what has arrived, some hundred times a second."""
        data = self.uart.fetch()
        self._sha256.update(data)
        self._unsent += data
        now_s = time.monotonic()
        receiver = self.uart.receiver
        is_news = bool(self._unsent) or receiver.overrun_bytes != self._told_overrun_bytes
        if is_news and now_s >= self._forward_s:
            self._told_overrun_bytes = receiver.overrun_bytes
            self.wire.send(Heard(bytes(self._unsent), receiver.received_bytes, receiver.overrun_bytes))
            self._unsent.clear()
            self._forward_s = now_s + self.patience.forward_s
        self._close_cycles()

    def _obey(self, messages: list[Message]) -> None:
        for message in messages:
            match message:
                case Completed():
                    self.is_completed = True
                    self._last_byte_s = time.monotonic()
                case Failed(sentence, _):
                    raise UserError(sentence)
                case Ready() | Start() | Heard() | Finish() | Result():
                    pass
                case _:
                    if isinstance(message, BrokeOff) and self.patience.ends_on_alarm:
                        self.is_completed, self._last_byte_s = True, time.monotonic()
                    self.uart.obey(message, self.clock.now_s())

    def _close_cycles(self) -> None:
        """Judge the cycles that have ended by whether this process was there from one DC1 to the next."""
        for cycle in self.uart.receiver.cycles:
            ended_s = self.clock.wall_s(cycle.xon_s)
            self._cycles.append((cycle, self.hold_ups.worst_between(self._cycle_s, ended_s)))
            self._cycle_s = ended_s
        self.uart.receiver.cycles.clear()
