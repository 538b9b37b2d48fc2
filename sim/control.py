"""The control's state: MTConnect words, and the one table that says what each happening does to them.

A happening that the table does not know in a state is refused, as a key of a real panel is that does nothing; so is
cycle start while an alarm stands.
"""

from __future__ import annotations

from enum import Enum


class Execution(Enum):
    """MTConnect Execution; the value is its integer in the Modbus map."""

    UNAVAILABLE = 0
    READY = 1
    ACTIVE = 2
    FEED_HOLD = 3
    INTERRUPTED = 4
    OPTIONAL_STOP = 5
    PROGRAM_STOPPED = 6
    WAIT = 7
    PROGRAM_COMPLETED = 8
    STOPPED = 9


class Mode(Enum):
    """MTConnect ControllerMode; the value is its integer in the Modbus map."""

    AUTOMATIC = 0
    MANUAL_DATA_INPUT = 1
    MANUAL = 2
    SEMI_AUTOMATIC = 3
    EDIT = 4


class Happening(Enum):
    """What can happen to a control: keys, and what the program or the machine brings about."""

    CYCLE_START = "cycle start"
    FEED_HOLD = "feed hold"
    RESET = "reset"
    POWER_OFF = "power off"
    POWER_ON = "power on"
    PROGRAM_STOP = "program stop M0"
    OPTIONAL_STOP = "optional stop M1"
    BLOCK_END = "end of a block in single block"
    PROGRAM_END = "program end"
    ALARM = "alarm"
    TOOL_CHANGE = "tool change begins"
    TOOL_CHANGED = "tool change has ended"


_E, _H = Execution, Happening

TABLE: dict[tuple[Execution, Happening], Execution] = {
    (_E.READY, _H.CYCLE_START): _E.ACTIVE,
    (_E.FEED_HOLD, _H.CYCLE_START): _E.ACTIVE,
    (_E.INTERRUPTED, _H.CYCLE_START): _E.ACTIVE,
    (_E.OPTIONAL_STOP, _H.CYCLE_START): _E.ACTIVE,
    (_E.PROGRAM_STOPPED, _H.CYCLE_START): _E.ACTIVE,
    (_E.PROGRAM_COMPLETED, _H.CYCLE_START): _E.ACTIVE,
    (_E.STOPPED, _H.CYCLE_START): _E.ACTIVE,
    (_E.ACTIVE, _H.FEED_HOLD): _E.FEED_HOLD,
    (_E.ACTIVE, _H.PROGRAM_STOP): _E.PROGRAM_STOPPED,
    (_E.ACTIVE, _H.OPTIONAL_STOP): _E.OPTIONAL_STOP,
    (_E.ACTIVE, _H.BLOCK_END): _E.INTERRUPTED,
    (_E.ACTIVE, _H.PROGRAM_END): _E.PROGRAM_COMPLETED,
    (_E.ACTIVE, _H.TOOL_CHANGE): _E.WAIT,
    (_E.WAIT, _H.TOOL_CHANGED): _E.ACTIVE,
    (_E.UNAVAILABLE, _H.POWER_ON): _E.READY,
    **{(state, _H.ALARM): _E.STOPPED for state in _E if state is not _E.UNAVAILABLE},
    **{(state, _H.RESET): _E.STOPPED for state in _E if state not in (_E.UNAVAILABLE, _E.READY)},
    **{(state, _H.POWER_OFF): _E.UNAVAILABLE for state in _E if state is not _E.UNAVAILABLE},
}

IN_CYCLE = frozenset({_E.ACTIVE, _E.FEED_HOLD, _E.INTERRUPTED, _E.WAIT})


class Control:
    """The state, the mode and the alarm of one control."""

    def __init__(self) -> None:
        self.execution = Execution.READY
        self.is_single_block = False
        self.alarm_number = 0
        self.history: list[tuple[float, Happening, Execution]] = []

    @property
    def mode(self) -> Mode:
        """SEMI_AUTOMATIC in single block, else AUTOMATIC."""
        return Mode.SEMI_AUTOMATIC if self.is_single_block else Mode.AUTOMATIC

    def happens(self, happening: Happening, now_s: float) -> bool:
        """Fire one happening; False if this state refuses it."""
        after = TABLE.get((self.execution, happening))
        if after is None or (happening is Happening.CYCLE_START and self.alarm_number != 0):
            return False
        if happening is not Happening.ALARM or after is not self.execution:
            self.history.append((now_s, happening, after))  # a machine that stands in alarm says so in every cycle
        self.execution = after
        if happening in (Happening.RESET, Happening.POWER_OFF):
            self.alarm_number = 0
        return True

    def raise_alarm(self, number: int) -> bool:
        """Show an alarm; the first one stands until reset. The state follows when the axes have come to rest."""
        if self.alarm_number != 0 or self.execution is Execution.UNAVAILABLE:
            return False
        self.alarm_number = number
        return True
