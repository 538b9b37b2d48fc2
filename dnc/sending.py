"""What `dnc send` does before and after the job itself: settings, refusals, the port, the report."""

from __future__ import annotations

import contextlib
import json
import signal
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import msgspec

from dnc.aftermath import refuse_dirty_control
from dnc.errors import ExitCode, InputRejected, SettingsRejected
from dnc.forewarning import haste_warnings, line_warnings, refuse_overrun, tape_warnings
from dnc.hooks import hooks_of
from dnc.job import SIGTERM_EXIT, Finished, Job
from dnc.joblist import known_ids
from dnc.names import JobNames, new_job_id
from dnc.places import made_state_folder, state_folder
from dnc.port import Port, SerialPort
from dnc.profile import Link, MachineProfile, load_profile, profile_path
from dnc.progress import Ticker, event_lines, job_line, silence_output, tell, working
from dnc.spool import load_tape
from dnc.stamp import refuse_contradiction
from dnc.tape import Tape
from planner.files import check_outputs, read_program, write_file
from planner.job import Job as PlannedJob
from planner.job import load_job

if TYPE_CHECKING:
    from dnc.rehearsal import Rehearsal
    from dnc.resuming import Plan


@dataclass(frozen=True, slots=True)
class Wishes:
    """The options of `dnc send`, as given."""

    program: Path
    port: str | None
    machine: str
    baud: int | None
    form: str | None
    handshake: str | None
    start: str | None
    start_timeout_s: float | None
    hold_timeout_s: float | None
    start_at: str | None
    resume: bool
    check_first: bool
    job: Path | None
    report: Path | None
    yes: bool
    force: bool
    control_was_reset: bool
    dry_run: bool
    speed: float | None
    hook: str | None
    webhook: str | None
    as_json: bool


def send(wishes: Wishes) -> int:
    """Send a program as wished and return the exit code; raises UserError for whatever forbids it."""
    if (wishes.port is None) == (not wishes.dry_run):
        raise click.UsageError("give --port PORT, or --dry-run for the virtual mill")
    if wishes.speed is not None and not wishes.dry_run:
        raise click.UsageError("--speed goes with --dry-run; a real control keeps its own time")
    profile = effective_profile(wishes)
    job = None if wishes.job is None else load_job(wishes.job)
    check_outputs(
        [wishes.report], [wishes.program, wishes.program.with_name(f"{wishes.program.name}.json"), wishes.job]
    )
    tape = _load(wishes.program, profile)
    plan: Plan | None = None
    try:
        refuse_contradiction(tape, profile, wishes.program)
        if wishes.check_first:
            from dnc.resuming import refuse_changed, refuse_findings

            refuse_findings(wishes.program, profile, job)
            refuse_changed(wishes.program, read_program(wishes.program), tape)
        if wishes.start_at is not None or wishes.resume:
            tape, plan = _restarted(tape, profile, wishes, job)
        with _port(wishes, profile) as (port, profile, mill):
            try:
                refuse_overrun(tape, profile, port, is_forced=wishes.force)
                refuse_dirty_control(port.identity, wishes.yes, wishes.control_was_reset)
                if plan is not None and wishes.resume:
                    plan.refuse_other_port(port, is_forced=wishes.force)
            except BaseException:
                port.close()
                raise
            names = _names(wishes, plan.record() if plan is not None else None, mill)
            finished = _run(tape, port, profile, wishes, names)
            if mill is not None and finished.exit_code == 0:
                finished = _rehearsed(finished, mill, tape, wishes, job)
    finally:
        tape.close()
    return _ending(finished, wishes)


def _restarted(tape: Tape, profile: MachineProfile, wishes: Wishes, job: PlannedJob | None) -> tuple[Tape, Plan]:
    """The tape of a restart in place of the whole program's, once the operator agreed."""
    from dnc.resuming import confirm, plan_restart

    if wishes.start_at is not None and wishes.resume:
        raise click.UsageError("give --start-at or --resume, not both")
    machine = (wishes.machine, profile)
    chosen = wishes.start_at
    plan = plan_restart(wishes.program, tape, machine, chosen, job, port=wishes.port, is_forced=wishes.force)
    confirm(plan, is_yes=wishes.yes)
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / wishes.program.name
        program.write_bytes(plan.data)
        restarted = _load(program, profile)
    tape.close()
    return restarted, plan


def _load(program: Path, profile: MachineProfile) -> Tape:
    return load_tape(program, profile.tape, made_state_folder() / "spool", profile.link.data_bits)


def machine_profile(machine: str) -> MachineProfile:
    """The profile of this name or path."""
    return load_profile(profile_path(machine))


def link_with(link: Link, given: Mapping[str, object]) -> Link:
    """The line with what the options say in place of the profile's values; None means not given."""
    values = msgspec.to_builtins(link) | {name: value for name, value in given.items() if value is not None}
    try:
        changed = msgspec.convert(values, Link)
    except msgspec.ValidationError as problem:
        raise SettingsRejected(str(problem).replace(" - at `$.", ": ").rstrip("`"), remedy="mend the option") from None
    if changed.format.endswith("1.5") and not changed.format.startswith("5"):
        raise SettingsRejected(
            f"format {changed.format}: 1.5 stop bits exist with 5 data bits only", remedy="use 1 or 2"
        )
    if changed.software_parity and (changed.format[0] != "7" or changed.format[1] not in "EO"):
        raise SettingsRejected(
            f"software_parity cannot make format {changed.format}",
            remedy="write 7E or 7O, such as 7E1, or leave it out",
        )
    if changed.software_parity and changed.handshake == "driver":
        raise SettingsRejected(
            "handshake driver cannot work with software_parity: XOFF comes with a parity bit that the driver "
            "does not know",
            remedy="use --handshake xonxoff, or an adapter that knows the parity",
        )
    if changed.start == "wait-xon" and changed.handshake != "xonxoff":
        raise SettingsRejected(
            f"start wait-xon cannot work with handshake {changed.handshake}: nobody reads the XON",
            remedy="use --handshake xonxoff, or --start immediate",
        )
    return changed


def effective_profile(wishes: Wishes) -> MachineProfile:
    """The machine's profile with the options in place of its own values."""
    profile = machine_profile(wishes.machine)
    given = {
        "baud": wishes.baud,
        "format": wishes.form,
        "handshake": wishes.handshake,
        "start": wishes.start,
        "start_timeout_s": wishes.start_timeout_s,
        "hold_timeout_s": wishes.hold_timeout_s,
    }
    return msgspec.structs.replace(profile, link=link_with(profile.link, given))


def open_port(name: str, link: Link) -> Port:
    """A device, a pty, or a port behind a network."""
    if "://" in name:
        from dnc.port_url import UrlPort

        return UrlPort(name, link)
    return SerialPort(name, link)


@contextlib.contextmanager
def _port(wishes: Wishes, profile: MachineProfile) -> Iterator[tuple[Port, MachineProfile, Rehearsal | None]]:
    """The port to send to, the profile with the baud rate that counts there, and the mill of a rehearsal."""
    if wishes.port is not None:
        yield open_port(wishes.port, profile.link), profile, None
        return
    from dnc.rehearsal import Wanted, rehearsal_mill

    wanted = Wanted(wishes.machine, profile.link, wishes.speed or 1.0, wishes.program.absolute().parent, wishes.job)
    with rehearsal_mill(wanted) as mill:
        usual = f"{profile.modbus.host}:{profile.modbus.port}"
        if mill.modbus != usual:
            why = f"{usual} of the profile is taken, or no address of this computer"
            tell(f"the status of this rehearsal's mill is at {mill.modbus} ({why}): dnc console --modbus {mill.modbus}")
        scaled = msgspec.structs.replace(profile, link=msgspec.structs.replace(profile.link, baud=mill.baud))
        yield open_port(mill.pty, scaled.link), scaled, mill


def _rehearsed(finished: Finished, mill: Rehearsal, tape: Tape, wishes: Wishes, job: PlannedJob | None) -> Finished:
    """How the rehearsal ended, once the mill has cut what it was sent."""
    code: int
    with mill.ended_by_signals() as heard:
        from dnc.planning import machining_clock

        radii_mm = None if job is None else job.tool_radii_mm
        clock = machining_clock(profile_path(wishes.machine), wishes.program.absolute().parent, radii_mm)
        machining_s = clock(tape.peek(0, tape.size_bytes))
        with working("SIMULATED: the virtual mill is cutting"):
            code, found = mill.ending(machining_s, lambda text: tell(f"SIMULATED: {text}"))
    if heard:
        who, ended = ("the operator", int(ExitCode.ABORTED)) if heard[0] == signal.SIGINT else ("SIGTERM", SIGTERM_EXIT)
        code, found = ended, f"{who} ended the rehearsal before the mill had cut them"
    sentence = f"sent {finished.report['bytes_sent']} bytes; {found}"
    return replace(finished, report={**finished.report, "exit_code": int(code)}, exit_code=int(code), sentence=sentence)


def _names(wishes: Wishes, restart: dict[str, Any] | None, mill: Rehearsal | None) -> JobNames:
    return JobNames(
        new_job_id(known_ids(state_folder())),
        str(wishes.program),
        wishes.machine,
        restart,
        is_rehearsal=mill is not None,
        mill_modbus="" if mill is None else mill.modbus,
    )


def _run(tape: Tape, port: Port, profile: MachineProfile, wishes: Wishes, names: JobNames) -> Finished:
    hurry = [] if wishes.dry_run else haste_warnings(port)
    for warning in [*line_warnings(profile, port), *tape_warnings(tape), *hurry]:
        tell(f"warning: {warning}")
    about: dict[str, Any] = {"job": names.job_id, "program": names.program, "machine": names.machine}
    about |= {"port": port.name, "simulated": port.is_simulated}
    hooks = hooks_of(wishes.hook, wishes.webhook, about, lambda text: tell(f"warning: {text}"))
    job = Job(tape, port, profile, names, [event_lines(port.is_simulated, lambda: job.stream.is_leaving), *hooks])
    with Ticker(lambda: job_line(job.sender, port.is_simulated), sys.stderr):
        finished = job.run()
    if job.unheard_events:
        tell(f"warning: {job.unheard_events} events did not reach the hook in time")
    if job.not_kept:
        what = f"the job could not be put on record: {job.not_kept}"
        tell(f"warning: {what}; free space in {state_folder()}, and reset the control before the next job")
    return finished


def _ending(finished: Finished, wishes: Wishes) -> int:
    text = json.dumps(finished.report, indent=1)
    label = "SIMULATED: " if finished.report["simulated"] else ""
    tell(f"{label}{finished.sentence}")
    code = finished.exit_code
    if wishes.report is not None:
        try:
            write_file(wishes.report, f"{text}\n".encode())
        except InputRejected as problem:
            tell(f"{problem}; the job itself ended as said before")
            # Not 3: who reads that takes the program for refused and sends it again.
            code = code or ExitCode.SETTINGS
    if wishes.as_json:
        try:
            click.echo(text)
        except OSError as problem:
            silence_output()
            tell(f"the report cannot be written to stdout: {problem.strerror}; the job itself ended as said before")
            code = code or ExitCode.SETTINGS
    return code
