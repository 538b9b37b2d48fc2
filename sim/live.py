"""The control and its machine while a program comes in over the line: blocks are prepared, interpreted and cut.

I/O-free; times in machine seconds. It hears what the ring holds and says what it took.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum
from pathlib import Path

from sim.block_reader import BlockReader
from sim.control import Control, Execution, Happening
from sim.faults import Faults
from sim.interpreter import canon
from sim.interpreter.run import Interpreter, holds_block
from sim.messages import Began, BrokeOff, Completed, Heard, Order, Power, StopReading, Took
from sim.mill import settings_of, standing_at
from sim.motion.machine import Machine
from sim.motion.values import MachineState, Samples, StopReason
from sim.operator import Key, Operator
from sim.panel import Panel
from sim.profile import MillProfile

SYN = b"\x16"
NAK = b"\x15"
EMERGENCY_STOP_ALARM = 3000
OVERRUN_ALARM = 87
"""The number FANUC controls give a buffer that ran over; the SINUMERIK's is not known."""

_STRIDES = 8
_FOLLOWS = {
    MachineState.FEED_HOLD: Happening.FEED_HOLD,
    MachineState.PROGRAM_STOPPED: Happening.PROGRAM_STOP,
    MachineState.OPTIONAL_STOP: Happening.OPTIONAL_STOP,
    MachineState.SINGLE_BLOCK: Happening.BLOCK_END,
    MachineState.COMPLETED: Happening.PROGRAM_END,
    MachineState.ALARM: Happening.ALARM,
}
_ANSWERED = (Execution.PROGRAM_STOPPED, Execution.OPTIONAL_STOP, Execution.INTERRUPTED)
_READS = (*_ANSWERED, Execution.ACTIVE, Execution.FEED_HOLD, Execution.WAIT)


class _Ear(Enum):
    """Whether the control still reads: the program may have ended, or have been broken off by reset or alarm."""

    LISTENING = "listening"
    ENDED = "ended"
    BROKEN_OFF = "broken off"


class LiveMill:
    """One control, one machine, one program."""

    def __init__(
        self,
        profile: MillProfile,
        faults: Faults,
        log: Callable[[Samples], None],
        tool_radii_mm: Mapping[int, float] | None = None,
        subprogram_folder: Path | None = None,
    ) -> None:
        self.profile, self.faults = profile, faults
        self.control = Control()
        self.machine = Machine(profile, profile.block_cycle_s, stops_at_optional=faults.optional_stop)
        self.machine.set_override(faults.override)
        self.alarms: list[tuple[float, canon.Alarm]] = []
        self.blocks = 0
        self.begun_s: float | None = None
        self.completed_s: float | None = None
        settings = settings_of(
            profile, is_drip_fed=True, tool_radii_mm=tool_radii_mm, subprogram_folder=subprogram_folder
        )
        self._interpreter = Interpreter(settings)
        self._start_mm = settings.start_mm
        self._has_moved = False
        self._log = log
        self._reader = BlockReader()
        self._line = 0
        self._received_bytes = self._overrun_bytes = 0
        self._next_block_s = 0.0
        self._now_s = 0.0
        self._ear = _Ear.LISTENING
        self._program: str | None = None
        self._block: int | None = None
        self._awaits_tool = False
        self._orders: list[Order] = []
        self._operator = Operator(faults, self._start, self._cycle_start, self._keys())

    def hear(self, heard: Heard) -> None:
        """What has come into the ring."""
        self._received_bytes = heard.received_bytes
        if self._ear is not _Ear.BROKEN_OFF:
            self._reader.hear(heard.data)
        if heard.overrun_bytes > self._overrun_bytes:
            self._overrun_bytes = heard.overrun_bytes
            lost = canon.Alarm(self._line, None, OVERRUN_ALARM, "the receive buffer ran over, bytes are lost", None)
            self._refuse(lost, self._now_s)

    def advance(self, until_s: float) -> list[Order]:
        """Let machine time go on; what the interface must do in consequence."""
        stride_s = max(self.profile.block_cycle_s, (until_s - self._now_s) / _STRIDES)
        while self._now_s < until_s:
            now_s = min(until_s, self._now_s + stride_s)
            self._operator.act(now_s, self._received_bytes)
            self._prepare(now_s)
            samples = self.machine.advance(now_s)
            if len(samples.t_s):
                self._show(samples.last_number)
                if not self._has_moved:
                    samples, self._has_moved = standing_at(samples, self._start_mm)
                self._log(samples)
            self._follow(now_s)
            self._now_s = now_s
        orders, self._orders = self._orders, []
        return orders

    def panel(self) -> Panel | None:
        """What the mill shows now; None without power. A block without a number shows the last one there was."""
        if self.control.execution is Execution.UNAVAILABLE:
            return None
        seen = self.machine.snapshot()
        self._show(seen.block)
        return Panel(
            uptime_s=self._now_s,
            execution=self.control.execution,
            mode=self.control.mode,
            alarm_number=self.control.alarm_number,
            feed_override_percent=seen.override_percent,
            block=self._block,
            position_mm=seen.position_mm if self._has_moved else self._start_mm,
            distance_to_go_mm=seen.distance_to_go_mm,
            feed_mm_min=seen.feed_mm_min,
            spindle_rpm=seen.spindle_rpm,
            tool=seen.tool,
            is_coolant_on=seen.is_flood or seen.is_mist,
            is_optional_stop=self.faults.optional_stop,
            is_emergency_stop=self.control.alarm_number == EMERGENCY_STOP_ALARM,
            buffer_fill_percent=100.0 * self._reader.ring_bytes / self.profile.receive_buffer_bytes,
            overrun_bytes=self._overrun_bytes,
            program=self._program or "",
        )

    def _show(self, block: int | None) -> None:
        self._block = self._block if block is None else block

    # --- preparation

    def _prepare(self, now_s: float) -> None:
        """Take blocks out of the ring, one in each block cycle, as long as the machine has room for them."""
        if self._ear is _Ear.ENDED:
            self._swallow()
        if self._ear is _Ear.LISTENING:
            self._reader.skip_nuls()
            self._tell_taken()
        cycle_s = self.profile.block_cycle_s * self.faults.slow_drain
        while self._has_room() and self._next_block_s <= now_s:
            raw = self._reader.block()
            self._tell_taken()
            self._next_block_s = max(self._next_block_s, self._now_s)
            if raw is None:
                return
            self._next_block_s += cycle_s
            self._take(raw.strip(b"\r\0"), now_s)

    def _tell_taken(self) -> None:
        count = self._reader.taken()
        if count:
            self._orders.append(Took(count))

    def _has_room(self) -> bool:
        is_reading = self._ear is _Ear.LISTENING and self.control.execution in _READS
        return is_reading and self.machine.free_blocks > 0

    def _take(self, raw: bytes, now_s: float) -> None:
        self._line += 1
        if not raw.strip():
            return
        self.blocks += holds_block(raw)
        if self.begun_s is None:
            self.begun_s = now_s
        if self._program is None and raw.startswith(b"%_N_"):
            self._program = raw[4:].strip().decode("ascii", "replace")
        for command in self._interpreter.block(raw, self._line):
            if isinstance(command, canon.Alarm):
                self._refuse(command, now_s)
                return
            self.machine.offer(command)
            self._awaits_tool |= isinstance(command, canon.ChangeTool)
            if isinstance(command, canon.End):
                self._end()

    def _end(self) -> None:
        """The last block has been prepared: nothing that follows it is read."""
        self._ear = _Ear.ENDED
        self.machine.close()
        if self.faults.end_stops_reading:
            self._orders.append(StopReading())

    def _swallow(self) -> None:
        """After the end of the program the control lets the rest of the tape go by, or leaves it in the ring."""
        if not self.faults.end_stops_reading:
            self._reader.skip_all()
            self._tell_taken()

    def _refuse(self, alarm: canon.Alarm, now_s: float) -> None:
        """The control takes no more: DC3 and NAK at once, and a stop when what was prepared has been cut."""
        if self._ear is not _Ear.LISTENING or not self.control.raise_alarm(alarm.number):
            return
        self.alarms.append((now_s, alarm))
        self.machine.offer(alarm)
        self._orders.append(BrokeOff(NAK))
        self._forget()

    def _forget(self) -> None:
        self._reader.forget()
        self._ear = _Ear.BROKEN_OFF

    # --- what the machine has come to

    def _follow(self, now_s: float) -> None:
        """What the machine has come to, in the control's words."""
        if self._awaits_tool:
            self._follow_tool(now_s)
        state = self.machine.snapshot().state
        happening = _FOLLOWS.get(state)
        if happening is not None and self.control.happens(happening, now_s):
            if self.control.execution in _ANSWERED:
                self._operator.sees_stop(now_s)
            if happening is Happening.PROGRAM_END:
                self.completed_s = self.machine.time_s
                self._orders.append(Completed())

    def _follow_tool(self, now_s: float) -> None:
        """A change of tool is a wait for something that is not the program."""
        if self.machine.stands_for is StopReason.TOOL_CHANGE:
            self.control.happens(Happening.TOOL_CHANGE, now_s)
        elif self.control.happens(Happening.TOOL_CHANGED, now_s):
            self._awaits_tool = False

    # --- keys

    def _keys(self) -> dict[str, Key]:
        """What each key does, and its release, by the name of its fault."""
        return {
            "single_block": Key(self._single_block, self._continuous),
            "feed_hold": Key(self._feed_hold, self._cycle_start),
            "reset": Key(self._reset),
            "alarm": Key(self._emergency),
            "power_cycle": Key(self._power_off, self._power_on),
        }

    def _start(self, now_s: float) -> None:
        self.control.happens(Happening.CYCLE_START, now_s)
        self._orders.append(Began())

    def _cycle_start(self, now_s: float) -> None:
        if self.control.happens(Happening.CYCLE_START, now_s):
            self.machine.cycle_start()

    def _single_block(self, now_s: float) -> None:
        del now_s
        self.control.is_single_block = True
        self.machine.set_single_block(True)

    def _continuous(self, now_s: float) -> None:
        self.control.is_single_block = False
        self.machine.set_single_block(False)
        self._cycle_start(now_s)

    def _feed_hold(self, now_s: float) -> None:
        del now_s
        self.machine.feed_hold()

    def _reset(self, now_s: float) -> None:
        self.machine.reset()
        self.control.happens(Happening.RESET, now_s)
        self._orders.append(BrokeOff(SYN))
        self._forget()

    def _emergency(self, now_s: float) -> None:
        stop = canon.Alarm(self._line, None, EMERGENCY_STOP_ALARM, "emergency stop", None)
        if self.control.raise_alarm(stop.number):
            self.alarms.append((now_s, stop))
            self.machine.reset()
            self.control.happens(Happening.ALARM, now_s)
            self._orders.append(BrokeOff(NAK))
            self._forget()

    def _power_off(self, now_s: float) -> None:
        self.machine.reset()
        self.control.happens(Happening.POWER_OFF, now_s)
        self._orders.append(Power(is_on=False))
        self._forget()

    def _power_on(self, now_s: float) -> None:
        self.control.happens(Happening.POWER_ON, now_s)
        self._orders.append(Power(is_on=True))
