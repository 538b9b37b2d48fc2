"""The machine profile as the sending side reads it: every key of docs/interface section 4, checked.

`sim.profile` reads the same file on its own, on purpose: one mistake must not hide in both ends of the cable.
"""

from __future__ import annotations

import datetime as dt
import difflib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from dnc.errors import SettingsRejected
from dnc.framing import block_end_bytes, escaped_bytes
from dnc.places import user_machines
from dnc.shipped import shipped_names, shipped_path
from planner import tomlfile

Byte = Annotated[int, Meta(ge=0, le=255)]
Positive = Annotated[float, Meta(gt=0)]
AxisRate = Annotated[float, Meta(ge=1e-3, le=1e9)]
Waiting = Annotated[float, Meta(ge=0, le=31_536_000)]
Delay = Annotated[float, Meta(ge=0, le=3600)]
Cycle = Annotated[float, Meta(ge=1e-6, le=10)]
Count = Annotated[int, Meta(ge=0)]


class Link(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The serial line; characters are written data bits, parity, stop bits, such as 7E2.

    Without `inflight_max_bytes` the baud rate decides (pacing.default_inflight_bytes). `adapter_latency_s` is what an
    adapter adds between the control's XOFF and the moment we can read it, `adapter_fifo_bytes` what one that obeys XOFF
    itself (handshake driver), or a device server, may hold back without our knowing.
    """

    baud: Annotated[int, Meta(ge=50, le=4_000_000)] = 9600
    format: Annotated[str, Meta(pattern=r"^[5-8][NEOMS](1|1\.5|2)$")] = "8N1"
    handshake: Literal["xonxoff", "driver", "rtscts", "dtrdsr", "none"] = "xonxoff"
    xon: Byte = 0x11
    xoff: Byte = 0x13
    start: Literal["immediate", "wait-xon"] = "immediate"
    start_timeout_s: Waiting = 60.0
    hold_timeout_s: Waiting = 0.0
    hold_warning_s: Waiting = 120.0
    inflight_max_bytes: Annotated[int, Meta(ge=1)] | None = None
    adapter_latency_s: Delay = 0.0
    adapter_fifo_bytes: Count = 4096
    software_parity: bool = False
    char_delay_s: Delay = 0.0
    line_delay_s: Delay = 0.0

    @property
    def data_bits(self) -> int:
        """How many bits of a byte the line carries."""
        return int(self.format[0])


class Tape(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    r"""What surrounds the program; leader and trailer know \NUL*n, \CR, \LF, \DC2, \DC4 and plain text."""

    leader: str = ""
    trailer: str = ""
    end_of_block: str = "as-is"
    character_set: Literal["ascii", "iso", "any"] = "ascii"
    line_max_bytes: Annotated[int, Meta(ge=16)] = 4096


def framing_of(tape: Tape) -> list[str]:
    """What, beside the program, decides where on the tape each of its lines lies."""
    return [tape.leader, tape.trailer, tape.end_of_block]


class Control(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the control reads and how much it can take.

    `poly_degree` is the highest degree of POLY that the control is known to read, `g28` what that code of the ISO
    dialect does, `backward_jump_alarm` the number that a jump back raises while the program is fed.

    `retract_z_mm` is the machine height (not of the work offset) of a safe tool change; without it programs do not
    move there. `decimals` is the most decimals it reads, of inches where `units` are inches; without it any number.
    """

    dialect: Literal["sinumerik", "fanuc", "heidenhain", "linuxcnc", "generic"] = "sinumerik"
    knot_rule: Literal["nx", "genua"] = "nx"
    g28: Literal["iso", "alarm", "ignore"] = "iso"
    backward_jump_alarm: Annotated[int, Meta(ge=1, le=999_999)] = 14000
    knot_rule_verified: dt.date | Literal[False] = False
    poly_degree: Literal[3, 5] = 3
    resolution_mm: Positive = 0.001
    tool_length_reference: Literal["tip", "centre"] = "tip"
    receive_buffer_bytes: Annotated[int, Meta(ge=16, le=1 << 30)] = 30720
    xoff_free_bytes: Count = 120
    xon_fill_bytes: Count = 15360
    overrun_allowed_bytes: Count = 120
    block_cycle_s: Cycle = 0.004
    lookahead_blocks: Annotated[int, Meta(ge=1, le=1_000_000)] = 100
    min_spline_blocks: Count = 6
    retract_z_mm: float | None = None
    decimals: Annotated[int, Meta(ge=0, le=9)] | None = None
    has_tool_changer: bool = True
    units: Literal["mm", "inch"] = "mm"


class Axis(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One axis: travel, rapid speed, acceleration, jerk."""

    min_mm: float
    max_mm: float
    rapid_mm_min: AxisRate
    acceleration_mm_s2: AxisRate
    jerk_mm_s3: AxisRate


class Register(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One named value of the control's status map: zero-based wire address."""

    function: Annotated[int, Meta(ge=1, le=4)]
    address: Annotated[int, Meta(ge=0, le=65535)]
    type: Literal["bit", "u16", "i16", "u32", "i32", "ascii"]
    scale: float = 1.0
    limits: tuple[float, float] | None = None


class Modbus(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where machine status is read from."""

    host: str = "127.0.0.1"
    port: Annotated[int, Meta(ge=1, le=65535)] = 5020
    device_id: Annotated[int, Meta(ge=0, le=255)] = 1
    register: dict[str, Register] = msgspec.field(default_factory=dict)


class MachineProfile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A whole machine file."""

    link: Link
    control: Control
    axes: dict[Literal["X", "Y", "Z"], Axis]
    tape: Tape = msgspec.field(default_factory=Tape)
    modbus: Modbus = msgspec.field(default_factory=Modbus)


def profile_names() -> list[str]:
    """Every name that a profile can be called by: the shipped ones and those of the user's folder, sorted."""
    return sorted({*shipped_names("machines"), *(path.stem for path in user_machines().glob("*.toml"))})


def overlooked_profile(name: str) -> Path | None:
    """The user's own profile of a name that a shipped one has, which goes before it; None without one."""
    own = user_machines() / f"{name}.toml"
    return own if name in shipped_names("machines") and own.is_file() else None


def profile_path(name_or_path: str) -> Path:
    """Where a profile lies: a path ending in .toml, else one of those shipped, else the user's folder.

    Raises SettingsRejected for a name that is in neither, with the nearest one and the list.
    """
    if name_or_path.endswith(".toml") or "/" in name_or_path:
        return Path(name_or_path)
    own = user_machines() / f"{name_or_path}.toml"
    if name_or_path in shipped_names("machines"):
        return shipped_path("machines", name_or_path)
    if own.is_file():
        return own
    known = profile_names()
    near = difflib.get_close_matches(name_or_path, known, n=1)
    meant = f"did you mean {near[0]}? " if near else ""
    raise SettingsRejected(f"there is no machine named {name_or_path!r}", remedy=f"{meant}known: {', '.join(known)}")


def load_profile(path: Path) -> MachineProfile:
    """The profile in this file; raises SettingsRejected with file and line."""
    profile, lines = tomlfile.load(path, MachineProfile, error=SettingsRejected)
    missing = [name for name in ("X", "Y", "Z") if name not in profile.axes]
    if missing:
        raise SettingsRejected(
            f"axis {missing[0]} is missing", path=path, line=lines.get(("axes",)), remedy=f"add [axes.{missing[0]}]"
        )
    for key, what, remedy in _contradictions(profile):
        raise SettingsRejected(what, path=path, line=lines.get(key), remedy=remedy)
    for name in ("leader", "trailer", "end_of_block"):
        _refuse_framing(profile, name, path, lines.get(("tape", name)))
    return profile


def _refuse_framing(profile: MachineProfile, name: str, path: Path, line: int | None) -> None:
    """A misspelt escape is found before a program is asked for, and where it stands."""
    value = getattr(profile.tape, name)
    try:
        if name == "end_of_block":
            block_end_bytes(value)
        else:
            escaped_bytes(name, value)
    except SettingsRejected as problem:
        raise SettingsRejected(problem.what, path=path, line=line, remedy=problem.remedy) from None


def _contradictions(profile: MachineProfile) -> Iterator[tuple[tuple[str, ...], str, str]]:
    """Keys whose values do not go together: where, what is wrong, what to do."""
    control, link = profile.control, profile.link
    if control.xoff_free_bytes + control.xon_fill_bytes > control.receive_buffer_bytes:
        what = "xoff_free_bytes and xon_fill_bytes exceed receive_buffer_bytes"
        yield ("control", "xon_fill_bytes"), what, "lower one of them"
    if link.xon == link.xoff:
        yield ("link", "xoff"), f"xon and xoff are both {link.xon}", "give two different characters"
    for name, value in (("xon", link.xon), ("xoff", link.xoff)):
        if 32 <= value < 127 or value in b"\r\n":
            what = f"{name} is {chr(value)!r}, which programs contain"
            yield ("link", name), what, "write a control character, 17 for XON and 19 for XOFF as a rule"
    beyond = beyond_travel("retract_z_mm", control.retract_z_mm, profile)
    if beyond:
        yield ("control", "retract_z_mm"), beyond, "write a machine height that Z reaches"
    for name, axis in profile.axes.items():
        if axis.min_mm >= axis.max_mm:
            what = f"the travel of {name} goes from {axis.min_mm:g} to {axis.max_mm:g} mm"
            yield ("axes", name, "min_mm"), what, "write the smaller end as min_mm"


def beyond_travel(name: str, retract_z_mm: float | None, profile: MachineProfile) -> str:
    """What is wrong with a machine height that Z cannot reach, called by this name; empty where nothing is."""
    low, high = profile.axes["Z"].min_mm, profile.axes["Z"].max_mm
    if retract_z_mm is None or low <= retract_z_mm <= high:
        return ""
    return f"{name} {retract_z_mm:g} is beyond the travel of Z, {low:g} to {high:g} mm"
