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

from dnc.control_side import decimals_of, refuse_other_dialect, settings_of
from dnc.errors import InputRejected, JournalMismatch, OperatorAbort, PortUnavailable
from dnc.joblist import PastJob
from dnc.port import Port
from dnc.preamble import Heights
from dnc.profile import MachineProfile
from dnc.progress import printable
from dnc.record import UNLESS_LOST
from dnc.restart import RestartPoint, first_optional_line, line_of_number, restart_at_line
from dnc.sidecar import Point, Sidecar, State, load_sidecar
from dnc.stopped import identity_of_job, lines_in_doubt, name_of, stopped_job
from dnc.tape import Tape
from planner.files import read_program
from planner.job import Job
from sim.interpreter.settings import Settings


@dataclass(frozen=True, slots=True)
class Plan:
    """A restart: the point, the program that begins with its preamble, and how its lines map to the first program's.

    `doubt` are the first and the last line that the `stopped` job left in doubt, None if the operator chose the block;
    `is_lifted` says whether the preamble takes the tool up before anything else moves, `optional_line` is the first
    line before it with a /, which the preamble takes as run.
    """

    point: RestartPoint
    data: bytes
    lines_before: int
    program_sha256: str
    doubt: tuple[int, int] | None
    is_lifted: bool
    stopped: PastJob | None = None
    optional_line: int | None = None

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
        known = identity_of_job(self.stopped) if self.stopped is not None else None
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
    Raises JournalMismatch (no such job, another program or machine), InputRejected (no such block, not to be restored,
    written anew since the tape was made), SettingsRejected (a control of another language).
    """
    profile = machine[1]
    refuse_other_dialect(profile)
    data = read_program(program)
    refuse_changed(program, data, tape)
    sidecar = _sidecar_of(program, data)
    points = sidecar.restart_points
    radii_mm = {sidecar.state.tool: sidecar.radius_mm} if job is None else job.tool_radii_mm
    settings = settings_of(profile, tool_radii_mm=radii_mm, subprogram_folder=program.parent, unknown_radius_mm=0.0)
    heights = _heights(sidecar.state, profile)
    doubt, stopped = None, None
    if start_at is None:
        stopped = stopped_job(tape, machine[0], port, is_forced=is_forced)
        doubt = lines_in_doubt(stopped, tape, profile)
        line = _last_point_before(points, doubt[0], program)
    else:
        line = _line_named(start_at, data, settings)
    if not is_forced and line not in {known.line for known in points}:
        near = _nearest(points, line)
        raise InputRejected(
            f"line {line} is no restart point of the planner", path=program, remedy=f"{near}, or --force"
        )
    point = restart_at_line(data, line, heights, settings)
    planned = _planned(data, point, tape, doubt, is_lifted=heights.retract_z_mm is not None)
    return replace(planned, stopped=stopped, optional_line=first_optional_line(data, point.offset_bytes))


def _line_named(start_at: str, data: bytes, settings: Settings) -> int:
    """The line that --start-at means."""
    if start_at.isdecimal():
        return int(start_at)
    if start_at.upper().startswith("N") and start_at[1:].isdecimal():
        return line_of_number(data, int(start_at[1:]), settings)
    raise click.UsageError(f"--start-at {start_at}: name a block such as N120, or a line such as 57")


def confirm(plan: Plan, *, is_yes: bool) -> None:
    """Say what is in doubt and what to do first, show the preamble and ask; without a terminal only --yes passes."""
    where = f"line {plan.point.line}" + (f" (N{plan.point.block})" if plan.point.block is not None else "")
    if plan.doubt is None:
        said = ["the block is your choice: what lies before it is not cut; look at the part"]
    else:
        first, last = plan.doubt
        said = [] if plan.stopped is None else [f"the stopped job is {name_of(plan.stopped)}"]
        said.append(f"lines {first} to {last} are in doubt: sent, perhaps not executed")
        if first > 1:
            said.append(f"what lies before line {first} was executed, {UNLESS_LOST}: look at the part")
    said.append(f"restart at {where}: everything from there on is cut again, nothing before it")
    if plan.optional_line is not None:
        said.append(
            f"blocks with / before it, the first in line {plan.optional_line}, count as run: if block skip is on at "
            "the control, the preamble is wrong"
        )
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


def refuse_changed(program: Path, data: bytes, tape: Tape) -> None:
    """Raise InputRejected if the file is no longer what was spooled: its lines are others than those on the tape."""
    if hashlib.sha256(data).hexdigest() != tape.program_sha256:
        raise InputRejected("was written anew while it was examined", path=program, remedy="send it once more")


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
