"""The errors of streaming, each one sentence with its exit code; standard library only."""

from __future__ import annotations

from planner.errors import ExitCode, InputRejected, SettingsRejected, UserError

__all__ = [
    "ControlStopped",
    "ExitCode",
    "InputRejected",
    "JournalMismatch",
    "LineFault",
    "ModbusUnavailable",
    "OperatorAbort",
    "PortLost",
    "PortUnavailable",
    "SettingsRejected",
    "UserError",
]


class PortUnavailable(UserError):
    """The port is absent, locked or cannot be opened."""

    exit_code = ExitCode.PORT


class LineFault(UserError):
    """Anything on the line after opening, time-outs included."""

    exit_code = ExitCode.LINE


class PortLost(LineFault):
    """The port vanished or refuses to work: hang-up, EIO, a terminal error."""


class ControlStopped(UserError):
    """The control alarmed or was reset."""

    exit_code = ExitCode.CONTROL


class OperatorAbort(UserError):
    """The operator aborted the job."""

    exit_code = ExitCode.ABORTED


class JournalMismatch(UserError):
    """The journal does not belong to this program, or the resume does not match."""

    exit_code = ExitCode.JOURNAL


class ModbusUnavailable(UserError):
    """Machine status is required and cannot be had."""

    exit_code = ExitCode.MODBUS
