"""What a plan takes from the machine profile, and how commands read a program and leave files."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from dnc.profile import MachineProfile
from planner.errors import InputRejected
from planner.post.written import ControlLimits

_DECIMALS = {"fanuc": 3, "heidenhain": 4}


def limits_of(profile: MachineProfile) -> ControlLimits:
    """The limits the post must keep, from the profile's `[control]`."""
    control = profile.control
    return ControlLimits(
        resolution_mm=control.resolution_mm,
        decimals=_DECIMALS.get(control.dialect) if control.decimals is None else control.decimals,
        min_spline_blocks=control.min_spline_blocks,
        knot_rule=control.knot_rule,
        knot_rule_verified=bool(control.knot_rule_verified),
        poly_degree=control.poly_degree,
        retract_z_mm=control.retract_z_mm,
        has_tool_changer=control.has_tool_changer,
        is_inch=control.units == "inch",
    )


def machining_clock(
    profile_path: Path, subprogram_folder: Path | None = None, tool_radii_mm: Mapping[int, float] | None = None
) -> Callable[[bytes], float]:
    """How long this machine takes for a program, s: the interpreter's commands, timed in closed form."""
    from sim.interpreter.run import interpret
    from sim.mill import settings_of
    from sim.motion.estimate import estimate_time_s
    from sim.profile import load_mill_profile

    profile = load_mill_profile(profile_path)
    settings = settings_of(profile, is_drip_fed=False, tool_radii_mm=tool_radii_mm, subprogram_folder=subprogram_folder)
    return lambda program: estimate_time_s(interpret(program, settings), profile)


def line_of(profile: MachineProfile) -> tuple[int, float]:
    """Baud and bits a character of the profile's line."""
    data, parity, stop = profile.link.format[0], profile.link.format[1], profile.link.format[2:]
    return profile.link.baud, 1 + int(data) + (parity != "N") + float(stop)


def travel_of(profile: MachineProfile) -> tuple[float, float, float]:
    """How far the axes X, Y and Z go, mm."""
    x, y, z = (axis.max_mm - axis.min_mm for axis in (profile.axes["X"], profile.axes["Y"], profile.axes["Z"]))
    return x, y, z


def check_outputs(outputs: Sequence[Path], inputs: Sequence[Path]) -> None:
    """Raises InputRejected where a file to be written is also read, is written twice, or lies in no folder."""
    read, written = {path.resolve() for path in inputs}, set[Path]()
    for path in outputs:
        if path.resolve() in read:
            raise InputRejected("is read by this command and would be lost", path=path, remedy="name another file")
        if not path.parent.is_dir():
            raise InputRejected(
                "its folder does not exist", path=path, remedy="create the folder, or name another file"
            )
        if path.resolve() in written:
            raise InputRejected("would be written twice", path=path, remedy="give every output a name of its own")
        written.add(path.resolve())


def made_folder(path: Path) -> Path:
    """The folder to write into, made if only its last part is missing; raises InputRejected where that fails."""
    try:
        path.mkdir(exist_ok=True)
    except OSError as problem:
        what = "is no folder" if path.exists() else f"cannot be made: {problem.strerror}"
        raise InputRejected(what, path=path, remedy="name a folder, or make it first") from None
    return path


def read_program(path: Path) -> bytes:
    """The bytes of a program, every one of them; raises InputRejected where there is none."""
    if not path.is_file():
        what = "is a directory" if path.is_dir() else "is not a regular file" if path.exists() else "is not there"
        raise InputRejected(what, path=path, remedy="name a program file")
    try:
        data = path.read_bytes()
    except OSError as problem:
        raise InputRejected(f"cannot be read: {problem.strerror}", path=path, remedy="check the rights") from None
    if not data.strip():
        raise InputRejected("is empty", path=path, remedy="name a program file")
    return data


def write_file(path: Path, data: bytes) -> None:
    """Write a whole file or nothing: a temporary name beside it, then a rename; never in place of a device."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise InputRejected("is not a regular file", path=path, remedy="name a file to write")
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(data)
        part.replace(path)
    except OSError as problem:
        part.unlink(missing_ok=True)
        raise InputRejected(
            f"cannot be written: {problem.strerror}", path=path, remedy="check folder and rights"
        ) from None
