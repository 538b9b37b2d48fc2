"""`dnc machines`: the machine profiles that can be named."""

from __future__ import annotations

import json
from typing import Any

import click


@click.command(short_help="the machine profiles that can be named", epilog="Example: dnc machines --json")
@click.option("--json", "as_json", is_flag=True, help="one JSON object")
def command(as_json: bool) -> int:
    """List the machine profiles: the shipped ones and those in the user's folder.

    Exit 8 if one of them cannot be read; the others are listed all the same.
    """
    from dnc.errors import ExitCode, SettingsRejected
    from dnc.profile import profile_names

    rows: list[dict[str, Any]] = []
    broken: list[str] = []
    for name in profile_names():
        try:
            rows.append(_row(name))
        except SettingsRejected as problem:
            broken.append(str(problem))
    if as_json:
        click.echo(json.dumps({"schema": "dripmill.machines", "version": 1, "machines": rows}, indent=1))
    for row in () if as_json else rows:
        line = f"{row['baud']} {row['format']} {row['handshake']}, start {row['start']}"
        click.echo(f"{row['name']:24} {row['dialect']:11} {line}, buffer {row['receive_buffer_bytes']} bytes")
    for sentence in broken:
        click.echo(f"dnc: {sentence}", err=True)
    return int(ExitCode.SETTINGS if broken else ExitCode.OK)


def _row(name: str) -> dict[str, Any]:
    """One profile for the list; raises SettingsRejected where it cannot be read."""
    from dnc.profile import load_profile, profile_path

    path = profile_path(name)
    link, control = (profile := load_profile(path)).link, profile.control
    return {
        "name": name,
        "path": str(path),
        "dialect": control.dialect,
        "baud": link.baud,
        "format": link.format,
        "handshake": link.handshake,
        "start": link.start,
        "receive_buffer_bytes": control.receive_buffer_bytes,
    }
