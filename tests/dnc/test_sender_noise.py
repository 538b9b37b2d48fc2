"""What the sender makes of bytes that mean nothing, or not what they should (5.1, 5.3)."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from dnc.events import JobState, Noise
from dnc.pacing import Pace
from tests.helpers.line import XON, alarm_ids, drain, sender_of, states, tape_of

PROGRAM = b"".join(b"N%d G1 X%d\n" % (index * 10, index) for index in range(1, 41)) + b"M30\n%\n"


def test_a_masked_xoff_is_obeyed_counted_and_named_once(tmp_path: Path) -> None:
    """(5.3; fault L6)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    assert alarm_ids(sender.hear(b"\x93", 0.1)) == ["DNC-L6"]
    assert sender.state is JobState.HELD
    sender.hear(XON, 0.2)
    assert alarm_ids(sender.hear(b"\x93", 0.3)) == []
    assert sender.tally.masked_xoff_count == 2


@pytest.mark.parametrize("heard", [b"\x93", b"\x13", b"\xfe\x93"])
def test_an_xoff_that_the_driver_lets_through_pauses(heard: bytes, tmp_path: Path) -> None:
    """(5.3; fault L6) Where the driver should stop and has not, nothing more leaves before the operator says so."""
    sender = sender_of(tape_of(tmp_path, PROGRAM), hears_xoff=False, is_driver_asked=True)
    sender.start(0.0)
    assert alarm_ids(sender.hear(heard, 0.1)) == ["DNC-L6P"]
    assert (sender.state, sender.take(100, 9.0)) == (JobState.PAUSED, b"")


@pytest.mark.parametrize(("told", "state"), [(b"\x16", JobState.ABORTED), (b"\x95", JobState.FAULTED)])
@pytest.mark.parametrize("is_held_first", [True, False])
def test_reset_and_alarm_of_a_control_whose_xoff_the_driver_keeps(
    told: bytes, state: JobState, tmp_path: Path, *, is_held_first: bool
) -> None:
    """(5.3; faults C1, C2) SYN or NAK alone was noise: the job hung in HELD, and cycle start sent the rest of it."""
    sender = sender_of(tape_of(tmp_path, PROGRAM), hears_xoff=False, is_driver_asked=True)
    sender.start(0.0)
    drain(sender, 0.0, until_s=0.05)
    if is_held_first:
        sender.peer_is_ready(False, 0.05)
    events = sender.hear(told, 0.06)
    assert (states(events) != []) == is_held_first
    sender.take(2, 0.07)
    events += sender.peer_is_ready(False, 0.12)
    assert (sender.state, sender.take(100, 9.0)) == (state, b"")
    assert alarm_ids(events) == [{JobState.ABORTED: "DNC-C1", JobState.FAULTED: "DNC-C2"}[state]]
    assert sender.peer_is_ready(True, 1.0) is not None
    assert sender.state is state


def test_a_lone_syn_that_stops_nothing_is_noise(tmp_path: Path) -> None:
    """(faults C1, L14) With the driver's handshake: bytes left after it, so no XOFF came before it."""
    sender = sender_of(tape_of(tmp_path, PROGRAM), hears_xoff=False, is_driver_asked=True)
    sender.start(0.0)
    drain(sender, 0.0, until_s=0.05)
    assert alarm_ids(sender.hear(b"\x16", 0.06)) == []
    drain(sender, 0.06, until_s=0.1)
    assert alarm_ids(sender.peer_is_ready(False, 0.2)) == []
    assert (sender.state, sender.tally.noise_bytes) == (JobState.HELD, 1)


FIFO = Pace(byte_s=0.001, inflight_max_bytes=3, lag_s=0.0, slack=0.0, unseen_bytes=100)


@pytest.mark.parametrize("told", [b"\x16", b"\x15"])
@pytest.mark.parametrize(("behind_s", "state"), [(0.09, JobState.PAUSED), (0.12, JobState.HELD)])
def test_syn_and_nak_behind_which_an_adapter_took_more(
    behind_s: float, state: JobState, told: bytes, tmp_path: Path
) -> None:
    """(5.3; faults C1, C2, A7) It stopped, took 90 bytes more, and the job hung in HELD without a word for ever."""
    sender = sender_of(tape_of(tmp_path, PROGRAM), FIFO, hears_xoff=False, is_driver_asked=True)
    sender.start(0.0)
    drain(sender, 0.0, until_s=0.05)
    assert alarm_ids(sender.hear(told, 0.05)) == []
    drain(sender, 0.05, until_s=0.05 + behind_s)
    events = sender.peer_is_ready(False, 0.2)
    assert (sender.state, alarm_ids(events)) == (state, ["DNC-C1P"] if state is JobState.PAUSED else [])
    sender.peer_is_ready(True, 1.0)
    assert sender.state is {JobState.HELD: JobState.SENDING}.get(state, state)


@pytest.mark.parametrize(("told", "state"), [(b"\x16", JobState.ABORTED), (b"\x15", JobState.FAULTED)])
@pytest.mark.parametrize("is_held_last", [True, False])
def test_no_job_is_sent_whose_end_an_adapter_may_hold_back(
    told: bytes, state: JobState, tmp_path: Path, *, is_held_last: bool
) -> None:
    """(5.3; faults C1, C2, A7) Reset within the last bytes, it was SENT, and the next job came behind the old end."""
    for behind_bytes, ended in ((90, state), (120, JobState.SENT)):
        sender = sender_of(tape_of(tmp_path, PROGRAM), FIFO, hears_xoff=False, is_driver_asked=True)
        sender.start(0.0)
        _, now_s = drain(sender, 0.0, until_s=(len(PROGRAM) - behind_bytes) * FIFO.byte_s)
        assert alarm_ids(sender.hear(told, now_s)) == []
        while sender.state is JobState.SENDING:
            now_s = max(now_s, sender.next_wake_s) + 1e-9
            sender.take(99, now_s)
            sender.tick(now_s)
        assert sender.state is JobState.DRAINING
        if is_held_last:
            sender.peer_is_ready(False, now_s)
        sender.tick(now_s + 1.0)
        assert sender.state is ended


@pytest.mark.parametrize("is_driver_asked", [True, False])
def test_reset_is_heard_where_xoff_is_not(tmp_path: Path, *, is_driver_asked: bool) -> None:
    """(5.3; fault C1) With a modem line, without a handshake, or past a driver that lets XOFF through."""
    sender = sender_of(tape_of(tmp_path, PROGRAM), hears_xoff=False, is_driver_asked=is_driver_asked)
    sender.start(0.0)
    assert sender.hear(b"", 0.1) == []
    assert alarm_ids(sender.hear(b"\x13\x16", 0.1)) == ["DNC-C1"]
    assert sender.state is JobState.ABORTED


def test_other_bytes_do_not_start_an_armed_job(tmp_path: Path) -> None:
    """(fault L7)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM), waits_for_xon=True)
    sender.start(0.0)
    assert alarm_ids(sender.hear(b"\xfe\x00\x81" * 3, 0.5)) == []
    assert alarm_ids(sender.hear(b"\xfe", 0.6)) == ["DNC-L14"]
    assert (sender.state, sender.tally.noise_bytes) == (JobState.ARMED, 10)
    assert sender.take(1000, 0.7) == b""


def test_own_bytes_coming_back_are_a_loopback(tmp_path: Path) -> None:
    """(fault L12)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    out, now_s = drain(sender, 0.0, until_s=0.05)
    events = [event for byte in out[:12] for event in sender.hear(bytes([byte]), now_s)]
    assert alarm_ids(events) == ["DNC-L12"]
    assert sender.state is JobState.FAULTED


def test_noise_is_counted_then_shown_then_pauses(tmp_path: Path) -> None:
    """(fault L14)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    events = [event for index in range(99) for event in sender.hear(bytes([0x80 + index % 7]), index * 0.1)]
    assert alarm_ids(events) == ["DNC-L14"]
    assert sum(isinstance(event, Noise) for event in events) == 99
    assert sender.state is JobState.SENDING
    assert alarm_ids(sender.hear(b"\x80", 9.95)) == ["DNC-L14P"]
    assert sender.state is JobState.PAUSED
    assert alarm_ids(sender.hear(b"\x80" * 300, 10.0)) == []
    assert sender.tally.noise_bytes == 400
    sender.resume(20.0)
    assert sender.state is JobState.SENDING


def test_noise_before_the_first_xon_does_not_hide_noise_after_it(tmp_path: Path) -> None:
    """(faults L7, L14) Garbage while ARMED stops nothing, so its limit counts anew once bytes leave."""
    sender = sender_of(tape_of(tmp_path, PROGRAM), waits_for_xon=True)
    sender.start(0.0)
    assert alarm_ids(sender.hear(b"\x80\x81" * 60, 1.0)) == ["DNC-L14P"]
    assert sender.state is JobState.ARMED
    sender.hear(XON, 2.0)
    assert alarm_ids(sender.hear(b"\x80\x81" * 60, 3.0)) == ["DNC-L14P"]
    assert sender.state is JobState.PAUSED


def test_a_little_noise_over_hours_is_no_alarm(tmp_path: Path) -> None:
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    events = [event for index in range(500) for event in sender.hear(b"\x80", index * 30.0)]
    assert alarm_ids(events) == []


def test_a_broken_line_pauses(tmp_path: Path) -> None:
    """(fault L13)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    assert alarm_ids(sender.hear(b"\0" * 12, 0.1)) == ["DNC-L13"]
    assert sender.state is JobState.PAUSED


def test_xon_without_xoff_is_counted_and_warned_of(tmp_path: Path) -> None:
    """(fault L4)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    events = [event for index in range(25) for event in sender.hear(XON, index * 1.0)]
    assert alarm_ids(events) == ["DNC-L4"]
    assert sender.tally.unasked_xon_count == 25


def test_noise_without_end_costs_no_time(tmp_path: Path) -> None:
    """(5.2; fault L14) A control that talks and talks into a paused job: the loop has real-time priority."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    begun_s = time.process_time()
    for index in range(2_000):
        sender.hear(b"Z", index * 1e-4)
    early_s = time.process_time() - begun_s
    for index in range(2_000, 20_000):
        sender.hear(b"Z", index * 1e-4)
    begun_s = time.process_time()
    for index in range(20_000, 22_000):
        sender.hear(b"Z", index * 1e-4)
    assert time.process_time() - begun_s < 5 * early_s
    assert (sender.state, sender.tally.noise_bytes) == (JobState.PAUSED, 22_000)


def test_a_block_that_an_alarm_may_have_torn_is_cut(tmp_path: Path) -> None:
    """(5.7; faults C2, L3) Sent whole, but the buffer may have run over inside it; a reset forgets what it held."""
    for told, may_be_cut in ((b"\x13\x15", True), (b"\x13\x16", False)):
        sender = sender_of(tape_of(tmp_path, PROGRAM))
        sender.start(0.0)
        drain(sender, 0.0, until_s=0.05)
        sender.pause(0.05)
        drain(sender, 0.05, until_s=0.1)
        assert (sender.state, sender.may_be_cut) == (JobState.PAUSED, False)
        sender.hear(told, 1.0)
        assert (sender.is_over, sender.is_cut, sender.may_be_cut) == (True, False, may_be_cut)


def test_noise_stops_a_job_again_after_the_operator_has_resumed_it(tmp_path: Path) -> None:
    """(5.3; fault L14) He has looked, once: as much noise again is as much reason to stop as the first time."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    for at_s in (1.0, 2.0):
        events = [event for number in range(100) for event in sender.hear(b"ab"[number % 2 :][:1], at_s)]
        assert alarm_ids(events) == ["DNC-L14", "DNC-L14P"]
        assert sender.state is JobState.PAUSED
        sender.resume(at_s + 0.5)
        assert sender.state is JobState.SENDING


def test_a_leader_thrown_out_of_the_queue_cuts_no_block(tmp_path: Path) -> None:
    """(5.4, 5.7) NULs alone left: the next program begins behind nothing."""
    for sent_bytes, may_be_cut in ((20, False), (32, True)):
        sender = sender_of(tape_of(tmp_path, PROGRAM, leader="\\NUL*30"))
        sender.start(0.0)
        for at_s in range(sent_bytes):
            sender.take(min(1, sent_bytes - sender.offset_bytes), float(at_s))
        sender.abort(99.0)
        sender.thrown_away(10, 99.0)
        assert (sender.offset_bytes, sender.may_be_cut) == (sent_bytes, may_be_cut)
