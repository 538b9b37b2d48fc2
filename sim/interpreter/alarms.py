"""The control's alarms: numbers as a SINUMERIK shows them where known, and the exception that carries one inside."""

from __future__ import annotations

from enum import IntEnum


class AlarmNumber(IntEnum):
    """Numbers of the 840D's list of alarms, for what this interpreter refuses."""

    AXIS_TWICE = 12100
    SYNTAX = 12080
    SAME_GROUP = 12060
    BLOCK_NOT_INTERPRETABLE = 12110
    OWN_BLOCK = 12120
    UNKNOWN_G = 12470
    NAME_UNKNOWN = 12550
    VALUE_OUT_OF_RANGE = 12560
    TYPE = 12150
    NESTING = 12640
    DEFINED_TWICE = 12170
    INDEX = 17020
    ARITHMETIC = 14051
    CALL_DEPTH = 14010
    NO_PROGRAM = 14011
    CIRCLE = 14040
    JUMP_TARGET = 14080
    LOOP_LIMIT = 14092
    POLYNOMIAL = 14102
    SPLINE = 14290
    FRAME = 14414
    NO_FEED = 10860
    SOFTWARE_LIMIT = 10720
    WORKING_AREA = 10730
    COMPENSATION = 10750
    CONTOUR = 10751
    NO_SPINDLE = 10810
    PARAMETERS = 14020
    M_UNKNOWN = 14750


class ControlAlarm(Exception):
    """A block is refused; becomes a canonical Alarm, never leaves the interpreter.

    `line` and `block` are set where an earlier block than the one being read is at fault.
    """

    def __init__(
        self, number: int, text: str, column: int | None = None, *, line: int | None = None, block: int | None = None
    ) -> None:
        self.number, self.text, self.column = int(number), text, column
        self.line, self.block = line, block
        super().__init__(text)
