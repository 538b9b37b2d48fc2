"""`dnc measure`: compare measured points with the design."""

from __future__ import annotations

from pathlib import Path

import click

from dnc.cli._options import File

_PATH = File()


@click.command(
    short_help="compare measured points with the design", epilog="Example: dnc measure points.csv --job job.toml --json"
)
@click.argument("points", type=_PATH)
@click.option("--job", type=_PATH, required=True, help="job file: the design surface")
@click.option("--report", type=_PATH, help="write the report (JSON)")
@click.option("--json", "as_json", is_flag=True, help="print the report to stdout")
def command(points: Path, job: Path, report: Path | None, as_json: bool) -> int:
    """Compare the points of a CSV table with the design.

    Columns: x_mm, z_mm (or z_measured_mm), and y_mm; a table without y_mm needs z_design_mm. The mean deviation along
    Z is the set-up offset (zero point, tool length); what remains without it is form.
    """
    import json

    from planner.files import check_outputs, write_file
    from sim.measuring import compared, load_points
    from sim.nominal import load_nominal

    check_outputs([report], [points, job])
    made = compared(load_points(points), load_nominal(job)).report()
    text = json.dumps(made, indent=1)
    if report is not None:
        write_file(report, f"{text}\n".encode())
    if as_json:
        click.echo(text)
        return 0
    low, high = made["residual_range_mm"]
    click.echo(f"{made['points']} points; offset along Z {made['offset_mm']:+.4f} mm (set-up: zero point, tool length)")
    click.echo(f"residual after registration {made['residual_mm']:.4f} mm, from {low:+.4f} to {high:+.4f} mm")
    return 0
