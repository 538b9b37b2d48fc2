"""What the mill shows at one moment, and how that stands in its Modbus map (docs/interface, section 8).

`dnc.status.registers` reads the same map on its own, on purpose: one mistake must not hide in both.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from sim.control import IN_CYCLE, Execution, Mode

MAP_VERSION = 1
INPUT_REGISTERS = 64
DISCRETE_INPUTS = 12


@dataclass(frozen=True, slots=True)
class Panel:
    """One moment of the mill, all of it taken together; positions of the programmed point in work coordinates."""

    uptime_s: float = 0.0
    execution: Execution = Execution.UNAVAILABLE
    mode: Mode = Mode.AUTOMATIC
    alarm_number: int = 0
    feed_override_percent: float = 100.0
    spindle_override_percent: float = 100.0
    block: int | None = None
    position_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    distance_to_go_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    feed_mm_min: float = 0.0
    spindle_rpm: float = 0.0
    tool: int = 0
    is_coolant_on: bool = False
    is_optional_stop: bool = False
    is_emergency_stop: bool = False
    buffer_fill_percent: float = 0.0
    overrun_bytes: int = 0
    program: str = ""


def discrete_inputs(panel: Panel) -> list[bool]:
    """FC02, addresses 0 to 11."""
    is_on = panel.execution is not Execution.UNAVAILABLE
    return [
        is_on and not panel.is_emergency_stop,
        is_on and panel.alarm_number == 0,  # control ready
        panel.execution in IN_CYCLE,
        panel.execution is Execution.FEED_HOLD,
        panel.alarm_number != 0,
        is_on,  # door closed
        panel.spindle_rpm != 0.0,
        panel.is_coolant_on,
        is_on,  # execution from external
        panel.mode is Mode.SEMI_AUTOMATIC,
        False,  # dry run
        panel.is_optional_stop,
    ]


def input_registers(panel: Panel, heartbeat: int) -> list[int]:
    """FC04, addresses 0 to 63, as unsigned 16-bit words."""
    override = _word(panel.feed_override_percent)
    packed = struct.pack(
        ">8H I 3i I i 2H 2I 3i",
        MAP_VERSION,
        heartbeat % 65536,
        panel.execution.value,
        panel.mode.value,
        min(panel.alarm_number, 65535),
        override,
        min(override, 100),  # rapids never go faster than the axes do
        _word(panel.spindle_override_percent),
        (panel.block or 0) % (1 << 32),
        *(_micrometres(value) for value in panel.position_mm),
        round(max(0.0, panel.feed_mm_min) * 10) % (1 << 32),
        round(panel.spindle_rpm),
        panel.tool % 65536,
        _word(panel.buffer_fill_percent),
        panel.overrun_bytes % (1 << 32),
        int(panel.uptime_s) % (1 << 32),
        *(_micrometres(value) for value in panel.distance_to_go_mm),
    )
    name = panel.program.encode("ascii", "replace")[:32].ljust(32, b"\0")
    padded = (packed + name).ljust(2 * INPUT_REGISTERS, b"\0")
    return list(struct.unpack(f">{INPUT_REGISTERS}H", padded))


def _word(value: float) -> int:
    return min(max(round(value), 0), 65535)


def _micrometres(value_mm: float) -> int:
    return min(max(round(value_mm * 1000.0), -(1 << 31)), (1 << 31) - 1)
