"""`dnc ports`: the serial ports of this computer."""

from __future__ import annotations

import dataclasses
import json

import click


@click.command(short_help="serial ports, their lasting names, and who uses them", epilog="Example: dnc ports --json")
@click.option("--json", "as_json", is_flag=True, help="one JSON object")
def command(as_json: bool) -> None:
    """List serial ports with their lasting names, their driver and who uses them.

    The kernel's names (ttyUSB0) change with the order of plugging; use the by-id name, or by-path for an adapter
    without a serial number.
    """
    from dnc.portlist import find_ports

    found = find_ports()
    if as_json:
        rows = [{**dataclasses.asdict(port), "link": port.link.value} for port in found]
        click.echo(json.dumps({"schema": "dripmill.ports", "version": 1, "ports": rows}, indent=1))
        return
    if not found:
        click.echo("dnc: no serial port found; plug the adapter in, then look again", err=True)
    for port in found:
        use = f", in use by {port.in_use_by}" if port.in_use_by else ""
        rights = "" if port.is_allowed else ", no permission (sudo usermod -aG dialout $USER)"
        click.echo(f"{port.device}  {port.driver} {port.vendor_product or ''}{rights}{use}")
        for name in (port.by_id, port.by_path):
            if name is not None:
                click.echo(f"  {name}")
