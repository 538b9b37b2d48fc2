"""The machine profile as the simulated mill reads it; `dnc.profile` reads the same file on its own, on purpose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from planner import tomlfile
from planner.errors import SettingsRejected

Byte = Annotated[int, Meta(ge=0, le=255)]
Cycle = Annotated[float, Meta(ge=1e-6, le=10)]
Positive = Annotated[float, Meta(gt=0)]
Count = Annotated[int, Meta(ge=0)]


@dataclass(frozen=True, slots=True)
class AxisLimits:
    """One axis: travel in mm, rapid speed in mm/s, acceleration in mm/s2, jerk in mm/s3."""

    min_mm: float
    max_mm: float
    rapid_mm_s: float
    acceleration_mm_s2: float
    jerk_mm_s3: float


@dataclass(frozen=True, slots=True)
class MillProfile:
    """The machine's own view of itself: line, buffer, control, axes (X, Y, Z in this order)."""

    baud: int
    format: str
    xon: int
    xoff: int
    says_xon_at_start: bool
    dialect: str
    knot_rule: str
    poly_degree: int
    g28: str
    backward_jump_alarm: int
    has_tool_changer: bool
    is_inch: bool
    resolution_mm: float
    tool_length_reference: str
    receive_buffer_bytes: int
    xoff_free_bytes: int
    xon_fill_bytes: int
    block_cycle_s: float
    lookahead_blocks: int
    axes: tuple[AxisLimits, AxisLimits, AxisLimits]

    @property
    def bits_per_byte(self) -> float:
        """Start bit, data bits, parity bit, stop bits: 10 for 8N1, 11 for 7E2."""
        parity = 0 if self.format[1] == "N" else 1
        return 1 + int(self.format[0]) + parity + float(self.format[2:])


class _Link(msgspec.Struct, frozen=True):
    baud: Annotated[int, Meta(ge=50, le=4_000_000)] = 9600
    format: Annotated[str, Meta(pattern=r"^[5-8][NEOMS](1|1\.5|2)$")] = "8N1"
    xon: Byte = 0x11
    xoff: Byte = 0x13
    start: Literal["immediate", "wait-xon"] = "immediate"


class _Control(msgspec.Struct, frozen=True):
    dialect: str = "sinumerik"
    resolution_mm: Positive = 0.001
    receive_buffer_bytes: Annotated[int, Meta(ge=16, le=1 << 30)] = 30720
    xoff_free_bytes: Count = 120
    xon_fill_bytes: Count = 15360
    block_cycle_s: Cycle = 0.004
    lookahead_blocks: Annotated[int, Meta(ge=1, le=1_000_000)] = 100
    knot_rule: Literal["nx", "genua"] = "nx"
    poly_degree: Literal[3, 5] = 3
    g28: Literal["iso", "alarm", "ignore"] = "iso"
    backward_jump_alarm: Annotated[int, Meta(ge=1, le=999_999)] = 14000
    tool_length_reference: str = "tip"
    has_tool_changer: bool = True
    units: Literal["mm", "inch"] = "mm"


class _Axis(msgspec.Struct, frozen=True):
    min_mm: float
    max_mm: float
    rapid_mm_min: Positive
    acceleration_mm_s2: Positive
    jerk_mm_s3: Positive


class _Axes(msgspec.Struct, frozen=True):
    X: _Axis
    Y: _Axis
    Z: _Axis


class _MachineFile(msgspec.Struct, frozen=True):
    """The mill's half of the file; the keys of the sending side are not its business."""

    link: _Link
    control: _Control
    axes: _Axes


def load_mill_profile(path: Path) -> MillProfile:
    """The mill's half of a machine profile; raises SettingsRejected with file, line and key."""
    file, _ = tomlfile.load(path, _MachineFile, error=SettingsRejected)
    link, control = file.link, file.control
    return MillProfile(
        baud=link.baud,
        format=link.format,
        xon=link.xon,
        xoff=link.xoff,
        says_xon_at_start=link.start == "wait-xon",
        dialect=control.dialect,
        knot_rule=control.knot_rule,
        poly_degree=control.poly_degree,
        g28=control.g28,
        backward_jump_alarm=control.backward_jump_alarm,
        has_tool_changer=control.has_tool_changer,
        is_inch=control.units == "inch",
        resolution_mm=control.resolution_mm,
        tool_length_reference=control.tool_length_reference,
        receive_buffer_bytes=control.receive_buffer_bytes,
        xoff_free_bytes=control.xoff_free_bytes,
        xon_fill_bytes=control.xon_fill_bytes,
        block_cycle_s=control.block_cycle_s,
        lookahead_blocks=control.lookahead_blocks,
        axes=(_limits(file.axes.X), _limits(file.axes.Y), _limits(file.axes.Z)),
    )


def _limits(axis: _Axis) -> AxisLimits:
    return AxisLimits(
        min_mm=axis.min_mm,
        max_mm=axis.max_mm,
        rapid_mm_s=axis.rapid_mm_min / 60.0,
        acceleration_mm_s2=axis.acceleration_mm_s2,
        jerk_mm_s3=axis.jerk_mm_s3,
    )
