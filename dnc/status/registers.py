"""From Modbus words to named values: which registers to read, and what they mean. Pure; zero-based wire addresses.

`sim.panel` writes the same map on its own, on purpose: one mistake must not hide in both.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from dnc.profile import Register

Value = bool | int | float | str
Place = tuple[int, int]
"""Function code and address."""

EXECUTION = (
    "UNAVAILABLE", "READY", "ACTIVE", "FEED_HOLD", "INTERRUPTED", "OPTIONAL_STOP", "PROGRAM_STOPPED", "WAIT",
    "PROGRAM_COMPLETED", "STOPPED",
)  # fmt: skip
CONTROLLER_MODE = ("AUTOMATIC", "MANUAL_DATA_INPUT", "MANUAL", "SEMI_AUTOMATIC", "EDIT")
WORDS = {"execution": EXECUTION, "controller_mode": CONTROLLER_MODE}

_ASCII_BYTES = 32
_FORMS = {"u16": ">H", "i16": ">h", "u32": ">I", "i32": ">i", "ascii": f">{_ASCII_BYTES}s"}


def _input(
    address: int,
    kind: Literal["u16", "i16", "u32", "i32", "ascii"],
    limits: tuple[float, float] | None = None,
    scale: float = 1.0,
) -> Register:
    return Register(function=4, address=address, type=kind, scale=scale, limits=limits)


def _bit(address: int) -> Register:
    return Register(function=2, address=address, type="bit")


_TRAVEL_MM = (-20_000.0, 20_000.0)
_PERCENT = (0.0, 200.0)

VIRTUAL_MILL: Mapping[str, Register] = {
    "emergency_stop_ok": _bit(0),
    "control_ready": _bit(1),
    "in_cycle": _bit(2),
    "feed_hold": _bit(3),
    "alarm": _bit(4),
    "door_closed": _bit(5),
    "spindle_on": _bit(6),
    "coolant_on": _bit(7),
    "external_execution": _bit(8),
    "single_block": _bit(9),
    "dry_run": _bit(10),
    "optional_stop": _bit(11),
    "map_version": _input(0, "u16", (1.0, 1.0)),
    "heartbeat": _input(1, "u16"),
    "execution": _input(2, "u16", (0.0, 9.0)),
    "controller_mode": _input(3, "u16", (0.0, 4.0)),
    "alarm_number": _input(4, "u16"),
    "feed_override_percent": _input(5, "u16", _PERCENT),
    "rapid_override_percent": _input(6, "u16", _PERCENT),
    "spindle_override_percent": _input(7, "u16", _PERCENT),
    "block": _input(8, "u32"),
    "x_mm": _input(10, "i32", _TRAVEL_MM, 0.001),
    "y_mm": _input(12, "i32", _TRAVEL_MM, 0.001),
    "z_mm": _input(14, "i32", _TRAVEL_MM, 0.001),
    "feed_mm_min": _input(16, "u32", (0.0, 1_000_000.0), 0.1),
    "spindle_rpm": _input(18, "i32", (-200_000.0, 200_000.0)),
    "tool": _input(20, "u16"),
    "buffer_fill_percent": _input(21, "u16", (0.0, 100.0)),
    "overrun_bytes": _input(22, "u32"),
    "uptime_s": _input(24, "u32"),
    "to_go_x_mm": _input(26, "i32", _TRAVEL_MM, 0.001),
    "to_go_y_mm": _input(28, "i32", _TRAVEL_MM, 0.001),
    "to_go_z_mm": _input(30, "i32", _TRAVEL_MM, 0.001),
    "program": _input(32, "ascii"),
}


@dataclass(frozen=True, slots=True)
class Request:
    """One read: function code, first address, how many bits or words."""

    function: int
    address: int
    count: int


@dataclass(frozen=True, slots=True)
class Decoded:
    """A value, or the sentence that says why there is none."""

    value: Value | None
    problem: str


def width(register: Register) -> int:
    """Bits or words that the register takes."""
    return 1 if register.type == "bit" else struct.calcsize(_FORMS[register.type]) // 2


def requests(registers: Iterable[Register], longest_gap: int = 16) -> list[Request]:
    """The fewest reads that hold all these registers, never splitting one; gaps up to `longest_gap` are read along.

    >>> requests(VIRTUAL_MILL.values())
    [Request(function=2, address=0, count=12), Request(function=4, address=0, count=48)]
    """
    found: list[Request] = []
    for register in sorted(registers, key=lambda one: (one.function, one.address)):
        most = 2000 if register.function in (1, 2) else 125
        end = register.address + width(register)
        last = found[-1] if found else None
        if (
            last is not None
            and last.function == register.function
            and register.address <= last.address + last.count + longest_gap
            and max(end, last.address + last.count) - last.address <= most
        ):
            found[-1] = Request(last.function, last.address, max(end - last.address, last.count))
        else:
            found.append(Request(register.function, register.address, end - register.address))
    return found


def decode(name: str, register: Register, image: Mapping[Place, int]) -> Decoded:
    """The value of one register in what was read; big-endian words, scaled, checked against its limits."""
    places = [(register.function, register.address + index) for index in range(width(register))]
    if any(place not in image for place in places):
        return Decoded(None, "not read")
    words = [image[place] for place in places]
    if register.type == "bit":
        return Decoded(bool(words[0]), "")
    raw = struct.pack(f">{len(words)}H", *words)
    (number,) = struct.unpack(_FORMS[register.type], raw)
    if register.type == "ascii":
        return _decode_text(number)
    return _decode_number(name, register, number)


def _decode_text(raw: bytes) -> Decoded:
    text = raw.split(b"\0")[0]
    if any(not 0x20 <= byte < 0x7F for byte in text):
        return Decoded(None, "holds bytes that are not text")
    return Decoded(text.decode("ascii"), "")


def _decode_number(name: str, register: Register, number: int) -> Decoded:
    if name in WORDS:
        if number >= len(WORDS[name]):
            return Decoded(None, f"{number} is no word of {name}")
        return Decoded(WORDS[name][number], "")
    value = number if register.scale == 1.0 else round(number * register.scale, 9)
    if register.limits is not None and not register.limits[0] <= value <= register.limits[1]:
        return Decoded(None, f"{value} is outside {register.limits[0]:g} to {register.limits[1]:g}")
    return Decoded(value, "")
