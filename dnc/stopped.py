"""The stopped job that `--resume` takes up, and the lines that it left in doubt.

What is on record is all that is known of it: where the record leaves a choice, the reading that doubts more lines is
taken, and where it proves nothing the operator is asked for the block that the control shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec

from dnc.device_names import device_of, identity_of
from dnc.errors import JournalMismatch
from dnc.joblist import PastJob, about_of, past_jobs, require_traces
from dnc.line_pace import pace_of
from dnc.pacing import Pace
from dnc.places import state_folder
from dnc.profile import Control, MachineProfile, framing_of
from dnc.record import in_doubt
from dnc.tape import Tape

_ENDED = frozenset({"SENT", "ABORTED", "FAULTED"})
"""What only the record says more of: after an alarm of the control the journal's bytes prove nothing."""
_BOUNDS = ("framing", "receive_buffer_bytes", "lookahead_blocks", "beyond_recall_bytes")
"""What a killed job must have said of itself: without it today's profile, perhaps of less, would bound its window."""


def stopped_job(tape: Tape, machine: str, port: str | None, *, is_forced: bool) -> PastJob:
    """The last job of this program that sent anything through this port, which another port's jobs tell nothing of.

    Raises JournalMismatch if there is none, or if the last one runs, is SENT, ran on another machine, or may be hidden.
    """
    require_traces(state_folder())
    sha, known = tape.program_sha256, past_jobs(state_folder())
    jobs = [past for past in known if sha in (_sha_of(past), _restarted(past))]
    jobs = [past for past in jobs if not past.values.get("rehearsal") and _has_sent(past)]
    if not jobs:
        raise JournalMismatch("no job of exactly this program is on record; use --start-at, or send it from its start")
    mine = jobs if port is None or is_forced else [past for past in jobs if _is_through(past, port)]
    if not mine:
        what = f"no job of this program through {port} is on record; the last was {name_of(jobs[-1])}"
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


def lines_in_doubt(last: PastJob, tape: Tape, profile: MachineProfile) -> tuple[int, int]:
    """The first and the last line of this program that the stopped job may or may not have executed.

    Raises JournalMismatch where its record proves nothing or is damaged.
    """
    try:
        return _lines_on_record(last, tape, profile)
    except (KeyError, TypeError, ValueError):
        what = f"the record of the stopped job {last.job} is damaged"
        raise JournalMismatch(f"{what}; use --start-at and the block that the control shows") from None


def _lines_on_record(last: PastJob, tape: Tape, profile: MachineProfile) -> tuple[int, int]:
    if last.outcome == "INTERRUPTED":
        if last.values.get("state") in _ENDED:
            what = f"the stopped job {last.job} ended {last.values['state']}, but its record could not be written"
            remedy = "how far the control came only it knows; use --start-at and the block that it shows"
            raise JournalMismatch(f"{what}; {remedy}")
        if any(key not in last.values for key in _BOUNDS):
            what = f"the stopped job {last.job} was killed under an older dnc, which did not record all of its profile"
            remedy = "the profile may have changed since; use --start-at and the block that the control shows"
            raise JournalMismatch(f"{what}; {remedy}")
        _refuse_other_framing(last, last.values, tape, profile)
        control, inflight_bytes = _held_at_most(last.values, profile)
        return doubt_of_interrupted(last.values, tape, control, inflight_bytes=inflight_bytes)
    told, reckoned = _lines_told(last.values), _lines_reckoned(last, tape, profile)
    return (min(told[0], reckoned[0]), max(told[1], reckoned[1])) if reckoned else told


def _lines_told(values: dict[str, Any]) -> tuple[int, int]:
    """What the job itself said when it ended, in lines of the program's file."""
    first, end = values.get("in_doubt") or (1, 1)
    restart = values.get("restart")
    if not isinstance(restart, dict):
        return int(first), int(end)
    shift = int(restart["line"]) - 1 - int(restart["lines_before"])
    return max(int(restart["line"]), int(first) + shift), max(int(restart["line"]), int(end) + shift)


def _lines_reckoned(last: PastJob, tape: Tape, profile: MachineProfile) -> tuple[int, int] | None:
    """The same by today's rules, and by the profile of now where that holds more: an older dnc doubted fewer lines.

    None where the record does not say how much was sent, and nothing can have waited unseen on the way.
    """
    values = {**about_of(state_folder(), last.job), **last.values}
    if "bytes_sent" in values and "bytes_total" in values:
        _refuse_other_framing(last, values, tape, profile)
        control, inflight_bytes = _held_at_most(values, profile)
        return doubt_of_interrupted(values, tape, control, inflight_bytes=inflight_bytes)
    if _pace_at_most(values, profile).unseen_bytes:
        what = f"the record of the stopped job {last.job} does not say how much an adapter or a network held back"
        raise JournalMismatch(f"{what}; use --start-at and the block that the control shows")
    return None


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


def name_of(past: PastJob) -> str:
    """A job as the operator remembers it."""
    return f"{past.job}, started {past.values.get('started', '--')}, through {past.values.get('port', '--')}"


def identity_of_job(past: PastJob) -> object:
    """Which adapter it went through, as the system names it; None where it has no name or the record does not say."""
    return past.values.get("port_identity") or past.values.get("identity")


def _refuse_nameless(known: Sequence[PastJob], last: PastJob) -> None:
    """Raise JournalMismatch if a later job lost its description, to a power cut say: it may have been the last one."""
    for past in known:
        if past.job > last.job and _sha_of(past) is None and _has_sent(past):
            what = f"of the job {past.job}, later than {last.job}, it is not on record which program it sent"
            remedy = "it may have been this one; use --start-at and the block that the control shows"
            raise JournalMismatch(f"{what}; {remedy}")


def _refuse_other_framing(last: PastJob, values: dict[str, Any], tape: Tape, profile: MachineProfile) -> None:
    """Raise JournalMismatch where the job's bytes lie in other lines than those of today's tape."""
    is_same = values.get("framing", framing_of(profile.tape)) == framing_of(profile.tape)
    is_whole = not isinstance(values.get("restart"), dict)
    if not is_same or (is_whole and values.get("sha256", tape.sha256) != tape.sha256):
        what = f"the stopped job {last.job} was sent with other block ends, leader or trailer than the profile has now"
        remedy = "its bytes lie in other lines; put the profile's [tape] back, or use --start-at"
        raise JournalMismatch(f"{what}; {remedy}")


def _held_at_most(values: dict[str, Any], profile: MachineProfile) -> tuple[Control, int]:
    """The control, and bytes in flight, by the profile of the stopped job or that of now, whichever holds more."""
    now = profile.control
    control = msgspec.structs.replace(
        now,
        receive_buffer_bytes=max(now.receive_buffer_bytes, int(values.get("receive_buffer_bytes", 0))),
        lookahead_blocks=max(now.lookahead_blocks, int(values.get("lookahead_blocks", 0))),
    )
    told_bytes = max(int(values.get(key, 0)) for key in ("beyond_recall_bytes", "inflight_max_bytes"))
    return control, max(_pace_at_most(values, profile).beyond_recall_bytes, told_bytes)


def _pace_at_most(values: dict[str, Any], profile: MachineProfile) -> Pace:
    """The line's measure by the profile of now, on the way that the stopped job took."""
    if values.get("handshake") == "driver":
        profile = msgspec.structs.replace(profile, link=msgspec.structs.replace(profile.link, handshake="driver"))
    return pace_of(profile, is_networked="://" in str(values.get("port", "")))


def _has_sent(past: PastJob) -> bool:
    """Whether bytes of it may have left; the journal of a job without a record lags behind."""
    return past.values.get("bytes_sent") != 0 or past.outcome in ("INTERRUPTED", "RUNNING")


def _is_through(past: PastJob, port: str) -> bool:
    """Whether a job went through this port: by its name, or by the identity of what bears this name now."""
    if past.values.get("port") == port:
        return True
    if "://" in port:
        return False
    return identity_of_job(past) == identity_of(device_of(port))


def _restarted(past: PastJob) -> str | None:
    restart = past.values.get("restart")
    return restart.get("program_sha256") if isinstance(restart, dict) else None


def _sha_of(past: PastJob) -> str | None:
    sha = past.values.get("program_sha256")
    return sha if isinstance(sha, str) else None
