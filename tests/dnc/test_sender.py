"""The sender under a clock that the test turns: start, hold, pause, stop, end (5.1, 5.3, 5.4, 5.7)."""

from __future__ import annotations

from pathlib import Path

import pytest

from dnc import alarms
from dnc.events import Held, JobState, Noise, Resumed
from dnc.handshake import Cause
from dnc.pacing import Pace
from tests.helpers.line import XOFF, XON, alarm_ids, drain, sender_of, states, tape_of

PROGRAM = b"".join(b"N%d G1 X%d\n" % (index * 10, index) for index in range(1, 41)) + b"M30\n%\n"


def test_sends_the_whole_tape_and_ends_as_sent(tmp_path: Path) -> None:
    """(5.1)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    assert states(sender.start(0.0)) == [JobState.SENDING]
    out, now_s = drain(sender, 0.0)
    assert out == PROGRAM
    assert sender.state is JobState.SENT
    assert now_s == pytest.approx(len(PROGRAM) * 0.001, abs=1e-3)
    assert sender.tally.utilisation(now_s) == pytest.approx(1.0, abs=0.01)


def test_never_more_than_the_bound_at_once(tmp_path: Path) -> None:
    """(5.2)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    assert len(sender.take(1000, 0.0)) == 3
    assert sender.take(1000, 0.0) == b""
    assert len(sender.take(1000, 0.001)) == 1


def test_held_and_resumed(tmp_path: Path) -> None:
    """(5.1) XOFF stops at once and says how much is beyond recall; XON goes on with the next byte."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    first = sender.take(1000, 0.0)
    held = sender.hear(XOFF, 0.0005)
    assert next(event for event in held if isinstance(event, Held)).inflight_bytes == 3
    assert sender.state is JobState.HELD
    assert sender.take(1000, 1.0) == b""
    resumed = sender.hear(XON, 2.0)
    assert next(event for event in resumed if isinstance(event, Resumed)).held_s == pytest.approx(1.9995)
    out, _ = drain(sender, 2.0)
    assert first + out == PROGRAM
    assert sender.tally.held_s == pytest.approx(1.9995)


def test_utilisation_counts_neither_holds_nor_pauses(tmp_path: Path) -> None:
    """(5.2)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    drain(sender, 0.0, until_s=0.1)
    sender.hear(XOFF, 0.1)
    sender.hear(XON, 10.0)
    drain(sender, 10.0)
    assert sender.tally.utilisation(11.0) > 0.97


def test_a_masked_xoff_is_obeyed_counted_and_named_once(tmp_path: Path) -> None:
    """(5.3; fault L6)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    assert alarm_ids(sender.hear(b"\x93", 0.1)) == ["DNC-L6"]
    assert sender.state is JobState.HELD
    sender.hear(XON, 0.2)
    assert alarm_ids(sender.hear(b"\x93", 0.3)) == []
    assert sender.tally.masked_xoff_count == 2


def test_repeated_xoff_does_not_restart_the_hold(tmp_path: Path) -> None:
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    sender.hear(XOFF, 0.1)
    sender.hear(XOFF, 5.0)
    sender.hear(XON, 6.0)
    assert sender.tally.held_s == pytest.approx(5.9)
    assert (sender.tally.xoff_count, sender.tally.repeated_xoff_count) == (1, 1)


def test_pause_reaches_the_block_end_and_resume_goes_on(tmp_path: Path) -> None:
    """(5.7; invariant I3)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    out, now_s = drain(sender, 0.0, until_s=0.05)
    assert not out.endswith(b"\n")
    sender.pause(now_s)
    more, now_s = drain(sender, now_s)
    assert sender.state is JobState.PAUSED
    assert (out + more).endswith(b"\n")
    assert more.count(b"\n") == 1
    assert sender.take(1000, now_s + 100) == b""
    assert states(sender.resume(now_s + 100)) == [JobState.SENDING]
    assert out + more + drain(sender, now_s + 100)[0] == PROGRAM


@pytest.mark.parametrize("inflight", [1, 9, 64])
def test_a_pause_never_runs_past_the_block(tmp_path: Path, inflight: int) -> None:
    """(5.7; invariant I3) Whatever a write could take."""
    sender = sender_of(tape_of(tmp_path, PROGRAM), Pace(0.001, inflight, 0.0, slack=0.0))
    sender.start(0.0)
    out, now_s = drain(sender, 0.0, until_s=0.1)
    sender.pause(now_s + 1.0)
    more, _ = drain(sender, now_s + 1.0)
    assert sender.state is JobState.PAUSED
    assert (out + more).endswith(b"\n")
    assert more.count(b"\n") <= 1


def test_pause_while_held_in_a_block_waits_for_its_end(tmp_path: Path) -> None:
    """(5.7) The pause holds even when XON comes."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    out, _ = drain(sender, 0.0, until_s=0.05)
    sender.hear(XOFF, 0.05)
    sender.pause(0.06)
    assert sender.state is JobState.HELD
    assert sender.is_pausing
    sender.hear(XON, 1.0)
    more, _ = drain(sender, 1.0)
    assert sender.state is JobState.PAUSED
    assert (out + more).endswith(b"\n")


def test_xon_during_a_pause_resumes_nothing(tmp_path: Path) -> None:
    """(5.7; fault C9) Not even the control's power-on XON."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    sender.hear(XOFF, 0.0)
    sender.pause(0.0)
    assert sender.state is JobState.PAUSED
    sender.hear(XON + XON, 1.0)
    assert sender.state is JobState.PAUSED
    sender.hear(XOFF, 2.0)
    assert states(sender.resume(3.0)) == [JobState.HELD]


def test_wait_xon_and_its_timeout(tmp_path: Path) -> None:
    """(5.4; fault C3)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM), waits_for_xon=True, start_timeout_s=5.0)
    assert states(sender.start(0.0)) == [JobState.ARMED]
    assert sender.take(100, 1.0) == b""
    assert sender.next_wake_s == 5.0
    events = sender.tick(5.0)
    assert alarm_ids(events) == ["DNC-C3"]
    assert sender.state is JobState.LOADED


def test_an_early_xon_is_remembered_but_not_acted_on(tmp_path: Path) -> None:
    """(fault C4)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM), waits_for_xon=True)
    sender.hear(XON, 0.0)
    assert sender.state is JobState.LOADED
    sender.start(1.0)
    assert sender.state is JobState.SENDING


def test_other_bytes_do_not_start_an_armed_job(tmp_path: Path) -> None:
    """(fault L7)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM), waits_for_xon=True)
    sender.start(0.0)
    sender.hear(b"\xfe\x00\x81", 0.5)
    assert sender.state is JobState.ARMED


def test_hold_timeout_only_when_set(tmp_path: Path) -> None:
    """(1.3; fault L1)"""
    patient = sender_of(tape_of(tmp_path, PROGRAM))
    patient.start(0.0)
    patient.hear(XOFF, 0.0)
    assert alarm_ids(patient.tick(121.0)) == ["DNC-L1"]
    assert patient.tick(1e6) == []
    assert patient.state is JobState.HELD
    strict = sender_of(tape_of(tmp_path, PROGRAM), hold_timeout_s=2.0)
    strict.start(0.0)
    strict.hear(XOFF, 0.0)
    assert strict.next_wake_s == 2.0
    assert alarm_ids(strict.tick(2.0)) == ["DNC-L1T"]
    assert strict.state is JobState.FAULTED


@pytest.mark.parametrize(
    ("said", "state", "alarm"),
    [(b"\x13\x16", JobState.ABORTED, "DNC-C1"), (b"\x13\x15", JobState.FAULTED, "DNC-C2")],
)
def test_reset_and_alarm_of_the_control(tmp_path: Path, said: bytes, state: JobState, alarm: str) -> None:
    """(faults C1, C2)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    assert alarm_ids(sender.hear(said, 0.1)) == [alarm]
    assert sender.state is state
    assert sender.resume(1.0) == []
    assert sender.hear(XON, 2.0) == []
    assert sender.take(1000, 3.0) == b""


def test_abort_stops_at_once_and_knows_whether_a_block_is_cut(tmp_path: Path) -> None:
    """(5.7)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    drain(sender, 0.0, until_s=0.05)
    assert states(sender.abort(0.05)) == [JobState.ABORTED]
    assert sender.is_cut
    assert sender.take(1000, 1.0) == b""


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
    sender.resume(20.0)
    assert sender.state is JobState.SENDING


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


def test_the_closing_percent_leaves_with_the_last_block_end(tmp_path: Path) -> None:
    """(5.4)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    now_s, chunks = 0.0, []
    while sender.offset_bytes < len(PROGRAM):
        chunks.append(sender.take(1000, now_s))
        now_s = max(now_s, sender.next_wake_s) + 1e-9
    assert chunks[-2:] == [b"\n%", b"\n"]


def test_m30_that_stops_reading_ends_as_sent_with_a_note(tmp_path: Path) -> None:
    """(5.4; fault C5)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM, trailer=r"\NUL*40"))
    sender.start(0.0)
    drain(sender, 0.0, until_s=(len(PROGRAM) + 3) * 0.001)
    now_s = (len(PROGRAM) + 3) * 0.001
    sender.hear(XOFF, now_s)
    assert sender.next_wake_s == pytest.approx(now_s + 2.0)
    sender.tick(now_s + 2.0)
    assert sender.state is JobState.SENT
    assert "trailer not taken" in sender.note


def test_bytes_given_back_are_taken_again(tmp_path: Path) -> None:
    """(5.5) A partial write loses and repeats nothing."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    chunk = sender.take(1000, 0.0)
    sender.give_back(2)
    out, _ = drain(sender, 0.0)
    assert chunk[:1] + out == PROGRAM
    assert sender.tally.bytes_sent == len(PROGRAM)


def test_a_modem_line_holds_like_xoff_and_bytes_are_noise(tmp_path: Path) -> None:
    """(5.3) RTS/CTS, DTR/DSR: the line holds; XOFF as a byte means nothing there."""
    sender = sender_of(tape_of(tmp_path, PROGRAM), hears_xoff=False)
    sender.start(0.0)
    sender.hear(XOFF, 0.0)
    assert sender.state is JobState.SENDING
    sender.peer_is_ready(False, 0.1)
    assert sender.state is JobState.HELD
    assert sender.peer_is_ready(False, 0.2) == []
    sender.peer_is_ready(True, 0.3)
    assert sender.state is JobState.SENDING


def test_line_delay_follows_every_block(tmp_path: Path) -> None:
    """(5.3)"""
    pace = Pace(0.001, 3, 0.0, slack=0.0, line_delay_s=0.1)
    sender = sender_of(tape_of(tmp_path, b"G1\n" * 10), pace)
    sender.start(0.0)
    _, now_s = drain(sender, 0.0)
    assert now_s == pytest.approx(10 * 0.1 + 30 * 0.001, rel=0.02)


def test_a_disturbance_pauses_and_a_loss_is_final(tmp_path: Path) -> None:
    """(5.4, 5.5; faults A1, A5, H5)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    assert alarm_ids(sender.disturb(alarms.FOREIGN_SETTINGS, "format", 0.1)) == ["DNC-A5"]
    assert sender.state is JobState.PAUSED
    assert alarm_ids(sender.lost(0.2, "unplugged")) == ["DNC-A1"]
    assert (sender.state, sender.last_cause) == (JobState.FAULTED, Cause.LOST)
    assert sender.lost(0.3, "again") == []
