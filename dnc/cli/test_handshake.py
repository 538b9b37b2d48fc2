"""`dnc test-handshake`: see that this control really stops us over this cable."""

from __future__ import annotations

import json
import sys

import click

from dnc.cli._options import baud_option, format_option, machine_option
from dnc.numbers import LONGEST_S, Number


@click.command(
    short_help="see that the control really stops us over this cable",
    epilog="Example: dnc test-handshake --port /dev/ttyUSB0",
)
@click.option("--port", required=True, envvar="DNC_PORT", help="device or pty")
@machine_option
@baud_option
@format_option
@click.option(
    "--resume-wait", "resume_wait_s", type=Number(0, LONGEST_S), default=120.0, show_default=True, help="s to raise it"
)
@click.option("--yes", is_flag=True, help="the override is at 0 and the axes may move by 0.01 mm")
@click.option("--control-was-reset", is_flag=True, help="the control was reset after the last job was cut off")
@click.option("--json", "as_json", is_flag=True, help="print a report to stdout")
def command(
    port: str,
    machine: str,
    baud: int | None,
    form: str | None,
    resume_wait_s: float,
    yes: bool,
    control_was_reset: bool,
    as_json: bool,
) -> int:
    """Set the feed override to 0, start external execution at the control: sending must stop, then go on when raised.

    Sends moves of 0.01 mm to and fro in X from where the machine stands. Exit 0 if the control stopped us and let us
    go on, 5 otherwise. No key here is an emergency stop.
    """
    import msgspec

    from dnc.aftermath import refuse_dirty_control
    from dnc.examiner import examine
    from dnc.sending import link_with, machine_profile, open_port

    if not yes:
        question = "Feed override at 0, nothing in the way, axes may move 0.01 mm in X when it is raised?"
        if not sys.stdin.isatty() or not click.confirm(question, err=True):
            raise click.UsageError("set the feed override to 0, then confirm, or give --yes")
    profile = machine_profile(machine)
    profile = msgspec.structs.replace(profile, link=link_with(profile.link, {"baud": baud, "format": form}))
    opened = open_port(port, profile.link)
    try:
        # Blocks of a job that was cut off would be executed when the override is raised: --yes does not speak of them.
        refuse_dirty_control(opened.identity, is_yes=False, was_reset=control_was_reset)
    except BaseException:
        opened.close()
        raise
    label = "SIMULATED: " if opened.is_simulated else ""
    report = examine(opened, profile, machine, resume_wait_s, lambda text: click.echo(f"dnc: {label}{text}", err=True))
    held = "; reset the control, it still holds moves of this test" if report["bytes_sent"] else ""
    click.echo(f"dnc: {label}{report['verdict']}{held}", err=True)
    if as_json:
        click.echo(json.dumps(report, indent=1))
    return 0 if report["passed"] else 5
