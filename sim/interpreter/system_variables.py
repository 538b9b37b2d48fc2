"""System variables a program may read: positions, feed, spindle and tool of the moment."""

from __future__ import annotations

from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.mapping import mapping_of
from sim.interpreter.request import AXES, MACHINE_AXES
from sim.interpreter.settings import Settings
from sim.interpreter.state import State
from sim.interpreter.values import Value

SYSTEM_VARIABLES = ("$P_EP", "$AA_IW", "$AA_IM", "$P_F", "$P_S", "$P_TOOLNO", "$P_TOOL", "$P_TOOLR")


class SystemVariables:
    """Reads names that begin with $ from the state."""

    def __init__(self, state: State, settings: Settings) -> None:
        self._state, self._settings = state, settings

    def read(self, name: str, indices: tuple[Value, ...]) -> Value:
        """The value; ControlAlarm for a name that is not modelled or an index that is no axis."""
        state = self._state
        if name in ("$P_EP", "$AA_IW", "$AA_IM"):
            mapping = mapping_of(state, self._settings, is_suppressed=name == "$AA_IM")
            return mapping.inverse_point(state.position_mm)[self._axis(name, indices)]
        tool = None if state.tool_name else self._settings.tools.get(state.tool)
        plain = {
            "$P_F": state.feed or 0.0,
            "$P_S": state.spindle_rpm,
            "$P_TOOLNO": float(state.tool),
            "$P_TOOL": float(state.edge),
            "$P_TOOLR": tool.radius_mm if tool is not None and state.edge else 0.0,
        }
        if name not in plain:
            known = ", ".join(SYSTEM_VARIABLES)
            raise ControlAlarm(AlarmNumber.NAME_UNKNOWN, f"the system variable {name} is not modelled; {known} are")
        return plain[name]

    def _axis(self, name: str, indices: tuple[Value, ...]) -> int:
        axis = indices[0] if len(indices) == 1 else None
        if isinstance(axis, str) and axis in (MACHINE_AXES if name == "$AA_IM" else AXES):
            return (MACHINE_AXES if name == "$AA_IM" else AXES)[axis]
        if isinstance(axis, str) and axis in AXES:
            return AXES[axis]
        raise ControlAlarm(AlarmNumber.INDEX, f"{name} takes an axis in square brackets; [X] is expected")
