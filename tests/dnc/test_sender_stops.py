"""Where a job stops: at the end of a block, at once, or behind the end of the program (5.1, 5.4, 5.7)."""

from __future__ import annotations

from pathlib import Path

import pytest

from dnc import alarms
from dnc.events import JobState
from dnc.handshake import Cause
from dnc.pacing import Pace
from dnc.profile import Control
from dnc.record import in_doubt
from tests.helpers.line import XOFF, XON, alarm_ids, drain, sender_of, states, tape_of

PROGRAM = b"".join(b"N%d G1 X%d\n" % (index * 10, index) for index in range(1, 41)) + b"M30\n%\n"


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


def test_a_pause_before_the_first_xon_sends_nothing(tmp_path: Path) -> None:
    """(5.4, 5.7) It was answered with ok and forgotten: the job began when the XON came."""
    sender = sender_of(tape_of(tmp_path, PROGRAM), waits_for_xon=True)
    sender.start(0.0)
    assert sender.pause(1.0) == []
    assert sender.is_pausing
    sender.hear(XON, 2.0)
    assert sender.take(1000, 2.0) == b""
    assert states(sender.tick(2.0)) == [JobState.PAUSED]
    assert states(sender.resume(3.0)) == [JobState.SENDING]
    assert drain(sender, 3.0)[0] == PROGRAM


def test_the_trailer_holds_no_block(tmp_path: Path) -> None:
    """(5.4, 5.7) A pause there stops at once, and an abort cuts nothing."""
    sender = sender_of(tape_of(tmp_path, PROGRAM, trailer="\\NUL*200"))
    sender.start(0.0)
    _, now_s = drain(sender, 0.0, until_s=len(PROGRAM) * 0.001 + 0.05)
    assert len(PROGRAM) < sender.offset_bytes < sender.tape.size_bytes
    assert not sender.is_cut
    assert states(sender.pause(now_s)) == [JobState.PAUSED]
    doubt = in_doubt(sender.tape, sender.offset_bytes, 0, Control())
    assert doubt is not None
    assert doubt.last == PROGRAM.count(b"\n")


def test_a_control_that_stops_at_m30_is_not_a_hold_timeout(tmp_path: Path) -> None:
    """(5.4) --hold-timeout 1 came before the 2 s that a trailer is offered for: FAULTED, exit 5, where all was sent."""
    sender = sender_of(tape_of(tmp_path, PROGRAM, trailer="\\NUL*200"), hold_timeout_s=1.0)
    sender.start(0.0)
    _, now_s = drain(sender, 0.0, until_s=len(PROGRAM) * 0.001 + 0.05)
    sender.hear(XOFF, now_s)
    assert states(sender.tick(now_s + 1.5)) == [JobState.SENT]


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
    assert states(sender.hear(XON, 3.0)) == [JobState.SENDING]
    sender.hear(XOFF, 4.0)
    sender.pause(4.0)
    sender.hear(XON, 5.0)
    assert states(sender.resume(6.0)) == [JobState.SENDING]


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


def test_a_disturbance_pauses_and_a_loss_is_final(tmp_path: Path) -> None:
    """(5.4, 5.5; faults A1, A5, H5)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    assert alarm_ids(sender.disturb(alarms.FOREIGN_SETTINGS, "format", 0.1)) == ["DNC-A5"]
    assert sender.state is JobState.PAUSED
    assert alarm_ids(sender.lost(0.2, "unplugged")) == ["DNC-A1"]
    assert (sender.state, sender.last_cause) == (JobState.FAULTED, Cause.LOST)
    assert sender.lost(0.3, "again") == []


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
    left_bytes = len(PROGRAM) + 40 - sender.offset_bytes
    assert f"; {left_bytes} bytes of trailer not taken" in sender.note


def test_a_resume_takes_a_pause_back(tmp_path: Path) -> None:
    """(5.7) Asked for in the middle of a block and taken back before its end: nothing stops."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    _, now_s = drain(sender, 0.0, until_s=0.05)
    sender.pause(now_s)
    assert sender.is_pausing
    sender.resume(now_s)
    assert not sender.is_pausing
    drain(sender, now_s)
    assert sender.state is JobState.SENT


def test_an_xoff_at_the_end_of_the_block_does_not_undo_a_pause(tmp_path: Path) -> None:
    """(5.7) The block's last byte has left, then the control holds: the job is paused, not held."""
    sender = sender_of(tape_of(tmp_path, PROGRAM), Pace(0.001, 64, 0.0, slack=0.0))
    sender.start(0.0)
    sender.take(3, 0.0)
    sender.pause(0.0)
    sender.take(1000, 1.0)
    assert not sender.is_cut
    assert states(sender.hear(XOFF, 1.0)) == [JobState.HELD]
    assert states(sender.tick(1.0)) == [JobState.PAUSED]
    assert not sender.is_pausing


def test_a_disturbance_ends_a_pause_that_was_asked_for(tmp_path: Path) -> None:
    """(5.7) Stopped in the middle of the block: nobody shows that it still waits for the block's end."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    _, now_s = drain(sender, 0.0, until_s=0.05)
    sender.pause(now_s)
    sender.disturb(alarms.SLEPT, "9 s", now_s)
    assert (sender.state, sender.is_cut, sender.is_pausing) == (JobState.PAUSED, True, False)


@pytest.mark.parametrize("inflight", range(2, 13))
def test_no_write_ends_within_the_end(tmp_path: Path, inflight: int) -> None:
    """(5.4) However late the host looks, the last block's end and the closing % are in one write."""
    tape = tape_of(tmp_path, PROGRAM)
    assert tape.end.whole_to - tape.end.whole_from == 2
    for late_s in (0.0001, 0.002, 0.003, 0.005, 0.007, 0.011):
        sender = sender_of(tape, Pace(0.001, inflight, 0.0, slack=0.0))
        sender.start(0.0)
        now_s, borders = 0.0, []
        while sender.offset_bytes < len(PROGRAM):
            sender.take(1000, now_s)
            borders.append(sender.offset_bytes)
            now_s += late_s
        assert tape.end.whole_from + 1 not in borders


@pytest.mark.parametrize("end", [b"\n\n%\n", b"\n\n\n  %\n"])
def test_blank_lines_before_the_closing_percent_go_with_the_last_block(tmp_path: Path, end: bytes) -> None:
    """(5.4) The end is longer than what may be in flight: it leaves in one write, once the line is empty."""
    sender = sender_of(tape_of(tmp_path, b"G1 X1\nM30" + end), Pace(0.001, 2, 0.0, slack=0.0))
    sender.start(0.0)
    now_s, free_s, chunks = 0.0, 0.0, []
    while not sender.is_over:
        chunks.append(sender.take(1000, now_s))
        if len(chunks[-1]) > 2:
            assert free_s <= now_s
        free_s = max(free_s, now_s) + 0.001 * len(chunks[-1])
        sender.tick(now_s)
        now_s = max(now_s, sender.next_wake_s) + 1e-9
    assert end[:-1] in chunks
    assert b"".join(chunks) == b"G1 X1\nM30" + end


@pytest.mark.parametrize("at", range(6, 10))
def test_a_pause_in_the_last_block_falls_behind_the_closing_percent(tmp_path: Path, at: int) -> None:
    """(5.4, 5.7) The last block's end and the % are one: the pause comes, and what follows it goes on at resume."""
    sender = sender_of(tape_of(tmp_path, b"G1 X1\nM30\n%\n"))
    sender.start(0.0)
    now_s = 0.0
    while sender.offset_bytes < at:
        sender.take(1, now_s)
        now_s += 0.001
    sender.pause(now_s)
    _, now_s = drain(sender, now_s, until_s=now_s + 1.0)
    assert (sender.state, sender.is_cut) == (JobState.PAUSED, False)
    assert sender.offset_bytes == (6 if at == 6 else 11)
    sender.resume(now_s)
    drain(sender, now_s)
    assert sender.state is JobState.SENT


def test_a_small_room_does_not_tear_the_end(tmp_path: Path) -> None:
    """(5.4) The last block's end waits until the closing % has room with it."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    now_s = 0.0
    while sender.offset_bytes < sender.tape.end.whole_from:
        sender.take(1000, now_s)
        now_s += 0.001
    assert sender.take(1, now_s + 1.0) == b""
    assert sender.take(2, now_s + 1.0) == b"\n%"


@pytest.mark.parametrize(
    ("short_of_bytes", "later_s", "state"),
    [(0, 0.0, JobState.FAULTED), (0, 0.1, JobState.SENT), (1, 5.0, JobState.FAULTED)],
)
def test_a_port_lost_behind_the_end_is_no_fault(
    tmp_path: Path, short_of_bytes: int, later_s: float, state: JobState
) -> None:
    """(5.4; faults A1, C5) Held in the trailer with everything essential off the line, else FAULTED."""
    tape = tape_of(tmp_path, b"G1\nM30\n", trailer=r"\NUL*40")
    sender = sender_of(tape, Pace(0.001, 64, 0.0, slack=0.0))
    sender.start(0.0)
    sender.take(6, 0.0)
    sender.take(1 - short_of_bytes, 0.0)
    sender.hear(XOFF, 0.001)
    assert sender.offset_bytes == tape.end.essential_bytes - short_of_bytes
    assert sender.tick(later_s) == [] or state is JobState.SENT
    sender.lost(later_s, "hang-up")
    assert sender.state is state
    assert bool(sender.note) == (state is JobState.SENT)
