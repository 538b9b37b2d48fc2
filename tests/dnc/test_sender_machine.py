"""The sender under any order of events: a hypothesis rule-based machine (5.1; invariants I1 to I4)."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from dnc.events import Event, JobState, StateChanged
from dnc.pacing import Pace
from tests.helpers.line import XOFF, XON, sender_of, tape_of

PROGRAM = b"".join(b"N%d G1 X%d.%d\n" % (index, index * 7, index) for index in range(12)) + b"M30\n%\n"
RARELY = [False] * 15 + [True]


class AnyOrder(RuleBasedStateMachine):
    """Drives one sender; `out` is what left, `line_free_s` when the true line has carried it away."""

    @initialize(waits=st.booleans(), inflight=st.integers(1, 9), timeout_s=st.sampled_from([0.0, 0.5]))
    def begin(self, waits: bool, inflight: int, timeout_s: float) -> None:
        self.load(waits, inflight, timeout_s)
        if inflight != 1:
            self.start()
            self.hear_xon(1)

    def load(self, waits: bool, inflight: int, timeout_s: float) -> None:
        folder = tempfile.TemporaryDirectory()
        self.tape = tape_of(Path(folder.name), PROGRAM)
        folder.cleanup()
        self.inflight_max = inflight
        self.sender = sender_of(
            self.tape, Pace(0.001, inflight, 0.0, slack=0.0), waits_for_xon=waits, hold_timeout_s=timeout_s
        )
        self.now_s = 0.0
        self.out = b""
        self.line_free_s = 0.0
        self.has_started = False
        self.peer_holds = False
        self.is_stopped = False
        self.after_xoff = 0

    def note(self, events: list[Event], *, is_operator: bool = False) -> None:
        """No event but the operator's leads from a stop to SENDING; nothing leaves ABORTED, FAULTED."""
        for event in events:
            if not isinstance(event, StateChanged):
                continue
            assert event.old not in (JobState.ABORTED, JobState.FAULTED, JobState.SENT)
            if event.new in (JobState.ABORTED, JobState.FAULTED, JobState.PAUSED, JobState.LOADED):
                self.is_stopped = True
            elif event.new in (JobState.SENDING, JobState.HELD, JobState.ARMED) and self.is_stopped:
                assert is_operator
                self.is_stopped = False

    @rule(waits=st.booleans(), inflight=st.integers(1, 9))
    def load_anew(self, waits: bool, inflight: int) -> None:
        """A job that is over gets a fresh act of the operator, or none at all."""
        if self.sender.is_over or self.sender.state is JobState.LOADED:
            self.tape.close()
            self.load(waits, inflight, 0.0)
            self.start()

    @rule()
    def start(self) -> None:
        if self.sender.state is JobState.LOADED:
            self.note(self.sender.start(self.now_s), is_operator=True)

    @rule(turns=st.integers(1, 40), refused=st.integers(0, 9))
    def run_on(self, turns: int, refused: int) -> None:
        """As the stream does it: take, tick, sleep as long as asked."""
        for turn in range(turns):
            self.take(1000, refused if turn == turns // 2 else 0)
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
        self.out += chunk
        if chunk:
            self.line_free_s = max(self.line_free_s, self.now_s) + len(chunk) * 0.001

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
        self.note(self.sender.hear(code, self.now_s))
        self.peer_holds = True

    @rule(count=st.integers(1, 2))
    def hear_xon(self, count: int) -> None:
        self.note(self.sender.hear(XON * count, self.now_s))
        self.peer_holds = False

    @rule(noise=st.binary(min_size=1, max_size=20))
    def hear_anything(self, noise: bytes) -> None:
        for byte in noise:
            if byte & 0x7F == 0x13:
                self.peer_holds = True
            elif byte & 0x7F == 0x11:
                self.peer_holds = False
        self.note(self.sender.hear(noise, self.now_s))

    @rule(chance=st.sampled_from(RARELY))
    def hear_reset(self, chance: bool) -> None:
        if not chance:
            return
        self.note(self.sender.hear(b"\x13\x16", self.now_s))
        self.peer_holds = True

    @rule()
    def pause(self) -> None:
        self.note(self.sender.pause(self.now_s))

    @rule()
    def resume(self) -> None:
        self.note(self.sender.resume(self.now_s), is_operator=True)

    @rule(chance=st.sampled_from(RARELY))
    def abort(self, chance: bool) -> None:
        if chance:
            self.note(self.sender.abort(self.now_s))

    @rule(chance=st.sampled_from(RARELY))
    def unplug(self, chance: bool) -> None:
        if chance:
            self.note(self.sender.lost(self.now_s, "unplugged"))
            assert self.sender.state in (JobState.FAULTED, JobState.ABORTED, JobState.SENT)

    @invariant()
    def out_is_a_prefix(self) -> None:
        """(I1)"""
        assert PROGRAM.startswith(self.out)
        assert self.sender.offset_bytes == len(self.out) == self.sender.tally.bytes_sent

    @invariant()
    def in_flight_within_the_bound(self) -> None:
        """(I4) What the line has not carried away is at most the bound, so no more can follow an XOFF."""
        assert (self.line_free_s - self.now_s) / 0.001 <= self.inflight_max + 1e-6

    @invariant()
    def a_pause_falls_on_a_block_end(self) -> None:
        """(I3) Unless a disturbance stopped the job at once."""
        if self.sender.state is JobState.PAUSED and self.sender.last_cause.name == "PAUSE_REACHED":
            assert not self.sender.is_cut

    @invariant()
    def sent_means_everything_essential(self) -> None:
        if self.sender.state is JobState.SENT:
            assert len(self.out) >= self.tape.end.essential_bytes

    def teardown(self) -> None:
        if hasattr(self, "tape"):
            self.tape.close()


AnyOrder.TestCase.settings = settings(max_examples=100, stateful_step_count=50, deadline=None)
TestAnyOrder = AnyOrder.TestCase
