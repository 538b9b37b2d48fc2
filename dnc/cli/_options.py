"""Options that several commands share: which machine, and how its line is to be spoken to."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from dnc.numbers import Whole

_FORMAT = re.compile(r"[5-8][NEOMS](1|1\.5|2)")


class Format(click.ParamType[str]):
    """The format of the line, such as 8N1."""

    name = "text"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The text, where it is one; click's BadParameter for any other."""
        if not _FORMAT.fullmatch(str(value)):
            self.fail(f"{value} is no format of a line, such as 8N1 or 7E2", param, ctx)
        return str(value)


class File(click.Path):
    """The name of a file; an empty one would be the working folder. Who reads the file says whether it can be read."""

    kind = "file"

    def __init__(self) -> None:
        super().__init__(path_type=Path, readable=False)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path; click's BadParameter for no name at all."""
        if value == "":
            self.fail(f"the name of the {self.kind} is empty", param, ctx)
        return super().convert(value, param, ctx)


class Folder(File):
    """The name of a folder, as for a file."""

    kind = "folder"


def _tell_overlooked(ctx: click.Context, param: click.Parameter, name: str) -> str:
    """A profile of the user's that nobody reads must not look as if it were in force."""
    del ctx, param
    from dnc.profile import overlooked_profile

    own = overlooked_profile(name)
    if own is not None:
        what = f"{own} is not used: the shipped profile {name} goes first; name yours by its path, or rename it"
        click.echo(f"dnc: warning: {what}", err=True)
    return name


machine_option = click.option(
    "--machine",
    envvar="DNC_MACHINE",
    default="sinumerik-840d",
    show_default=True,
    callback=_tell_overlooked,
    help="machine profile: a name that dnc machines lists, or a path",
)
baud_option = click.option("--baud", type=Whole(50, 4_000_000), envvar="DNC_BAUD", help="in place of the profile's")
format_option = click.option("--format", "form", type=Format(), envvar="DNC_FORMAT", help="such as 8N1 or 7E2")
