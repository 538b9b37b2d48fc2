"""Every pair of the transition table happens by what really causes it, and nothing happens to a job that is over (5.1).

The rule-based machine looks for bad orders at random; here each row of PROTOCOL.md is walked once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from dnc import alarms
from dnc.events import Event, JobState, StateChanged
from dnc.handshake import TABLE, Cause
from dnc.sender import Sender
from tests.helpers.line import XOFF, XON, drain, sender_of, tape_of

PROGRAM = b"N1 G1 X1\nN2 X2\nM30\n%\n"
OVER = (JobState.SENT, JobState.ABORTED, JobState.FAULTED)
LATER_S = 1000.0


def in_state(folder: Path, state: JobState) -> Sender:
    """A sender that came to this state at second 0, or as soon as its bytes had left."""
    sender = sender_of(tape_of(folder, PROGRAM, trailer=r"\NUL*40"), hold_timeout_s=900.0)
    if state is JobState.ARMED:
        sender.rules = replace(sender.rules, waits_for_xon=True)
    if state is not JobState.LOADED:
        sender.start(0.0)
    match state:
        case JobState.HELD:
            sender.hear(XOFF, 0.0)
        case JobState.PAUSED:
            sender.pause(0.0)
        case JobState.DRAINING:
            take_up_to(sender, sender.tape.size_bytes)
            sender.tick(0.0)
        case JobState.SENT:
            drain(sender, 0.0)
        case JobState.ABORTED:
            sender.abort(0.0)
        case JobState.FAULTED:
            sender.lost(0.0, "unplugged")
    assert sender.state is state
    return sender


def take_up_to(sender: Sender, offset_bytes: int) -> float:
    """Take without looking around until this many bytes are gone; the time then."""
    now_s = 0.0
    while sender.offset_bytes < offset_bytes:
        sender.take(1000, now_s)
        now_s = max(now_s, sender.next_wake_s) + 1e-9
    return now_s


def start_and_wait(sender: Sender) -> list[Event]:
    sender.rules = replace(sender.rules, waits_for_xon=True)
    return sender.start(LATER_S)


def take_all(sender: Sender) -> list[Event]:
    return sender.tick(take_up_to(sender, sender.tape.size_bytes))


def stop_reading_in_the_trailer(sender: Sender) -> list[Event]:
    sender.hear(XON, 0.0)
    held_s = take_up_to(sender, sender.tape.end.essential_bytes)
    return [*sender.hear(XOFF, held_s), *sender.tick(held_s + 5.0)]


def hold_for_long(sender: Sender) -> list[Event]:
    is_draining = sender.state is JobState.DRAINING
    return sender.still_queued(LATER_S, LATER_S) if is_draining else sender.tick(LATER_S)


WAYS: dict[Cause, Callable[[Sender], list[Event]]] = {
    Cause.START: lambda sender: sender.start(LATER_S),
    Cause.START_AND_WAIT: start_and_wait,
    Cause.START_TIMEOUT: lambda sender: sender.tick(LATER_S),
    Cause.XON: lambda sender: sender.hear(XON, LATER_S),
    Cause.XOFF: lambda sender: sender.hear(XOFF, LATER_S),
    Cause.PAUSE_REACHED: lambda sender: sender.pause(LATER_S),
    Cause.RESUME: lambda sender: sender.resume(LATER_S),
    Cause.RESUME_HELD: lambda sender: [*sender.hear(XOFF, LATER_S), *sender.resume(LATER_S)],
    Cause.ALL_TAKEN: take_all,
    Cause.DRAINED: lambda sender: sender.tick(LATER_S),
    Cause.TRAILER_LEFT: stop_reading_in_the_trailer,
    Cause.HOLD_TIMEOUT: hold_for_long,
    Cause.DISTURBED: lambda sender: sender.disturb(alarms.SLEPT, "9 s", LATER_S),
    Cause.ABORT: lambda sender: sender.abort(LATER_S),
    Cause.CONTROL_RESET: lambda sender: sender.hear(XOFF + b"\x16", LATER_S),
    Cause.CONTROL_ALARM: lambda sender: sender.hear(XOFF + b"\x15", LATER_S),
    Cause.FAULT: lambda sender: sender.fault(alarms.LOOPBACK, "", LATER_S),
    Cause.LOST: lambda sender: sender.lost(LATER_S, "unplugged"),
}
"""All but LOAD: a program is loaded anew by a new sender."""

VIA_HELD = {(JobState.SENDING, Cause.CONTROL_RESET), (JobState.SENDING, Cause.CONTROL_ALARM)}
"""The XOFF that comes before SYN or NAK has already led to HELD."""


def moves(events: list[Event]) -> list[tuple[JobState, str, JobState]]:
    return [(event.old, event.cause, event.new) for event in events if isinstance(event, StateChanged)]


@pytest.mark.parametrize(("state", "cause"), [pair for pair in TABLE if pair[1] in WAYS and pair not in VIA_HELD])
def test_every_pair_of_the_table(tmp_path: Path, state: JobState, cause: Cause) -> None:
    """(5.1)"""
    sender = in_state(tmp_path, state)
    assert moves(WAYS[cause](sender))[-1] == (state, cause.value, TABLE[state, cause])
    assert (sender.state, sender.last_cause) == (TABLE[state, cause], cause)


def test_the_ways_are_all_the_causes() -> None:
    assert set(WAYS) == set(Cause) - {Cause.LOAD}


@pytest.mark.parametrize("state", OVER)
def test_nothing_happens_to_a_job_that_is_over(tmp_path: Path, state: JobState) -> None:
    """(5.1, 5.7) No cause leads out of SENT, ABORTED or FAULTED; no byte follows, nothing is counted or said."""
    sender = in_state(tmp_path, state)
    sent, tally = sender.offset_bytes, replace(sender.tally)
    for cause in set(WAYS) - {Cause.ALL_TAKEN, Cause.TRAILER_LEFT}:
        assert WAYS[cause](sender) == [], cause
        assert sender.take(1000, LATER_S) == b""
    assert (sender.state, sender.offset_bytes, sender.tally) == (state, sent, tally)
