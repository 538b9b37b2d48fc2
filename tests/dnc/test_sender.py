"""The sender under a clock that the test turns: start, pace, hold, resume (5.1 to 5.4)."""

from __future__ import annotations

from pathlib import Path

import pytest

from dnc import alarms
from dnc.events import Held, JobState, Resumed
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


def test_the_answer_to_an_xon_is_known_beforehand(tmp_path: Path) -> None:
    """(5.2) Once the line is empty; it counts as sent with the XON, and no more than the bound is in flight."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    first = sender.take(1000, 0.0)
    assert sender.answer(1000, 0.001) == b"", "nothing while it sends"
    sender.hear(XOFF, 0.001)
    assert sender.answer(1000, 0.002) == b"", "bytes are still in flight"
    answer = sender.answer(1000, 0.1)
    assert (answer, sender.answer(2, 0.1), sender.answer(0, 0.1)) == (PROGRAM[3:6], PROGRAM[3:5], b"")
    assert states(sender.answered(XON, answer, 0.2)) == [JobState.SENDING]
    assert sender.take(1000, 0.2) == b""
    out, _ = drain(sender, 0.2)
    assert first + answer + out == PROGRAM


def test_no_answer_is_known_where_more_than_an_xon_is_missing(tmp_path: Path) -> None:
    """(5.2, 5.7) A pause that was asked for, the end that leaves whole, a handshake without XON."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    sender.take(1000, 0.0)
    sender.hear(XOFF, 0.001)
    sender.pause(0.1)
    assert sender.answer(1000, 0.2) == b""
    assert not sender.is_one_xon_away
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    drain(sender, 0.0, until_s=(sender.tape.end.whole_from - 4) * 0.001)
    sender.hear(XOFF, 1.0)
    assert sender.offset_bytes + len(sender.answer(1000, 2.0)) == sender.tape.end.whole_from
    deaf = sender_of(tape_of(tmp_path, PROGRAM), hears_xoff=False)
    deaf.start(0.0)
    deaf.peer_is_ready(False, 0.1)
    assert deaf.answer(1000, 0.2) == b""


def test_utilisation_counts_neither_holds_nor_pauses(tmp_path: Path) -> None:
    """(5.2)"""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    drain(sender, 0.0, until_s=0.1)
    sender.hear(XOFF, 0.1)
    sender.hear(XON, 10.0)
    drain(sender, 10.0)
    assert sender.tally.utilisation(11.0) > 0.97


def test_repeated_xoff_does_not_restart_the_hold(tmp_path: Path) -> None:
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    sender.hear(XOFF, 0.1)
    sender.hear(XOFF, 5.0)
    sender.hear(XON, 6.0)
    assert sender.tally.held_s == pytest.approx(5.9)
    assert sender.tally.xoff_count == 1


def test_a_control_that_held_before_the_start_is_waited_for(tmp_path: Path) -> None:
    """(5.1, 5.7) The start is the operator's, the first byte the control's."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.hear(XOFF, 0.0)
    assert states(sender.start(1.0)) == [JobState.SENDING, JobState.HELD]
    assert sender.take(1000, 1.0) == b""


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
    assert sender.take(1000, 0.5) == b""
    sender.start(1.0)
    assert sender.state is JobState.SENDING


def test_an_xoff_after_an_early_xon_counts(tmp_path: Path) -> None:
    """(5.1; fault C4) The last word before the start holds: the job waits for another XON."""
    sender = sender_of(tape_of(tmp_path, PROGRAM), waits_for_xon=True)
    sender.hear(XON + XOFF, 0.0)
    sender.start(1.0)
    assert (sender.state, sender.take(1000, 1.0)) == (JobState.ARMED, b"")
    sender.hear(XON, 2.0)
    assert sender.state is JobState.SENDING


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


def test_bytes_given_back_are_taken_again(tmp_path: Path) -> None:
    """(5.5) A partial write loses and repeats nothing."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    chunk = sender.take(1000, 0.0)
    sender.give_back(2)
    again = sender.take(1000, 0.0)
    assert again == chunk[1:]
    out, _ = drain(sender, 0.0)
    assert chunk[:1] + again + out == PROGRAM
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


@pytest.mark.parametrize("inflight", [1, 2, 3, 12, 64])
@pytest.mark.parametrize("block_end", ["lf", "crlf", "lfcrcr"])
def test_a_line_delay_stands_directly_behind_each_block_end(tmp_path: Path, inflight: int, block_end: str) -> None:
    """(5.3) Nothing of the next block leaves with the end of one, and short blocks get a delay each."""
    tape = tape_of(tmp_path, b"N1 G1 X1\nN2\nN3\nN4 G1 X2\nM30\n%\n", end_of_block=block_end)
    sender = sender_of(tape, Pace(0.001, inflight, 0.0, slack=0.0, line_delay_s=0.1))
    sender.start(0.0)
    now_s, ends = 0.0, 0
    while sender.state is JobState.SENDING:
        chunk = sender.take(1000, now_s)
        if tape.block_end in chunk and sender.offset_bytes < tape.end.essential_bytes:
            assert (chunk.count(tape.block_end), chunk.endswith(tape.block_end)) == (1, True)
        if chunk and tape.is_block_end(sender.offset_bytes):
            ends += sender.offset_bytes <= tape.end.whole_to
            assert sender.clock.idle_at_s >= now_s + 0.1
        sender.tick(now_s)
        now_s = max(now_s, sender.next_wake_s) + 1e-9
    assert ends == 5


def test_sent_is_said_when_the_last_byte_has_left_the_line(tmp_path: Path) -> None:
    """(5.1) DRAINING until then."""
    sender = sender_of(tape_of(tmp_path, b"G1\nM30\n"), Pace(0.001, 64, 0.0, slack=0.0))
    sender.start(0.0)
    assert sender.take(1000, 0.0) == b"G1\nM30\n"
    assert states(sender.tick(0.0)) == [JobState.DRAINING]
    assert sender.next_wake_s == pytest.approx(0.007)
    assert sender.tick(0.0069) == []
    assert states(sender.tick(0.0071)) == [JobState.SENT]


def test_every_event_says_when_and_where(tmp_path: Path) -> None:
    """(5.1, 5.7) The log is read by time and by byte: neither stands in the other's place."""
    sender = sender_of(tape_of(tmp_path, PROGRAM), hold_warning_s=30.0)
    sender.start(0.0)
    assert len(sender.take(3, 0.0)) == 3
    spoken = [(0.5, sender.hear(XOFF, 0.5)), (40.0, sender.tick(40.0)), (41.0, sender.hear(b"?", 41.0))]
    spoken += [(42.0, sender.hear(XON, 42.0)), (43.0, sender.disturb(alarms.SLEPT, "9 s", 43.0))]
    assert [len(events) for _, events in spoken] == [2, 1, 1, 2, 2]
    for at_s, events in spoken:
        assert {(event.time_s, event.offset_bytes) for event in events} == {(at_s, 3)}


@pytest.mark.parametrize(("blank_bytes", "most_bytes"), [(10, 12), (11, 3), (100, 3)])
def test_an_end_longer_than_the_reserve_leaves_in_pieces(tmp_path: Path, blank_bytes: int, most_bytes: int) -> None:
    """(5.2, 5.4) Blank lines before the closing %: whole, they would run over what the control keeps free."""
    data = PROGRAM[:-2] + b"\n" * blank_bytes + b"%\n"
    sender = sender_of(tape_of(tmp_path, data))
    end = sender.tape.end
    assert end.whole_to - end.whole_from == blank_bytes + 2
    sender.start(0.0)
    now_s, chunks = 0.0, []
    while sender.offset_bytes < len(data):
        chunks.append(sender.take(1000, now_s))
        now_s = max(now_s, sender.next_wake_s) + 1e-9
    assert b"".join(chunks) == data
    assert max(map(len, chunks)) == most_bytes
