"""`dnc mill`: the virtual mill as a process behind a pseudo-terminal."""

from __future__ import annotations

from pathlib import Path

import click

from dnc.cli._options import File, Folder, Format, machine_option
from dnc.numbers import Number, Whole


@click.command(
    short_help="be the virtual mill behind a pseudo-terminal (SIMULATED)",
    epilog="Example: dnc mill --speed 100 --link /tmp/mill --nominal thesis.toml --report mill.json",
)
@machine_option
@click.option("--link", type=File(), help="symbolic link to its pseudo-terminal")
@click.option("--modbus", metavar="HOST:PORT", help="serve status there; port 0: any free one")
@click.option("--speed", type=Number(0.001, 100_000), default=1.0, help="of machine and line together")
@click.option("--baud", type=Whole(50, 4_000_000), help="of the line at speed 1, in place of the profile's")
@click.option("--format", "form", type=Format(), help="of the line, in place of the profile's, such as 8N1 or 7E2")
@click.option("--seed", type=int, default=1, show_default=True, help="of everything random")
@click.option("--fault", "faults", multiple=True, metavar="NAME=VALUE", help="what goes wrong; a wrong name lists them")
@click.option("--nominal", type=File(), help="job file: measure against its design; tool radii")
@click.option("--programs", type=Folder(), help="folder of the subprograms in its memory")
@click.option("--probe-pitch", "probe_pitch_mm", type=Number(0.001, 1000), default=0.1, show_default=True, help="mm")
@click.option("--end-on-alarm", is_flag=True, help="end at an alarm or a reset, as at the program's end")
@click.option("--report", type=File(), help="write the report as JSON at the end")
@click.option("--motion", type=File(), help="write the motion log as CSV")
@click.option("--plot", type=File(), help="draw the deviation map as PNG (with --nominal)")
def command(
    machine: str,
    link: Path | None,
    modbus: str | None,
    speed: float,
    baud: int | None,
    form: str | None,
    seed: int,
    faults: tuple[str, ...],
    nominal: Path | None,
    programs: Path | None,
    probe_pitch_mm: float,
    end_on_alarm: bool,
    report: Path | None,
    motion: Path | None,
    plot: Path | None,
) -> int:
    """Be a mill at the other end of the cable (SIMULATED).

    Prints one line of JSON when ready: pseudo-terminal, Modbus address, effective baud rate (the profile's times the
    speed). Ends when the program has ended and the line is quiet, or on SIGTERM; both write the report.
    """
    import dataclasses
    import json

    from dnc.profile import load_profile, profile_path
    from dnc.sending import link_with
    from planner.files import kind_of
    from planner.job import load_job
    from sim.faults import parse_faults
    from sim.grid import check_pitch
    from sim.nominal import load_nominal
    from sim.process import Wishes, run_mill
    from sim.profile import load_mill_profile
    from sim.setup import Setup

    if plot is not None and nominal is None:
        raise click.UsageError("--plot needs the design surface; name the job file with --nominal")
    if programs is not None and kind_of(programs) != "folder":
        raise click.UsageError(f"--programs {programs}: is no folder")
    if nominal is not None:
        design = load_nominal(nominal)
        check_pitch(design.patches, probe_pitch_mm, 2 * design.cutter.radius_mm)
    path = profile_path(machine)
    profile = load_mill_profile(path)
    sending_side = load_profile(path)
    line = link_with(sending_side.link, {"baud": baud, "format": form})
    host, port = _address(modbus) if modbus else (sending_side.modbus.host, sending_side.modbus.port)
    setup = Setup(
        profile=dataclasses.replace(profile, baud=line.baud, format=line.format),
        faults=parse_faults(faults),
        speed=speed,
        modbus_host=host,
        modbus_port=port,
        is_port_fixed=modbus is not None,
        nominal=nominal,
        motion=motion,
        probe_pitch_mm=probe_pitch_mm,
        plot=plot,
        tool_radii_mm={} if nominal is None else load_job(nominal).tool_radii_mm,
        subprogram_folder=programs,
    )
    wishes = Wishes(seed=seed, fault_words=faults, link=link, report=report, ends_on_alarm=end_on_alarm)
    return run_mill(setup, wishes, lambda ready: click.echo(json.dumps(ready)))


def _address(text: str) -> tuple[str, int]:
    from dnc.errors import SettingsRejected

    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdecimal() or int(port) > 65535:
        raise SettingsRejected(f"--modbus {text}: is not HOST:PORT", remedy="write 127.0.0.1:5020")
    return host, int(port)
