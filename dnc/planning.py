"""What a plan takes from the machine profile, and the files a plan leaves."""

from __future__ import annotations

import os
from pathlib import Path

from dnc.profile import MachineProfile
from planner.errors import InputRejected
from planner.post.base import ControlLimits

_DECIMALS = {"fanuc": 3, "heidenhain": 4}


def limits_of(profile: MachineProfile) -> ControlLimits:
    """The limits the post must keep, from the profile's `[control]`."""
    control = profile.control
    return ControlLimits(
        resolution_mm=control.resolution_mm,
        decimals=_DECIMALS.get(control.dialect),
        min_spline_blocks=control.min_spline_blocks,
        knot_rule=control.knot_rule,
        knot_rule_verified=bool(control.knot_rule_verified),
    )


def line_of(profile: MachineProfile) -> tuple[int, float]:
    """Baud and bits a character of the profile's line."""
    data, parity, stop = profile.link.format[0], profile.link.format[1], profile.link.format[2:]
    return profile.link.baud, 1 + int(data) + (parity != "N") + float(stop)


def write_file(path: Path, data: bytes) -> None:
    """Write a whole file or nothing: a temporary name beside it, then a rename."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(data)
        part.replace(path)
    except OSError as problem:
        part.unlink(missing_ok=True)
        raise InputRejected(
            f"cannot be written: {problem.strerror}", path=path, remedy="check folder and rights"
        ) from None
