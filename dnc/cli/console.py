"""`dnc console`: the operator's screen in a terminal."""

from __future__ import annotations

import os
import sys

import click

from dnc.cli._options import machine_option


@click.command(
    short_help="watch the running job and its machine; hold, resume, abort",
    epilog="Example: dnc console --machine sinumerik-840d",
)
@machine_option
@click.option("--modbus", metavar="HOST:PORT", envvar="DNC_MODBUS", help="in place of the profile's")
@click.option("--low-power", is_flag=True, help="redraw once a second in place of twice")
def command(machine: str, modbus: str | None, *, low_power: bool) -> int:
    """Watch the running job and its machine, hold it, let it go on, abort it.

    It attaches to any `dnc send` on this computer and to the machine's Modbus. Leaving or killing it leaves the job
    alone. No key of it is an emergency stop.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise click.UsageError("the console needs a terminal; dnc status --watch reads the same too")

    from dnc.console.app import Console, Machine
    from dnc.places import runtime_folder
    from dnc.profile import load_profile, profile_path
    from dnc.status.job import JobWatcher
    from dnc.status.monitor import modbus_of

    for name in ("COLUMNS", "LINES"):  # where they are exported, they would hide every change of the terminal's size
        os.environ.pop(name, None)
    path = profile_path(machine)
    modbus_settings = modbus_of(load_profile(path).modbus, modbus)
    console = Console(Machine(machine, path), modbus_settings, JobWatcher(runtime_folder()), 1.0 if low_power else 0.5)
    console.run()
    return console.return_code or 0
