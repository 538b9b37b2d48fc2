"""What the interpreter is told of the control: from the machine profile, the job (tool radii), the program's folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from dnc.errors import SettingsRejected
from dnc.preamble import FINEST_DECIMALS
from dnc.profile import MachineProfile
from sim.interpreter.settings import G28, KnotRule, Settings, Tool


def settings_of(
    profile: MachineProfile,
    *,
    tool_radii_mm: Mapping[int, float],
    subprogram_folder: Path | None = None,
    is_drip_fed: bool = True,
    unknown_radius_mm: float | None = None,
) -> Settings:
    """The control's side of interpreting a program; radii by tool number, for G41 and G42.

    `unknown_radius_mm` is taken for tools without one, where what runs beside the contour does not matter.
    """
    control = profile.control
    return Settings(
        knot_rule=KnotRule(control.knot_rule),
        poly_degree=control.poly_degree,
        g28=G28(control.g28),
        backward_jump_alarm=control.backward_jump_alarm,
        has_tool_changer=control.has_tool_changer,
        is_inch=control.units == "inch",
        is_drip_fed=is_drip_fed,
        subprogram_folder=subprogram_folder,
        unknown_radius_mm=unknown_radius_mm,
        tools={number: Tool(radius_mm) for number, radius_mm in tool_radii_mm.items()},
    )


def refuse_other_dialect(profile: MachineProfile) -> None:
    """Raise SettingsRejected where a preamble would be words of another language; some of them move an axis there."""
    dialect = profile.control.dialect
    if dialect != "sinumerik":
        what = f"the machine's control reads {dialect}, and a preamble is written for SINUMERIK only"
        raise SettingsRejected(what, remedy="send the whole program, or name a machine that reads SINUMERIK")


def decimals_of(profile: MachineProfile) -> int:
    """The decimals that a preamble is written with on this machine."""
    most = profile.control.decimals
    return FINEST_DECIMALS if most is None else min(most, FINEST_DECIMALS)
