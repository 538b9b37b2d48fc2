"""`dnc plan`: a job becomes a program and its report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dnc.cli._options import File, baud_option, format_option, machine_option
from dnc.numbers import Number

if TYPE_CHECKING:
    from dnc.profile import MachineProfile
    from planner.plan import Planned

_CONTROLS = ["sinumerik-840d", "fanuc-30i", "heidenhain-itnc530", "linuxcnc", "generic"]
_BLOCKS = ["auto", "bspline", "poly", "nurbs", "spl", "arcs", "linear"]


def _not_built(ctx: click.Context, param: click.Parameter, value: str | None) -> None:
    """An option that is reserved; raises UsageError where it is given."""
    if value is not None:
        raise click.UsageError(f"{param.opts[0]} is not built yet", ctx)


@click.command(
    short_help="plan a job and write its program",
    epilog="Example: dnc plan configs/jobs/thesis.toml -o part.mpf --report plan.json --plot plan.png",
)
@click.argument("job", type=File())
@click.option("-o", "--output", required=True, type=File(), help="the program to write")
@machine_option
@baud_option
@format_option
@click.option("--post", "control", type=click.Choice(_CONTROLS), help="control, in place of the job's")
@click.option("--blocks", type=click.Choice(_BLOCKS), help="kind of cutting blocks, in place of the job's")
@click.option("--report", type=File(), help="write the report, rivals included, as JSON")
@click.option("--plot", type=File(), help="draw passes, worst scallop and one fit as PNG")
@click.option("--sheet", type=File(), help="write the setup sheet as one HTML page")
@click.option(
    "--lift",
    "lift_mm",
    type=Number(0, 1000),
    default=0.0,
    help="raise the whole program by this many mm, for an air cut",
)
@click.option("--knot-test", is_flag=True, help="write an air program that tells the control's knot rule instead")
@click.option("--workers", expose_value=False, callback=_not_built, help="not built yet")
@click.option("--scheduler", expose_value=False, callback=_not_built, help="not built yet")
@click.option("--json", "as_json", is_flag=True, help="print the report to stdout")
def command(
    job: Path,
    output: Path,
    machine: str,
    baud: int | None,
    form: str | None,
    control: str | None,
    blocks: str | None,
    report: Path | None,
    plot: Path | None,
    sheet: Path | None,
    lift_mm: float,
    *,
    knot_test: bool,
    as_json: bool,
) -> int:
    """Plan JOB and write its program to OUTPUT; beside it OUTPUT.json tells restarts and checks what it is.

    The tape's exact bytes are in OUTPUT; nothing is written if the job cannot be planned.
    """
    import json

    import msgspec

    from dnc.profile import load_profile, profile_path
    from dnc.progress import printable, working
    from dnc.sending import link_with
    from planner.files import check_outputs, write_file
    from planner.job import load_job

    is_reported = report is not None or as_json
    if knot_test and (is_reported or plot or sheet or lift_mm):
        raise click.UsageError(
            "--knot-test writes its program alone; leave --report, --json, --plot, --sheet and --lift out"
        )
    sidecar = output.with_name(output.name + ".json")
    asked = load_job(job)
    check_outputs([output, sidecar, report, plot, sheet], [job, job.parent / asked.part.surface])
    profile_file = profile_path(machine)
    profile = load_profile(profile_file)
    profile = msgspec.structs.replace(profile, link=link_with(profile.link, {"baud": baud, "format": form}))
    if knot_test:
        from planner.post.knot_test import knot_test_program

        write_file(output, knot_test_program(asked.setup.safe_z_mm))
        return 0
    with working(f"planning {job.name}"):
        planned = _planned(
            job, profile, profile_file, control, blocks, lift_mm, is_reported=is_reported, has_sheet=sheet is not None
        )
    text = json.dumps(planned.report, indent=1) + "\n"
    _draw(planned, plot, sheet)
    write_file(output, planned.program)
    write_file(sidecar, (json.dumps(planned.sidecar) + "\n").encode())
    if report is not None:
        write_file(report, text.encode())
    for warning in planned.warnings:
        click.echo(f"dnc: warning: {warning}", err=True)
    if as_json:
        click.echo(text, nl=False)
    else:
        click.echo(printable(_summary(planned.report, output)), err=True)
    return 0


def _planned(
    job: Path,
    profile: MachineProfile,
    profile_file: Path,
    control: str | None,
    blocks: str | None,
    lift_mm: float,
    *,
    is_reported: bool,
    has_sheet: bool,
) -> Planned:
    """The job planned for this machine; its own clock takes as long as that and runs only where its figure is shown."""
    from dnc.planning import limits_of, line_of, machining_clock, travel_of
    from planner.plan import plan_job

    changes: dict[str, Any] = {"control": control, "blocks": blocks}
    return plan_job(
        job,
        limits_of(profile),
        post={key: value for key, value in changes.items() if value is not None},
        rapid_mm_min=min(axis.rapid_mm_min for axis in profile.axes.values()),
        line=line_of(profile),
        with_rivals=is_reported,
        lift_mm=lift_mm,
        time_of=machining_clock(profile_file) if is_reported or has_sheet else None,
        travel_mm=travel_of(profile),
    )


def _draw(planned: Planned, plot: Path | None, sheet: Path | None) -> None:
    from planner.files import write_file

    if plot is not None:
        from planner.plot import draw_plan

        write_file(plot, draw_plan(planned))
    if sheet is not None:
        from planner.sheet import plan_sheet

        write_file(sheet, plan_sheet(planned).encode())


def _summary(report: dict[str, Any], output: Path) -> str:
    return (
        f"{output}: {report['passes']} passes, {report['cut_length_mm']:.1f} mm, {report['blocks']} blocks, "
        f"{report['bytes']} bytes; scallop {1000 * report['scallop_mm']:.2f} um, path within "
        f"{1000 * report['path_deviation_mm']:.2f} um ({report['method']['path_deviation_mm']}), "
        f"planned in {report['planning_time_s']:.2f} s"
    )
