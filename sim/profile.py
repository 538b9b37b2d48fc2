"""The machine profile as the simulated mill reads it; `dnc.profile` reads the same file on its own, on purpose."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from planner.errors import SettingsRejected
from planner.tomlfile import read_text


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
    dialect: str
    knot_rule: str
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


def load_mill_profile(path: Path) -> MillProfile:
    """The mill's half of a machine profile; raises SettingsRejected naming the key that is missing or unusable."""
    text = read_text(path, error=SettingsRejected)
    data = _parsed(path, text)
    link, control = data.get("link", {}), data.get("control", {})
    try:
        x, y, z = (_axis(data["axes"][name]) for name in "XYZ")
        return MillProfile(
            baud=int(link["baud"]),
            format=str(link["format"]),
            xon=int(link.get("xon", 0x11)),
            xoff=int(link.get("xoff", 0x13)),
            dialect=str(control["dialect"]),
            knot_rule=str(control.get("knot_rule", "nx")),
            resolution_mm=float(control["resolution_mm"]),
            tool_length_reference=str(control.get("tool_length_reference", "tip")),
            receive_buffer_bytes=int(control["receive_buffer_bytes"]),
            xoff_free_bytes=int(control["xoff_free_bytes"]),
            xon_fill_bytes=int(control["xon_fill_bytes"]),
            block_cycle_s=float(control["block_cycle_s"]),
            lookahead_blocks=int(control["lookahead_blocks"]),
            axes=(x, y, z),
        )
    except KeyError as problem:
        raise SettingsRejected(f"{problem.args[0]} is missing", path=path, remedy="add it") from None
    except (TypeError, ValueError) as problem:
        raise SettingsRejected(f"a value has the wrong type: {problem}", path=path, remedy="mend it") from None


def _parsed(path: Path, text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise SettingsRejected(f"not valid TOML: {problem}", path=path, remedy="mend this line") from None


def _axis(table: dict[str, Any]) -> AxisLimits:
    return AxisLimits(
        min_mm=float(table["min_mm"]),
        max_mm=float(table["max_mm"]),
        rapid_mm_s=float(table["rapid_mm_min"]) / 60.0,
        acceleration_mm_s2=float(table["acceleration_mm_s2"]),
        jerk_mm_s3=float(table["jerk_mm_s3"]),
    )
