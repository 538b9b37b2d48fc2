"""`dnc machines`: the machine profiles that can be named."""

from __future__ import annotations

import json

import click


@click.command(epilog="Example: dnc machines --json")
@click.option("--json", "as_json", is_flag=True, help="one JSON object")
def command(as_json: bool) -> None:
    """List the machine profiles: the shipped ones and those in the user's folder."""
    from dnc.places import config_folder
    from dnc.profile import load_profile, profile_path
    from dnc.shipped import shipped_names

    folder = config_folder() / "machines"
    own = sorted(found.stem for found in folder.glob("*.toml")) if folder.is_dir() else []
    rows = []
    for name in sorted({*shipped_names("machines"), *own}):
        path = profile_path(name, folder)
        link, control = (profile := load_profile(path)).link, profile.control
        rows.append(
            {
                "name": name,
                "path": str(path),
                "dialect": control.dialect,
                "baud": link.baud,
                "format": link.format,
                "handshake": link.handshake,
                "start": link.start,
                "receive_buffer_bytes": control.receive_buffer_bytes,
            }
        )
    if as_json:
        click.echo(json.dumps({"schema": "dripmill.machines", "version": 1, "machines": rows}, indent=1))
        return
    for row in rows:
        line = f"{row['baud']} {row['format']} {row['handshake']}, start {row['start']}"
        click.echo(f"{row['name']:24} {row['dialect']:11} {line}, buffer {row['receive_buffer_bytes']} bytes")
