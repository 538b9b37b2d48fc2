"""`dnc jobs`: what was sent, when, and how it ended."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from dnc.joblist import PastJob


@click.command(short_help="what was sent from here, when, and how it ended", epilog="Example: dnc jobs --json")
@click.argument("job", required=False)
@click.option("--verify", is_flag=True, help="check that no line of the record was changed or removed")
@click.option("--json", "as_json", is_flag=True, help="one JSON object")
def command(job: str | None, verify: bool, as_json: bool) -> None:
    """List the jobs of this computer, or show one JOB in full.

    INTERRUPTED jobs ended without a word (power cut, kill): their journal bounds what the control can have received.
    """
    from dnc.errors import JournalMismatch
    from dnc.joblist import first_broken_link, past_jobs, require_readable, unread_lines
    from dnc.places import state_folder
    from dnc.progress import printable

    require_readable(state_folder())
    jobs = past_jobs(state_folder())
    unread = unread_lines(state_folder())
    if unread:
        what = f"{state_folder()}/records.jsonl: lines that nobody can read: {unread}; their jobs may be missing here"
        click.echo(f"dnc: warning: {what}", err=True)
    if verify:
        broken = first_broken_link(state_folder())
        if broken is not None:
            raise JournalMismatch(f"{state_folder()}/records.jsonl:{broken}: the record was changed or a line removed")
        click.echo("dnc: the record is whole", err=True)
    if job is not None:
        jobs = [past for past in jobs if past.job.startswith(job)]
        if not jobs:
            raise JournalMismatch(f"there is no job {job}; see dnc jobs")
    if as_json:
        rows = [{**past.values, "job": past.job, "outcome": past.outcome} for past in jobs]
        click.echo(json.dumps({"schema": "dripmill.jobs", "version": 1, "jobs": rows}, indent=1))
        return
    if not jobs and not unread:
        click.echo("dnc: no job was sent from here yet", err=True)
    for past in jobs:
        if job is not None:
            for name, value in _page(past):
                click.echo(f"{name:12} {printable(value)}")
            continue
        label = "SIMULATED" if past.values.get("simulated") else ""
        port, program = (printable(str(past.values.get(key, "?"))) for key in ("port", "program"))
        click.echo(f"{past.job:30} {label:9} {past.outcome:11} {_sent(past)}  {port}  {program}")


def _sent(past: PastJob) -> str:
    values = past.values
    sent, total, bound = values.get("bytes_sent", "?"), values.get("bytes_total", "?"), values.get("bound_bytes", 0)
    if isinstance(sent, int) and isinstance(bound, int) and bound > sent:  # what had left when it was killed
        sent = f"{sent} to {min(bound, total) if isinstance(total, int) else bound}"
    return f"{sent}/{total} bytes"


def _page(past: PastJob) -> Iterator[tuple[str, str]]:
    """One job in full, for a reader: what is on record of it, a line each."""
    values = past.values
    yield "job", past.job + (" SIMULATED" if values.get("simulated") else "")
    cause = values.get("cause")
    yield "outcome", past.outcome + (f": {cause}" if cause else "")
    for name in ("note", "program", "machine", "port", "started", "sha256", "handshake", "baud"):
        if values.get(name):
            yield name, str(values[name])
    yield "sent", _sent(past)
    match [values.get(key) for key in ("elapsed_s", "held_s", "xoff_count", "utilisation")]:
        case [int() | float() as elapsed_s, int() | float() as held_s, int() as count, int() | float() as used]:
            held = f"held {held_s:.1f} s by {count} XOFF, {100 * used:.1f} % of the line while not held"
            yield "time", f"{elapsed_s:.1f} s, {held}"
    match values.get("in_doubt"):
        case [first, last]:
            yield "in doubt", f"lines {first} to {last} of what was sent"
    if isinstance(values.get("restart"), dict):
        yield "restart", f"at line {values['restart'].get('line', '?')} of the program"
    alarms = values.get("alarms")
    for alarm in alarms if isinstance(alarms, list) else ():
        if isinstance(alarm, dict):
            yield str(alarm.get("id", "alarm")), f"{alarm.get('text', '')}; {alarm.get('remedy', '')}"
