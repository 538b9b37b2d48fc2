"""`--start-at` and `--resume`: from a stopped job to a program that begins with a computed preamble.

The planner's own restart points (pass starts, listed in the sidecar) are offered; any other block needs --force. The
preamble is shown and the operator asked before anything is sent; nothing ever restarts by itself.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import msgspec

from dnc.control_side import decimals_of, refuse_other_dialect, settings_of
from dnc.device_names import device_of, identity_of
from dnc.errors import InputRejected, JournalMismatch, OperatorAbort, PortUnavailable
from dnc.joblist import PastJob, past_jobs
from dnc.line_pace import pace_of
from dnc.places import state_folder
from dnc.port import Port
from dnc.preamble import Heights
from dnc.profile import Control, MachineProfile, framing_of
from dnc.progress import printable
from dnc.record import UNLESS_LOST, in_doubt
from dnc.restart import RestartPoint, restart_at_line, restart_at_number
from dnc.sidecar import Point, Sidecar, State, load_sidecar
from dnc.tape import Tape
from planner.job import Job

_ENDED = frozenset({"SENT", "ABORTED", "FAULTED"})
"""What only the record says more of: after an alarm of the control the journal's bytes prove nothing."""


@dataclass(frozen=True, slots=True)
class Plan:
    """A restart: the point, the program that begins with its preamble, and how its lines map to the first program's.

    `doubt` are the first and the last line that the `stopped` job left in doubt, None if the operator chose the block;
    `is_lifted` says whether the preamble takes the tool up before anything else moves.
    """

    point: RestartPoint
    data: bytes
    lines_before: int
    program_sha256: str
    doubt: tuple[int, int] | None
    is_lifted: bool
    stopped: PastJob | None = None

    def record(self) -> dict[str, Any]:
        """What the job's record keeps of it."""
        return {
            "line": self.point.line,
            "block": self.point.block,
            "offset_bytes": self.point.offset_bytes,
            "lines_before": self.lines_before,
            "program_sha256": self.program_sha256,
            "preamble": list(self.point.preamble),
        }

    def refuse_other_port(self, port: Port, *, is_forced: bool) -> None:
        """Raise PortUnavailable if the stopped job went through another adapter than the one of this name now."""
        known = _identity_of(self.stopped) if self.stopped is not None else None
        if is_forced or port.is_simulated or known in (None, port.identity):
            return
        what = f"{port.name} is another adapter ({port.identity}) than that of the stopped job ({known})"
        raise PortUnavailable(f"{what}; plug in the right one, or --force")


def plan_restart(
    program: Path,
    tape: Tape,
    machine: tuple[str, MachineProfile],
    start_at: str | None,
    job: Job | None,
    *,
    port: str | None,
    is_forced: bool,
) -> Plan:
    """Where to begin and with which preamble; `start_at` is a block or a line, None resumes the last job on `port`.

    Tool radii are the job's; without one that of the sidecar's tool is known. `machine` is its name and profile. A
    rehearsal has no port: it takes the last job that was none.
    Raises JournalMismatch (no such job, another program or machine), InputRejected (no such block, not to be restored),
    SettingsRejected (a control of another language).
    """
    profile = machine[1]
    refuse_other_dialect(profile)
    data = program.read_bytes()
    sidecar = _sidecar_of(program, data)
    points = sidecar.restart_points
    radii_mm = {sidecar.state.tool: sidecar.radius_mm} if job is None else job.tool_radii_mm
    settings = settings_of(profile, tool_radii_mm=radii_mm, subprogram_folder=program.parent, unknown_radius_mm=0.0)
    heights = _heights(sidecar.state, profile)
    doubt, stopped = None, None
    if start_at is None:
        stopped = _stopped_job(tape, machine[0], port, is_forced=is_forced)
        try:
            doubt = _lines_in_doubt(stopped, tape, profile)
        except (KeyError, TypeError, ValueError):
            what = f"the record of the stopped job {stopped.job} is damaged"
            raise JournalMismatch(f"{what}; use --start-at and the block that the control shows") from None
        line = _last_point_before(points, doubt[0], program)
        point = restart_at_line(data, line, heights, settings)
    elif start_at.upper().startswith("N") and start_at[1:].isdecimal():
        point = restart_at_number(data, int(start_at[1:]), heights, settings)
    elif start_at.isdecimal():
        point = restart_at_line(data, int(start_at), heights, settings)
    else:
        raise click.UsageError(f"--start-at {start_at}: name a block such as N120, or a line such as 57")
    if not is_forced and point.line not in {known.line for known in points}:
        near = _nearest(points, point.line)
        raise InputRejected(
            f"line {point.line} is no restart point of the planner", path=program, remedy=f"{near}, or --force"
        )
    planned = _planned(data, point, tape, doubt, is_lifted=heights.retract_z_mm is not None)
    return replace(planned, stopped=stopped)


def confirm(plan: Plan, *, is_yes: bool) -> None:
    """Say what is in doubt and what to do first, show the preamble and ask; without a terminal only --yes passes."""
    where = f"line {plan.point.line}" + (f" (N{plan.point.block})" if plan.point.block is not None else "")
    if plan.doubt is None:
        said = ["the block is your choice: what lies before it is not cut; look at the part"]
    else:
        first, last = plan.doubt
        said = [] if plan.stopped is None else [f"the stopped job is {_name_of(plan.stopped)}"]
        said.append(f"lines {first} to {last} are in doubt: sent, perhaps not executed")
        if first > 1:
            said.append(f"what lies before line {first} was executed, {UNLESS_LOST}: look at the part")
    said.append(f"restart at {where}: everything from there on is cut again, nothing before it")
    if not plan.is_lifted:
        said.append(
            "FIRST RAISE Z BY HAND, clear of part and clamps: the profile has no retract_z_mm, so nothing lifts the "
            "tool before it is called"
        )
    said.append("this preamble runs before it:")
    for sentence in said:
        click.echo(f"dnc: {sentence}", err=True)
    for block in plan.point.preamble:
        click.echo(f"  {printable(block)}", err=True)
    if is_yes:
        return
    if not sys.stdin.isatty():
        raise click.UsageError("a restart is confirmed at a terminal, or with --yes")
    if not click.confirm("Send it?", default=False, err=True):
        raise OperatorAbort("not confirmed; nothing was sent")


def doubt_of_interrupted(
    values: dict[str, Any], tape: Tape, control: Control, *, inflight_bytes: int = 0
) -> tuple[int, int]:
    """The lines of this tape that a job which ended without a word left in doubt, from the bytes in its journal.

    So many of the last bytes may have been lost on their way: what a killed process or a power cut leaves in the queues
    below never reaches the control.
    A restarted job sent the end of this tape behind a preamble, so its bytes are counted from the end.
    """
    restart = values.get("restart")
    begin = int(restart["line"]) if isinstance(restart, dict) else 1
    ahead = int(values["bytes_total"]) - tape.size_bytes if isinstance(restart, dict) else 0
    sent, bound = (int(values.get(key, 0)) - ahead for key in ("bytes_sent", "bound_bytes"))
    low, high = in_doubt(tape, sent, inflight_bytes, control), in_doubt(tape, max(sent, bound), 0, control)
    return max(begin, low.first if low else 1), max(begin, high.last if high else 1)


def _sha_of(past: PastJob) -> str | None:
    sha = past.values.get("program_sha256")
    return sha if isinstance(sha, str) else None


def refuse_findings(program: Path, profile: MachineProfile, job: Job | None) -> None:
    """--check: raise InputRejected if `dnc check` finds an error; nothing skips this."""
    from dnc.check.limits import limits_of
    from dnc.check.run import check_program

    done = check_program(program, limits_of(profile, job))
    errors = [finding for finding in done.found.findings if finding.severity.value == "error"]
    for finding in errors:
        click.echo(f"dnc: {finding.sentence(program.name)}", err=True)
    if done.found.has_errors:
        raise InputRejected(
            f"dnc check found {len(errors)} errors", path=program, remedy="mend them; --yes does not skip a check"
        )


def _sidecar_of(program: Path, data: bytes) -> Sidecar:
    sidecar = load_sidecar(program)
    if sidecar.sha256 != hashlib.sha256(data).hexdigest():
        raise JournalMismatch(f"{program}.json: the sidecar belongs to another version of the program; plan it again")
    return sidecar


def _heights(state: State, profile: MachineProfile) -> Heights:
    return Heights(
        safe_z_mm=state.safe_z_mm,
        clearance_z_mm=state.clearance_z_mm,
        plunge_mm_min=state.plunge_mm_min,
        dwell_s=state.spindle_dwell_s,
        retract_z_mm=profile.control.retract_z_mm,
        decimals=decimals_of(profile),
    )


def _stopped_job(tape: Tape, machine: str, port: str | None, *, is_forced: bool) -> PastJob:
    """The last job of this program that sent anything through this port, which another port's jobs tell nothing of."""
    sha, known = tape.program_sha256, past_jobs(state_folder())
    jobs = [past for past in known if sha in (_sha_of(past), _restarted(past))]
    jobs = [past for past in jobs if not past.values.get("rehearsal") and _has_sent(past)]
    if not jobs:
        raise JournalMismatch("no job of exactly this program is on record; use --start-at, or send it from its start")
    mine = jobs if port is None or is_forced else [past for past in jobs if _is_through(past, port)]
    if not mine:
        what = f"no job of this program through {port} is on record; the last was {_name_of(jobs[-1])}"
        raise JournalMismatch(f"{what}; name its port, or --force if this one leads to the same control")
    last = mine[-1]
    _refuse_nameless(known, last)
    if last.outcome == "RUNNING":
        raise JournalMismatch(f"the last job of this program ({last.job}) is RUNNING; there is nothing to resume")
    if last.outcome == "SENT":
        what = (
            f"the last job of this program ({last.job}) is SENT: all bytes left, and how far the control came only it"
        )
        raise JournalMismatch(f"{what} knows; restart with --start-at and the block that the control shows")
    name = last.values.get("machine")
    if name not in (None, machine) and not is_forced:
        raise JournalMismatch(f"the stopped job ran on the machine {name}, this is {machine}; give --machine {name}")
    return last


def _refuse_nameless(known: Sequence[PastJob], last: PastJob) -> None:
    """Raise JournalMismatch if a later job lost its description, to a power cut say: it may have been the last one."""
    for past in known:
        if past.job > last.job and _sha_of(past) is None and _has_sent(past):
            what = f"of the job {past.job}, later than {last.job}, it is not on record which program it sent"
            remedy = "it may have been this one; use --start-at and the block that the control shows"
            raise JournalMismatch(f"{what}; {remedy}")


def _lines_in_doubt(last: PastJob, tape: Tape, profile: MachineProfile) -> tuple[int, int]:
    """The first and the last line of this program that the stopped job may or may not have executed."""
    if last.outcome == "INTERRUPTED":
        if last.values.get("state") in _ENDED:
            what = f"the stopped job {last.job} ended {last.values['state']}, but its record could not be written"
            remedy = "how far the control came only it knows; use --start-at and the block that it shows"
            raise JournalMismatch(f"{what}; {remedy}")
        if last.values.get("framing", framing_of(profile.tape)) != framing_of(profile.tape):
            what = (
                f"the stopped job {last.job} was sent with other block ends, leader or trailer than the profile has now"
            )
            remedy = "its bytes lie in other lines; put the profile's [tape] back, or use --start-at"
            raise JournalMismatch(f"{what}; {remedy}")
        control, inflight_bytes = _held_at_most(last.values, profile)
        return doubt_of_interrupted(last.values, tape, control, inflight_bytes=inflight_bytes)
    first, end = last.values.get("in_doubt") or (1, 1)
    restart = last.values.get("restart")
    if not isinstance(restart, dict):
        return int(first), int(end)
    shift = int(restart["line"]) - 1 - int(restart["lines_before"])
    return max(int(restart["line"]), int(first) + shift), max(int(restart["line"]), int(end) + shift)


def _held_at_most(values: dict[str, Any], profile: MachineProfile) -> tuple[Control, int]:
    """The control, and bytes in flight, by the profile of the killed job or that of now, whichever holds more."""
    now = profile.control
    control = msgspec.structs.replace(
        now,
        receive_buffer_bytes=max(now.receive_buffer_bytes, int(values.get("receive_buffer_bytes", 0))),
        lookahead_blocks=max(now.lookahead_blocks, int(values.get("lookahead_blocks", 0))),
    )
    return control, max(pace_of(profile).beyond_recall_bytes, int(values.get("beyond_recall_bytes", 0)))


def _has_sent(past: PastJob) -> bool:
    """Whether bytes of it may have left; the journal of a job without a record lags behind."""
    return past.values.get("bytes_sent") != 0 or past.outcome in ("INTERRUPTED", "RUNNING")


def _is_through(past: PastJob, port: str) -> bool:
    """Whether a job went through this port: by its name, or by the identity of what bears this name now."""
    if past.values.get("port") == port:
        return True
    if "://" in port:
        return False
    return _identity_of(past) == identity_of(device_of(port))


def _identity_of(past: PastJob) -> object:
    return past.values.get("port_identity") or past.values.get("identity")


def _name_of(past: PastJob) -> str:
    """A job as the operator remembers it."""
    return f"{past.job}, started {past.values.get('started', '--')}, through {past.values.get('port', '--')}"


def _restarted(past: PastJob) -> str | None:
    restart = past.values.get("restart")
    return restart.get("program_sha256") if isinstance(restart, dict) else None


def _last_point_before(points: Sequence[Point], line: int, program: Path) -> int:
    before = [point.line for point in points if point.line <= line]
    if not before:
        what = f"line {line} is in doubt and no restart point lies before it"
        remedy = "send it from its start, or restart with --start-at and the block that the control shows"
        raise JournalMismatch(f"{program}: {what}; {remedy}")
    return max(before)


def _nearest(points: Sequence[Point], line: int) -> str:
    before = [point for point in points if point.line <= line]
    if not before:
        return "send it from its start"
    point = max(before, key=lambda known: known.line)
    return f"use N{point.block}" if point.block is not None else f"use line {point.line}"


def _planned(data: bytes, point: RestartPoint, tape: Tape, doubt: tuple[int, int] | None, *, is_lifted: bool) -> Plan:
    """Header lines of the program, the preamble, the rest; with the program's own block ends."""
    end = tape.block_end
    above = [line for line in data[: point.offset_bytes].splitlines() if line]
    head = [line for line in above[:3] if line.startswith((b"%", b";$"))]
    before = [*head, *(block.encode("ascii") for block in point.preamble)]
    body = b"".join(line + end for line in before) + data[point.offset_bytes :]
    return Plan(point, body, len(before), tape.program_sha256, doubt, is_lifted)
