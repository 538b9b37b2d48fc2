"""The auxiliary functions of the machine: tool, spindle, coolant, stops, and what its screen says."""

from __future__ import annotations

from dataclasses import dataclass

from sim.interpreter import canon
from sim.interpreter.canon import Command
from sim.motion.values import MachineState, MachineTimes, StopReason


@dataclass(frozen=True, slots=True)
class Halt:
    """The axes stand for this reason: for `time_s`, or in `state` until somebody makes the machine go on."""

    reason: StopReason
    time_s: float = 0.0
    state: MachineState | None = None


class Auxiliary:
    """What is in the spindle, what turns and what flows; `stops_at_optional`: M1 counts."""

    def __init__(self, times: MachineTimes, *, stops_at_optional: bool) -> None:
        self._times = times
        self._stops_at_optional = stops_at_optional
        self.tool = 0
        self.message = ""
        self.reset()

    def reset(self) -> None:
        """Spindle and coolant off, no alarm; the tool and the last message stay."""
        self._switch_off()
        self.alarm = ""

    def _switch_off(self) -> None:
        self.spindle_rpm = 0.0
        self.is_flood = self.is_mist = False

    def carry_out(self, command: Command) -> Halt | None:
        """Do what is no motion; says how the axes stand meanwhile, if they do."""
        match command:
            case canon.Dwell(time_s=time_s):
                return Halt(StopReason.DWELL, time_s)
            case canon.ChangeTool(number=number):
                self.tool = number
                return Halt(StopReason.TOOL_CHANGE, self._times.tool_change_s)
            case canon.Spindle(speed_rpm=speed_rpm) if speed_rpm != self.spindle_rpm:
                self.spindle_rpm = speed_rpm
                return Halt(StopReason.SPINDLE, self._times.spindle_start_s)
            case canon.Coolant(is_flood=is_flood, is_mist=is_mist):
                self.is_flood, self.is_mist = is_flood, is_mist
            case canon.Message(text=text):
                self.message = text
            case canon.Stop(is_optional=False):
                return Halt(StopReason.PROGRAM_STOP, state=MachineState.PROGRAM_STOPPED)
            case canon.Stop() if self._stops_at_optional:
                return Halt(StopReason.OPTIONAL_STOP, state=MachineState.OPTIONAL_STOP)
            case canon.End():
                self._switch_off()
                return Halt(StopReason.END, state=MachineState.COMPLETED)
            case canon.Alarm(number=number, text=text):
                self.alarm = f"{number} {text}"
                return Halt(StopReason.ALARM, state=MachineState.ALARM)
        return None
