"""dnc check: findings about a program before a byte leaves."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dnc.cli._options import File, baud_option, format_option, machine_option
from planner.errors import ExitCode

if TYPE_CHECKING:
    from dnc.check.finding import Collection
    from dnc.check.limits import Limits
    from dnc.check.run import Check
    from dnc.check.sheet import SheetWatch


@click.command(
    short_help="list what is wrong with a program; nothing moves",
    epilog="Example: dnc check part.mpf --machine sinumerik-840d --job job.toml",
)
@click.argument("program", type=File())
@machine_option
@click.option(
    "--job",
    type=File(),
    help="job file: stock box, clearance, tool radii; zero point and tools of the sheet",
)
@baud_option
@format_option
@click.option("--sheet", type=File(), help="write a setup sheet as HTML")
@click.option("--json", "as_json", is_flag=True, help="the report as JSON on stdout")
def command(
    program: Path,
    machine: str,
    job: Path | None,
    baud: int | None,
    form: str | None,
    sheet: Path | None,
    *,
    as_json: bool,
) -> int:
    """Interpret PROGRAM without moving anything and list what is wrong; exit 3 when an error is found."""
    from dnc.check.run import check_program
    from planner.files import kind_of

    watch = None
    limits = _limits(machine, job, baud, form)
    if sheet is not None:
        from dnc.check.sheet import SheetWatch
        from planner.files import check_outputs

        check_outputs([sheet], [program, job])
        watch = SheetWatch(limits)
    size_bytes = program.stat().st_size if kind_of(program) == "file" else 0
    with click.progressbar(
        length=size_bytes, label="checking", file=sys.stderr, hidden=not sys.stderr.isatty() or size_bytes < 1_000_000
    ) as bar:
        done = check_program(program, limits, lambda at: bar.update(at - bar.pos), watch)
    if sheet is not None and watch is not None:
        _write_sheet(sheet, program, machine, job, watch, done)
    if as_json:
        click.echo(json.dumps({"program": program.name, **done.found.report(), "blocks": done.track.blocks}, indent=1))
    else:
        _print(program, done.found, done.track.blocks)
    return int(ExitCode.REJECTED if done.found.has_errors else ExitCode.OK)


def _limits(machine: str, job: Path | None, baud: int | None, form: str | None) -> Limits:
    import msgspec

    from dnc.check.limits import limits_of
    from dnc.profile import load_profile, profile_path
    from dnc.sending import link_with
    from planner.job import load_job

    profile = load_profile(profile_path(machine))
    profile = msgspec.structs.replace(profile, link=link_with(profile.link, {"baud": baud, "format": form}))
    return limits_of(profile, None if job is None else load_job(job))


def _write_sheet(sheet: Path, program: Path, machine: str, job: Path | None, watch: SheetWatch, done: Check) -> None:
    from dnc.check.sheet import program_sheet
    from dnc.planning import machining_clock
    from dnc.profile import profile_path
    from planner.errors import InputRejected
    from planner.files import write_file
    from planner.job import load_job

    machining_s = None
    if not done.found.has_errors:
        clock = machining_clock(profile_path(machine), program.parent, done.limits.tool_radii_mm)
        machining_s = clock(program.read_bytes())
    planned = None if job is None else load_job(job)
    need_bytes_s, blocks = done.need_bytes_s, done.track.blocks
    page = program_sheet(
        program,
        watch,
        done.found,
        blocks,
        need_bytes_s=need_bytes_s,
        machining_s=machining_s,
        offsets=done.track.offsets,
        job=planned,
    )
    if page is None:
        raise InputRejected("cuts nothing, so there is no setup sheet", path=program, remedy="leave --sheet away")
    write_file(sheet, page.encode())


def _print(program: Path, found: Collection, blocks: int) -> None:
    from dnc.progress import printable

    report = found.report()
    for finding in sorted(found.findings, key=lambda one: (one.line, one.column)):
        click.echo(printable(finding.sentence(program.name)))
    for name, count in report["not_listed"].items():
        click.echo(printable(f"{program.name}: {count} more findings {name}"))
    click.echo(f"{blocks} blocks: {report['errors']} errors, {report['warnings']} warnings, {report['notes']} notes")
