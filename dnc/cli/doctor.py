"""`dnc doctor`: what on this computer could spoil a job."""

from __future__ import annotations

import dataclasses
import json

import click

from dnc.cli._options import machine_option


@click.command(
    short_help="what on this computer could spoil a job", epilog="Example: dnc doctor --port /dev/ttyUSB0 --loopback"
)
@click.option("--port", help="also open this port, to see that it can be had")
@click.option("--loopback", is_flag=True, help="a plug joins TX and RX of --port: bytes must come back")
@machine_option
@click.option("--json", "as_json", is_flag=True, help="one JSON object")
def command(port: str | None, loopback: bool, machine: str, as_json: bool) -> int:
    """Examine rights, modem manager, power saving, adapter latency, clock, disk and priority; change nothing."""
    import msgspec

    from dnc.doctor import Finding, examine, probe_loopback
    from dnc.errors import PortUnavailable
    from dnc.places import state_folder
    from dnc.profile import load_profile, profile_path
    from dnc.sending import open_port

    if loopback and port is None:
        raise click.UsageError("--loopback needs --port")
    link = load_profile(profile_path(machine)).link
    findings = examine(state_folder())
    if port is not None:
        if loopback:  # the plug joins no modem lines, and a driver would obey the DC3 that comes back
            link = msgspec.structs.replace(link, handshake="xonxoff")
        try:
            opened = open_port(port, link)
        except PortUnavailable as problem:
            what, _, remedy = str(problem).partition("; ")
            findings.append(Finding("port", False, what, remedy))
        else:
            label = "SIMULATED: " if opened.is_simulated else ""
            findings.append(Finding("port", True, f"{label}{port} can be opened"))
            if loopback:
                findings.append(probe_loopback(opened))
            opened.close()
    if as_json:
        rows = [dataclasses.asdict(finding) for finding in findings]
        click.echo(json.dumps({"schema": "dripmill.doctor", "version": 1, "findings": rows}, indent=1))
    else:
        for finding in findings:
            click.echo(f"{'ok  ' if finding.is_good else 'MEND'} {finding.id:14} {finding.text}")
            if finding.remedy:
                click.echo(f"     {'':14} {finding.remedy}")
    return 4 if any(finding.id in ("port", "loopback") and not finding.is_good for finding in findings) else 0
