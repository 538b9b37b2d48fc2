"""`dnc receive`: take programs that the control punches out."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dnc.cli._options import Folder, baud_option, format_option, machine_option
from dnc.numbers import LONGEST_S, Number, Whole

if TYPE_CHECKING:
    from dnc.receiving import Haul


@click.command(
    short_help="store programs that the control punches out",
    epilog="Example: dnc receive --port /dev/ttyUSB0 -o programs/ --count 1",
)
@click.option("--port", required=True, envvar="DNC_PORT", help="device, pty, socket://host:port or rfc2217://host:port")
@click.option("-o", "--output", "folder", required=True, type=Folder(), help="folder for the programs")
@machine_option
@baud_option
@format_option
@click.option("--count", type=Whole(min=0), default=0, help="end after so many programs; 0: go on")
@click.option(
    "--wait", "wait_s", type=Number(0, LONGEST_S), default=0.0, help="end after so many silent seconds; 0: never"
)
@click.option(
    "--silence", "silence_s", type=Number(0.1, LONGEST_S), default=5.0, show_default=True, help="ends a program, s"
)
@click.option("--max-bytes", type=Whole(min=1), default=100_000_000, show_default=True, help="per program")
@click.option("--send-xon", is_flag=True, help="tell the control to begin")
@click.option("--json", "as_json", is_flag=True, help="print a report to stdout")
def command(
    port: str,
    folder: Path,
    machine: str,
    baud: int | None,
    form: str | None,
    count: int,
    wait_s: float,
    silence_s: float,
    max_bytes: int,
    send_xon: bool,
    as_json: bool,
) -> int:
    """Store what the control punches out, each program under its own name, nothing overwritten.

    A program that broke off is kept with the ending .partial. Exit 5 then, and if fewer than --count programs came;
    ended by Ctrl-C 7, by SIGTERM 143, by SIGHUP 129.
    """
    import dataclasses

    from dnc.errors import PortLost
    from dnc.punch_in import PunchIn
    from dnc.receiving import Haul, Stored, receive
    from dnc.sending import link_with, machine_profile, open_port
    from planner.files import made_folder

    link = link_with(machine_profile(machine).link, {"baud": baud, "format": form})
    opened = open_port(port, link)
    try:
        made_folder(folder)
    except BaseException:
        opened.close()
        raise
    label = "SIMULATED: " if opened.is_simulated else ""

    def say(stored: Stored) -> None:
        what = "stored" if stored.is_new else "was there already"
        click.echo(f"dnc: {label}{stored.path} {what}, {stored.size_bytes} bytes, ended by {stored.ended_by}", err=True)

    try:
        if send_xon:
            opened.write(bytes([link.xon]))
        punch_in = PunchIn(silence_s, max_bytes, is_seven_bit=link.software_parity)
        haul = receive(opened, punch_in, folder, count, wait_s, say)
    except PortLost as problem:
        haul = Haul([], None, problem)
    finally:
        opened.close()
    if as_json:
        rows = [{**dataclasses.asdict(one), "path": str(one.path)} for one in haul.stored]
        report = {"schema": "dripmill.receive", "version": 1, "simulated": opened.is_simulated, "programs": rows}
        click.echo(json.dumps(report, indent=1))
    return _ending(haul, count, label)


def _ending(haul: Haul, count: int, label: str) -> int:
    """The exit code; raises what went wrong, LineFault for a program that broke off or fewer than were wanted."""
    from dnc.errors import ExitCode, LineFault, PortLost

    if haul.fault is not None:
        raise PortLost(label + str(haul.fault)) if isinstance(haul.fault, PortLost) else haul.fault
    broken = next((one for one in haul.stored if not one.is_whole), None)
    what = f"{broken.path} is not whole, ended by {broken.ended_by}; punch it out again" if broken is not None else ""
    if haul.signal is not None:
        who = "the operator" if haul.signal == signal.SIGINT else signal.Signals(haul.signal).name
        what = what or f"{len(haul.stored)} programs came, none was under way"
        click.echo(f"dnc: {label}ended by {who}: {what}", err=True)
        return int(ExitCode.ABORTED) if haul.signal == signal.SIGINT else 128 + haul.signal
    if what:
        raise LineFault(label + what)
    if len(haul.stored) < count:
        came = f"{len(haul.stored)} of {count} programs came"
        raise LineFault(f"{label}{came}; check the punch-out setting at the control")
    return 0
