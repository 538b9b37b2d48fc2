"""What a plan takes from the machine profile: limits of control, line and axes, and its clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from dnc.pacing import bits_per_byte
from dnc.profile import MachineProfile
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
    """How long this machine takes for a program, s: the interpreter's commands, timed by its own motion."""
    from sim.interpreter.run import interpret
    from sim.mill import settings_of
    from sim.motion.estimate import estimate_time_s
    from sim.profile import load_mill_profile

    profile = load_mill_profile(profile_path)
    settings = settings_of(profile, is_drip_fed=False, tool_radii_mm=tool_radii_mm, subprogram_folder=subprogram_folder)
    return lambda program: estimate_time_s(interpret(program, settings), profile)


def line_of(profile: MachineProfile) -> tuple[int, float]:
    """Baud and bits a character of the profile's line."""
    return profile.link.baud, bits_per_byte(profile.link.format)


def travel_of(profile: MachineProfile) -> tuple[float, float, float]:
    """How far the axes X, Y and Z go, mm."""
    x, y, z = (axis.max_mm - axis.min_mm for axis in (profile.axes["X"], profile.axes["Y"], profile.axes["Z"]))
    return x, y, z
