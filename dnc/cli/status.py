"""`dnc status`: one reading of machine and job, or a line for each as long as one watches."""

from __future__ import annotations

import asyncio
import contextlib
import json
from typing import Any

import click

from dnc.cli._options import machine_option
from dnc.errors import ExitCode, ModbusUnavailable
from dnc.numbers import Whole


@click.command(
    short_help="read the machine and the running job", epilog="Example: dnc status --machine sinumerik-840d --json"
)
@machine_option
@click.option("--modbus", metavar="HOST:PORT", envvar="DNC_MODBUS", help="in place of the profile's")
@click.option("--json", "as_json", is_flag=True, help="print JSON, one object a line")
@click.option("--watch", is_flag=True, help="go on reading, once a second, until interrupted")
@click.option("--count", type=Whole(min=1), help="stop watching after so many readings")
def command(machine: str, modbus: str | None, *, as_json: bool, watch: bool, count: int | None) -> int:
    """Read the machine over Modbus and the running job over its socket; nothing is written to either.

    Every value carries its age, source and quality. Exit code 10 when the machine cannot be read.
    """
    from dnc.profile import load_profile, profile_path
    from dnc.status.monitor import modbus_of

    if count is not None and not watch:
        raise click.UsageError("--count goes with --watch")

    profile = load_profile(profile_path(machine))
    settings = modbus_of(profile.modbus, modbus)
    readings = count if watch else 1
    with contextlib.suppress(KeyboardInterrupt):
        return asyncio.run(_read(settings, readings, as_json=as_json))
    return 130


async def _read(settings: Any, readings: int | None, *, as_json: bool) -> int:
    from dnc.places import runtime_folder
    from dnc.status.job import JobWatcher
    from dnc.status.monitor import StatusMonitor
    from dnc.status.text import status_lines, status_report

    monitor, watcher = StatusMonitor(settings), JobWatcher(runtime_folder())
    tasks = [asyncio.create_task(monitor.run()), asyncio.create_task(watcher.run())]
    try:
        await asyncio.gather(monitor.wait_for_poll(2.0), watcher.wait_for_snapshot(0.6))
        while True:
            report = status_report(monitor.report(), watcher.reading())
            click.echo(json.dumps(report) if as_json else "\n".join(status_lines(report)))
            if readings is not None:
                readings -= 1
                if readings == 0:
                    break
            await asyncio.sleep(1.0)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    status = monitor.status()
    if not status.is_available:
        raise ModbusUnavailable(f"the machine cannot be read: {status.problem}; start it, or name it with --modbus")
    return int(ExitCode.OK)
