"""dnc split: parts of a program for a control that must hold it whole."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dnc.cli._options import File, Folder, machine_option
from dnc.numbers import Number, Whole

if TYPE_CHECKING:
    from dnc.preamble import Heights
    from dnc.profile import MachineProfile
    from dnc.split import Part
    from planner.job import Job


@click.command(
    short_help="cut a program into parts that a control can hold",
    epilog="Example: dnc split part.mpf --bytes 30000 -o parts/ --job job.toml",
)
@click.argument("program", type=File())
@click.option("-o", "--output", required=True, type=Folder(), help="folder for the parts")
@click.option("--job", required=True, type=File(), help="job file: heights, plunge feed, dwell")
@click.option("--bytes", "most_bytes", type=Whole(min=200), help="most bytes a part; default: the profile's buffer")
@machine_option
@click.option(
    "--retract-z",
    "retract_z_mm",
    type=Number(-100_000, 100_000),
    help="machine height before tool change and at the end; default: the profile's",
)
@click.option("--json", "as_json", is_flag=True, help="the parts as JSON on stdout")
def command(
    program: Path,
    output: Path,
    job: Path,
    most_bytes: int | None,
    machine: str,
    retract_z_mm: float | None,
    as_json: bool,
) -> int:
    """Cut PROGRAM where the tool stands clear; each part restores tool, spindle, frames and modes, and ends itself."""
    from dnc.control_side import refuse_other_dialect, settings_of
    from dnc.framing import CharacterCheck
    from dnc.profile import beyond_travel, load_profile, profile_path
    from dnc.restart import first_optional_line
    from dnc.split import split_program
    from planner.files import made_folder, read_program, write_file
    from planner.job import load_job

    profile = load_profile(profile_path(machine))
    beyond = beyond_travel("--retract-z", retract_z_mm, profile)
    if beyond:
        raise click.UsageError(beyond)
    loaded = load_job(job)
    heights = _heights(loaded, profile, retract_z_mm)
    settings = settings_of(
        profile, tool_radii_mm=loaded.tool_radii_mm, subprogram_folder=program.parent, is_drip_fed=False
    )
    limit = most_bytes or profile.control.receive_buffer_bytes
    data = read_program(program)
    if len(data) > limit:
        refuse_other_dialect(profile)
    CharacterCheck(program, profile.tape.character_set, len(data), profile.link.data_bits).feed(data)
    parts = split_program(data, limit, heights, settings)
    made_folder(output)
    names = [output / f"{program.stem}-{number}{program.suffix}" for number in range(1, len(parts) + 1)]
    for name, part in zip(names, parts, strict=True):
        write_file(name, part.data)
    optional_line = first_optional_line(data, len(data)) if len(parts) > 1 else None
    if optional_line is not None and optional_line < parts[-1].first_line:
        what = f"line {optional_line} begins with /, and the parts behind it count such blocks as run"
        click.echo(f"dnc: warning: {program}: {what}; switch block skip off at the control", err=True)
    _tell_earlier_parts(output, program, len(parts))
    _print(names, parts, as_json=as_json)
    return 0


def _heights(job: Job, profile: MachineProfile, retract_z_mm: float | None) -> Heights:
    """Where the tool goes between two parts, as the job says; the retract as given, else the profile's."""
    from dnc.control_side import decimals_of
    from dnc.preamble import Heights

    operation = job.operation[0]
    return Heights(
        safe_z_mm=job.setup.safe_z_mm,
        clearance_z_mm=job.setup.clearance_z_mm,
        plunge_mm_min=operation.plunge_mm_min,
        dwell_s=operation.spindle_dwell_s,
        retract_z_mm=profile.control.retract_z_mm if retract_z_mm is None else retract_z_mm,
        decimals=decimals_of(profile),
    )


def _print(names: list[Path], parts: list[Part], *, as_json: bool) -> None:
    from dnc.progress import printable

    rows = [
        {"file": name.name, "bytes": len(part.data), "first_line": part.first_line, "last_line": part.last_line}
        for name, part in zip(names, parts, strict=True)
    ]
    if as_json:
        click.echo(json.dumps({"schema": "dripmill.split", "version": 1, "parts": rows}, indent=1))
        return
    for row in rows:
        lines = f"lines {row['first_line']} to {row['last_line']}"
        click.echo(f"{printable(str(row['file']))}: {row['bytes']} bytes, {lines}")


def _tell_earlier_parts(folder: Path, program: Path, count: int) -> None:
    """Parts that an earlier split left behind would pass for parts of this one."""
    number = count
    while (folder / f"{program.stem}-{number + 1}{program.suffix}").exists():
        number += 1
    if number == count:
        return
    first, last = (f"{program.stem}-{one}{program.suffix}" for one in (count + 1, number))
    names = first if first == last else f"{first} to {last}"
    click.echo(f"dnc: warning: {folder} still holds parts of an earlier split, {names}; remove them", err=True)
