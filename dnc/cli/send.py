"""`dnc send`: drip-feed a program to a control, or rehearse it on the virtual mill."""

from __future__ import annotations

from typing import Any

import click

from dnc.cli._options import File, baud_option, format_option, machine_option
from dnc.numbers import LONGEST_S, Number

_HANDSHAKES = ["xonxoff", "driver", "rtscts", "dtrdsr", "none"]


@click.command(
    short_help="drip-feed a program to a control, or rehearse it",
    epilog="Example: dnc send part.mpf --port /dev/ttyUSB0 --machine sinumerik-840d --report sent.json",
)
@click.argument("program", type=File())
@click.option("--port", envvar="DNC_PORT", help="device, pty, socket://host:port or rfc2217://host:port")
@machine_option
@baud_option
@format_option
@click.option("--handshake", type=click.Choice(_HANDSHAKES), envvar="DNC_HANDSHAKE", help="in place of the profile's")
@click.option(
    "--start",
    type=click.Choice(["immediate", "wait-xon"]),
    envvar="DNC_START",
    help="send at once, or wait for the first XON",
)
@click.option(
    "--start-timeout",
    "start_timeout_s",
    type=Number(0, LONGEST_S),
    envvar="DNC_START_TIMEOUT",
    help="seconds to wait for the first XON; 0: for ever",
)
@click.option(
    "--hold-timeout",
    "hold_timeout_s",
    type=Number(0, LONGEST_S),
    envvar="DNC_HOLD_TIMEOUT",
    help="seconds an XOFF may last; 0: for ever",
)
@click.option("--start-at", metavar="N120", help="restart at this block, with a computed preamble")
@click.option("--resume", is_flag=True, help="restart where the interrupted job of this program stopped")
@click.option("--check", "check_first", is_flag=True, help="run dnc check first; errors stop the job")
@click.option("--job", type=File(), help="job file: tool radii; for --check also stock and clearance")
@click.option("--report", type=File(), help="write the report as JSON")
@click.option("--yes", is_flag=True, help="answer the questions of --start-at, --resume and of a job that was stopped")
@click.option(
    "--force",
    is_flag=True,
    help="send though no handshake keeps the control's buffer from running over; restart at any block, by any adapter",
)
@click.option("--control-was-reset", is_flag=True, help="the control was reset after the last job was cut off")
@click.option("--dry-run", is_flag=True, help="send to a virtual mill started for this job (SIMULATED)")
@click.option("--speed", type=Number(0.001, 100_000), help="time scale of --dry-run; 1 unless given")
@click.option("--hook", metavar="COMMAND", help="run at each alarm and change of state but XOFF and XON, JSON on stdin")
@click.option("--webhook", metavar="URL", help="post the same events there")
@click.option("--json", "as_json", is_flag=True, help="print the report to stdout")
def command(**options: Any) -> int:
    """Drip-feed PROGRAM over the line.

    The tape is examined for bytes that would act on the line; `--check` runs the whole check. SENT means that the last
    byte left this computer, not that the part is done. SIGINT aborts; no key here is an emergency stop.
    """
    from dnc.sending import Wishes, send

    source = click.get_current_context().get_parameter_source("port")
    if options["dry_run"] and source is not click.core.ParameterSource.COMMANDLINE:
        options["port"] = None  # a port that is written down for every day is no contradiction
    return send(Wishes(**options))
