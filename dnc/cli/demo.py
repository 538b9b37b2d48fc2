"""`dnc demo`: the whole chain on the reference part, in one command."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from dnc.cli._options import File, Folder
from dnc.numbers import Number


@click.command(
    short_help="the whole chain on the reference part, on the virtual mill", epilog="Example: dnc demo --out ./dnc-demo"
)
@click.option("--out", default="./dnc-demo", show_default=True, type=Folder(), help="Folder to fill.")
@click.option("--machine", default="virtual-mill", show_default=True, help="Machine profile of the mill and the line.")
@click.option("--job", type=File(), help="Job file; the reference part when left out.")
@click.option("--speed", default=200.0, show_default=True, type=Number(1, 1000), help="Time scale.")
@click.option(
    "--window",
    "window_s",
    default=4.0,
    show_default=True,
    type=Number(0.5, 600),
    help="Seconds of the line at its true speed.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the report instead of the screen.")
def command(out: Path, machine: str, job: Path | None, speed: float, window_s: float, as_json: bool) -> None:
    """Plan, check, drip-feed to the virtual mill over a pseudo-terminal, cut, measure."""
    import json

    from dnc.demo import Settings, elapsed, run_chain
    from dnc.demo_screen import demo_screen
    from dnc.profile import load_profile, profile_path
    from dnc.shipped import shipped_path

    link = load_profile(profile_path(machine)).link
    line = ("--handshake", link.handshake, "--format", link.format, "--start", link.start)
    settings = Settings(job or shipped_path("jobs", "thesis"), machine, speed, window_s, 1500.0, 0.2, line)
    is_watched = sys.stderr.isatty()
    report = run_chain(out, settings, elapsed(lambda text: click.echo(text, err=True) if is_watched else None))
    click.echo(json.dumps(report, indent=1) if as_json else demo_screen(report, out), nl=as_json)
