"""`dnc jobs`: what was sent, when, and how it ended."""

from __future__ import annotations

import json

import click


@click.command(epilog="Example: dnc jobs --json")
@click.argument("job", required=False)
@click.option("--verify", is_flag=True, help="check that no line of the record was changed or removed")
@click.option("--json", "as_json", is_flag=True, help="one JSON object")
def command(job: str | None, verify: bool, as_json: bool) -> None:
    """List the jobs of this computer, or show one JOB in full.

    INTERRUPTED jobs ended without a word (power cut, kill): their journal bounds what the control can have received.
    """
    from dnc.errors import JournalMismatch
    from dnc.joblist import first_broken_link, past_jobs
    from dnc.places import state_folder
    from dnc.progress import printable

    jobs = past_jobs(state_folder())
    if verify:
        broken = first_broken_link(state_folder())
        if broken is not None:
            raise JournalMismatch(f"{state_folder()}/records.jsonl:{broken}: the record was changed or a line removed")
        click.echo("dnc: the record is whole", err=True)
    if job is not None:
        jobs = [past for past in jobs if past.job.startswith(job)]
        if not jobs:
            raise JournalMismatch(f"there is no job {job}; see dnc jobs")
    if as_json or job is not None:
        rows = [{**past.values, "job": past.job, "outcome": past.outcome} for past in jobs]
        click.echo(json.dumps({"schema": "dripmill.jobs", "version": 1, "jobs": rows}, indent=1))
        return
    if not jobs:
        click.echo("dnc: no job was sent from here yet", err=True)
    for past in jobs:
        values = past.values
        label = "SIMULATED" if values.get("simulated") else ""
        sent = f"{values.get('bytes_sent', '?')}"
        if values.get("bound_bytes", 0) > values.get("bytes_sent", 0):  # what had left when the process was killed
            sent += f" to {min(values['bound_bytes'], values.get('bytes_total', values['bound_bytes']))}"
        sent += f"/{values.get('bytes_total', '?')} bytes"
        click.echo(f"{past.job:30} {label:9} {past.outcome:11} {sent}  {printable(str(values.get('program', '?')))}")
