"""A control and its machine, joined to a host by their serial interface in memory, on a clock of the test's own."""

from __future__ import annotations

from dataclasses import dataclass, field

from sim.control import Execution
from sim.faults import StartRule, parse_faults
from sim.live import LiveMill
from sim.messages import Completed, Heard
from sim.motion.values import Samples
from sim.profile import AxisLimits, MillProfile
from sim.uart import Uart

AXIS = AxisLimits(-500.0, 500.0, 300.0, 2000.0, 20000.0)
PROFILE = MillProfile(
    baud=9600, format="8N1", xon=0x11, xoff=0x13, says_xon_at_start=False, dialect="sinumerik",
    knot_rule="nx", poly_degree=5, g28="iso", backward_jump_alarm=14000, has_tool_changer=True, is_inch=False,
    resolution_mm=0.001, tool_length_reference="tip", receive_buffer_bytes=256, xoff_free_bytes=64, xon_fill_bytes=64,
    block_cycle_s=0.004,
    lookahead_blocks=4, axes=(AXIS, AXIS, AXIS),
)  # fmt: skip
HEAD = b"%_N_TEST_MPF\nN10 G90 G64 F3000\n"
MOVES = b"".join(b"N%d G1 X%d Y1 Z500\n" % (20 + step, step % 2 * 10) for step in range(40))
PROGRAM = HEAD + MOVES + b"N90 M30\n%\n"


@dataclass
class Cable:
    """A host that obeys DC1 and DC3 at once, the interface, the control; `heard` is what the host heard."""

    program: bytes
    faults: tuple[str, ...] = ()
    is_deaf: bool = False
    profile: MillProfile = PROFILE
    tool_radii_mm: dict[int, float] = field(default_factory=dict)
    heard: bytes = b""
    executions: list[Execution] = field(default_factory=list)
    samples: list[Samples] = field(default_factory=list)
    is_completed: bool = False

    def __post_init__(self) -> None:
        faults = parse_faults(self.faults)
        self.uart = Uart(self.profile, faults, seed=1)
        self.mill = LiveMill(self.profile, faults, self.samples.append, self.tool_radii_mm)
        self.now_s = 0.0
        self.is_held = faults.start not in (None, StartRule.IMMEDIATE)

    def run(self, for_s: float) -> Cable:
        end_s = self.now_s + for_s
        while self.now_s < end_s and not self.is_completed:
            self.now_s += 0.004
            self._host()
            receiver = self.uart.receiver
            self.mill.hear(Heard(self.uart.fetch(), receiver.received_bytes, receiver.overrun_bytes))
            for order in self.mill.advance(self.now_s):
                self.uart.obey(order, self.now_s)
                self.is_completed |= isinstance(order, Completed)
            if not self.executions or self.executions[-1] is not self.mill.control.execution:
                self.executions.append(self.mill.control.execution)
        return self

    def _host(self) -> None:
        said = self.uart.to_host(self.now_s)
        self.heard += said
        for byte in said if not self.is_deaf else b"":
            self.is_held = {0x13: True, 0x11: False}.get(byte, self.is_held)
        if not self.is_held:
            size = min(4, self.uart.room_bytes)
            self.uart.host_wrote(self.program[:size], self.now_s)
            self.program = self.program[size:]

    @property
    def names(self) -> list[str]:
        return [execution.name for execution in self.executions]


def alarm_numbers(cable: Cable) -> list[int]:
    return [alarm.number for _, alarm in cable.mill.alarms]
