"""The sender under any order of events: a hypothesis rule-based machine (5.1; invariants I1 to I4)."""

from __future__ import annotations

import tempfile
from collections import Counter
from pathlib import Path
from typing import ClassVar

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from dnc import alarms
from dnc.events import Event, Held, JobState, StateChanged
from dnc.handshake import Cause
from dnc.pacing import Pace
from tests.helpers.line import XOFF, XON, sender_of, tape_of

PROGRAM = b"".join(b"N%d G1 X%d.%d\n" % (index, index * 7, index) for index in range(9)) + b"M30\n%\n"
PAUSE_TURNS = 40
"""More than a block has bytes."""
TAPE = PROGRAM + b"\0" * 40
BYTE_S = 0.001
START_TIMEOUT_S = 0.05
EARLY = st.sampled_from([b"", XON, XOFF, XON + XOFF])
"""What the control has said before the start."""
STOPPED = (JobState.ABORTED, JobState.FAULTED, JobState.PAUSED, JobState.LOADED)
OVER = (JobState.ABORTED, JobState.FAULTED, JobState.SENT)


class AnyOrder(RuleBasedStateMachine):
    """Drives one sender; `out` is what left, `line_free_s` when the true line has carried it away."""

    reached: ClassVar[Counter[JobState]] = Counter()

    @initialize(
        waits=st.booleans(),
        inflight=st.integers(1, 9),
        timeout_s=st.sampled_from([0.0, 0.5]),
        said=EARLY,
        starts=st.booleans(),
    )
    def begin(self, waits: bool, inflight: int, timeout_s: float, said: bytes, starts: bool) -> None:
        self.load(waits, inflight, timeout_s)
        self.hear_anything(said)
        if starts:
            self.start()

    def load(self, waits: bool, inflight: int, timeout_s: float, *, hears: bool = True) -> None:
        with tempfile.TemporaryDirectory() as folder:
            self.tape = tape_of(Path(folder), PROGRAM, trailer=r"\NUL*40")
        self.inflight_max, self.hears = inflight, hears
        self.sender = sender_of(
            self.tape,
            Pace(BYTE_S, inflight, 0.0, slack=0.0),
            hears_xoff=hears,
            waits_for_xon=waits and hears,
            start_timeout_s=START_TIMEOUT_S,
            hold_timeout_s=timeout_s,
        )
        self.now_s = 0.0
        self.out = self.answer = b""
        self.line_free_s = 0.0
        self.peer_holds = False
        self.is_stopped = True

    def note(self, events: list[Event], *, is_operator: bool = False) -> None:
        """No event but the operator's leads from a stop to SENDING; nothing leaves ABORTED, FAULTED."""
        for event in events:
            if isinstance(event, Held):
                assert self.underway_bytes() - 1e-6 <= event.inflight_bytes <= self.inflight_max
            if not isinstance(event, StateChanged):
                continue
            self.reached[event.new] += 1
            assert event.old not in OVER
            if event.new in STOPPED:
                self.is_stopped = True
            elif event.new in (JobState.SENDING, JobState.HELD, JobState.ARMED) and self.is_stopped:
                assert is_operator
                self.is_stopped = False

    def underway_bytes(self) -> float:
        """What has left the sender and not yet the true line."""
        return max(0.0, self.line_free_s - self.now_s) / BYTE_S

    @precondition(lambda self: self.sender.is_over or self.sender.state is JobState.LOADED)
    @rule(waits=st.booleans(), inflight=st.integers(1, 9), hears=st.booleans(), said=EARLY, starts=st.booleans())
    def load_anew(self, waits: bool, inflight: int, hears: bool, said: bytes, starts: bool) -> None:
        """A job that is over gets a fresh act of the operator, or none at all."""
        self.tape.close()
        self.load(waits, inflight, 0.0, hears=hears)
        self.hear_anything(said)
        if starts:
            self.start()

    @rule()
    def start(self) -> None:
        if self.sender.state is JobState.LOADED:
            self.note(self.sender.start(self.now_s), is_operator=True)

    @rule(turns=st.integers(1, 20), refused=st.integers(0, 9))
    def run_on(self, turns: int, refused: int) -> None:
        """As the stream does it: take, tick, sleep as long as asked."""
        for turn in range(turns):
            self.take(1000, refused if turn == turns // 2 else 0)
            self.wait_as_asked()

    @rule(short_of_bytes=st.sampled_from([0, 2, 30, 42, 44]))
    def run_towards_the_end(self, short_of_bytes: int) -> None:
        """Up to the last bytes, where a hold or a stop is another matter."""
        while self.sender.state is JobState.SENDING and len(self.out) < len(TAPE) - short_of_bytes:
            self.take(1000, 0)
            self.wait_as_asked()

    @rule(room=st.integers(0, 40), refused=st.integers(0, 9))
    def take(self, room: int, refused: int) -> None:
        chunk = self.sender.take(room, self.now_s)
        assert len(chunk) <= room
        if chunk:
            assert self.sender.state is JobState.SENDING
            assert not self.peer_holds
            assert not self.is_stopped
        back = min(refused - 5, len(chunk)) if refused > 5 else 0
        if back:
            self.sender.give_back(back)
            chunk = chunk[: len(chunk) - back]
        self.leave(chunk)

    def leave(self, chunk: bytes) -> None:
        self.out += chunk
        if chunk:
            self.line_free_s = max(self.line_free_s, self.now_s) + len(chunk) * BYTE_S

    @precondition(lambda self: not self.answer and self.sender.is_one_xon_away)
    @rule(room=st.sampled_from([0, 3, 1000]), step_s=st.sampled_from([0.0, 0.001, 0.01]))
    def lay_an_answer_ready(self, room: int, step_s: float) -> None:
        """As the stream does it: once, and anything heard makes it void; pauses, resumes and time do not."""
        self.wait(step_s)
        self.answer = self.sender.answer(room, self.now_s)

    @precondition(lambda self: self.hears and self.sender.state is JobState.SENDING)
    @rule(turns=st.integers(0, 5), room=st.sampled_from([3, 1000]), is_answered=st.booleans())
    def be_held_until_an_answer_is_ready(self, turns: int, room: int, is_answered: bool) -> None:
        """The usual way there, which random steps seldom find."""
        self.run_on(turns, 0)
        self.hear_anything(XOFF)
        if self.sender.is_one_xon_away:
            self.lay_an_answer_ready(room, 0.01)
        if is_answered and self.answer and self.sender.is_one_xon_away:
            self.hear_the_xon_and_answer_first(0)

    @precondition(lambda self: self.answer and self.sender.is_one_xon_away)
    @rule(refused=st.sampled_from([0, 0, 0, 1, 9]))
    def hear_the_xon_and_answer_first(self, refused: int) -> None:
        written = self.answer[: max(0, len(self.answer) - refused)]
        self.answer, self.peer_holds = b"", False
        self.leave(written)
        self.note(self.sender.answered(XON, written, self.now_s))
        assert self.sender.state is JobState.SENDING

    @rule(step_s=st.floats(0.0, 0.02))
    def wait(self, step_s: float) -> None:
        self.now_s += step_s
        self.note(self.sender.tick(self.now_s))

    @rule()
    def wait_as_asked(self) -> None:
        if self.sender.next_wake_s < self.now_s + 10:
            self.now_s = max(self.now_s, self.sender.next_wake_s)
        self.note(self.sender.tick(self.now_s))

    @rule(code=st.sampled_from([XOFF, b"\x93"]))
    def hear_xoff(self, code: bytes) -> None:
        self.hear_anything(code)

    @rule(count=st.integers(1, 2))
    def hear_xon(self, count: int) -> None:
        self.hear_anything(XON * count)

    @rule(noise=st.binary(min_size=1, max_size=20), times=st.sampled_from([1, 1, 1, 60]))
    def hear_anything(self, noise: bytes, times: int = 1) -> None:
        for byte in noise if self.hears else b"":
            if byte & 0x7F == 0x13:
                self.peer_holds = True
            elif byte & 0x7F == 0x11:
                self.peer_holds = False
        self.answer = b""
        self.note(self.sender.hear(noise * times, self.now_s))

    @rule(is_ready=st.booleans())
    def turn_the_modem_line(self, is_ready: bool) -> None:
        if not self.hears:
            self.note(self.sender.peer_is_ready(is_ready, self.now_s))
            self.peer_holds = not is_ready

    @rule()
    def pause(self) -> None:
        self.note(self.sender.pause(self.now_s))

    @precondition(lambda self: self.sender.is_pausing and self.sender.state is JobState.SENDING)
    @rule()
    def see_a_pause_come(self) -> None:
        """However few bytes the line takes, the block under way ends, and nothing of the next one follows."""
        self.run_on(PAUSE_TURNS, 0)
        assert self.sender.state is not JobState.SENDING

    @rule()
    def resume(self) -> None:
        self.note(self.sender.resume(self.now_s), is_operator=True)

    @precondition(lambda self: not self.sender.is_over)
    @rule(what=st.sampled_from(["abort", "reset", "alarm", "unplug", "fault"]))
    def stop(self, what: str) -> None:
        match what:
            case "abort":
                self.note(self.sender.abort(self.now_s))
            case "unplug":
                self.note(self.sender.lost(self.now_s, "unplugged"))
            case "fault":
                self.note(self.sender.fault(alarms.LOOPBACK, "", self.now_s))
            case _:
                self.hear_anything(XOFF + (b"\x16" if what == "reset" else b"\x15"))
        assert self.sender.state in OVER or not self.hears

    @rule()
    def disturb(self) -> None:
        self.note(self.sender.disturb(alarms.SLEPT, "9 s", self.now_s))
        assert self.sender.state not in (JobState.SENDING, JobState.HELD)

    @invariant()
    def out_is_a_prefix(self) -> None:
        """(I1)"""
        assert TAPE.startswith(self.out)
        assert self.sender.offset_bytes == len(self.out) == self.sender.tally.bytes_sent

    @invariant()
    def in_flight_within_the_bound(self) -> None:
        """(I4) What the line has not carried away is at most the bound, so no more can follow an XOFF."""
        assert self.underway_bytes() <= self.inflight_max + 1e-6

    @invariant()
    def a_pause_falls_on_a_block_end(self) -> None:
        """(I3) Unless a disturbance stopped the job at once."""
        if self.sender.state is JobState.PAUSED and self.sender.last_cause is Cause.PAUSE_REACHED:
            assert not self.sender.is_cut

    @invariant()
    def sent_means_everything_essential_has_left_the_line(self) -> None:
        if self.sender.state is JobState.SENT:
            assert len(self.out) >= self.tape.end.essential_bytes
            assert self.underway_bytes() <= 1e-6

    def teardown(self) -> None:
        """Whatever happened, an operator who resumes and a control that is ready bring the rest of the tape through."""
        if not hasattr(self, "tape"):
            return
        for _ in range(8):
            if self.sender.is_over:
                break
            self.start()
            if self.hears:
                self.hear_xon(1)
            else:
                self.turn_the_modem_line(True)
            if self.sender.state is JobState.PAUSED:
                self.resume()
            self.run_on(200, 0)
        assert self.sender.is_over
        if self.sender.last_cause is Cause.DRAINED:
            assert self.out == TAPE
        self.tape.close()


def test_any_order() -> None:
    """(5.1) No order breaks a rule, and the orders tried lead through every state."""
    AnyOrder.reached.clear()
    run_state_machine_as_test(AnyOrder, settings=settings(max_examples=200, stateful_step_count=50, deadline=None))
    assert set(AnyOrder.reached) == set(JobState) - {JobState.EMPTY}
