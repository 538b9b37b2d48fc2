"""The errors the planner shows to a user; each is one sentence and carries its exit code."""

from __future__ import annotations

from enum import IntEnum
from pathlib import Path


class ExitCode(IntEnum):
    """Exit codes of every command (docs/interface, section 6)."""

    OK = 0
    INTERNAL = 1
    USAGE = 2
    REJECTED = 3
    PORT = 4
    LINE = 5
    CONTROL = 6
    ABORTED = 7
    SETTINGS = 8
    JOURNAL = 9
    MODBUS = 10


class UserError(Exception):
    """One sentence for the user: what is wrong, where, and what to do; shown without a traceback."""

    exit_code: ExitCode = ExitCode.INTERNAL


class InputRejected(UserError):
    """A job, surface or program that cannot be used; the place is file, line and column where known.

    `key` names the key of the job file that is to blame, where only who knows the file can tell its line.

    >>> str(InputRejected("scallop_mm is 0", path=Path("job.toml"), line=7, remedy="give a height above 0"))
    'job.toml:7: scallop_mm is 0; give a height above 0'
    """

    exit_code = ExitCode.REJECTED

    def __init__(
        self,
        what: str,
        *,
        path: Path | None = None,
        line: int | None = None,
        column: int | None = None,
        remedy: str = "",
        key: tuple[str | int, ...] = (),
    ) -> None:
        self.what, self.path, self.line, self.column, self.remedy = what, path, line, column, remedy
        self.key = key
        place = ":".join(str(part) for part in (path, line, column) if part is not None)
        sentence = f"{place}: {what}" if place else what
        super().__init__(f"{sentence}; {remedy}" if remedy else sentence)


class SettingsRejected(InputRejected):
    """A machine profile or settings file that cannot be used."""

    exit_code = ExitCode.SETTINGS
