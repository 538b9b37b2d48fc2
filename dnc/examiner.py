"""The acceptance test of a cable: feed override at 0 must stop us, feed override up must let us go on.

Nothing but this shows that a control and a cable really do XON/XOFF; many a job was lost on a line where they did not.
"""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Any, Self

import msgspec

from dnc.events import Alarm, Event, JobState, StateChanged
from dnc.job import Job
from dnc.joblist import known_ids
from dnc.line_pace import pace_of
from dnc.names import JobNames, new_job_id
from dnc.places import made_state_folder, state_folder
from dnc.port import Port
from dnc.profile import Control, MachineProfile, Tape
from dnc.sender import Sender
from dnc.spool import load_tape
from dnc.stream import Command, Stream

_PERIOD_S = 0.1
_HELD_LONG_ENOUGH_S = 3.0


class Verdict(Enum):
    """What came out, as a sentence for the operator."""

    PASSED = "the control stopped us and let us go on"
    PASSED_MOVING = (
        "the control stopped us and let us go on by itself, so its feed override was not at 0 and the axes moved "
        "by 0.01 mm"
    )
    STOPPED_ONLY = "the control stopped us; it was not seen to let us go on in the time given"
    NEVER_STOPPED = (
        "the control took more than its buffer holds and never sent XOFF; if its feed override was at 0, it does no "
        "XON/XOFF or the wire back is open: see its interface settings and the cable before any job"
    )
    NEVER_STARTED = "the control sent no XON in the time given; was external execution started, is the cable right?"
    TOO_SHORT = "the program ended before the control had to stop us"
    BROKEN_OFF = "the test was broken off before the control had to stop us"


def to_and_fro(control: Control, unseen_bytes: int = 0) -> bytes:
    """Moves of 0.01 mm to and fro in X from where the machine stands, three times what the buffer holds.

    So many bytes more may lie in an adapter that obeys XOFF itself. On a control whose unit is the inch 0.0004 of it.
    """
    step, feed = (b"0.0004", b"0.4") if control.units == "inch" else (b"0.01", b"10")
    pair = b"G1 X%s\nG1 X-%s\n" % (step, step)
    count = (3 * control.receive_buffer_bytes + unseen_bytes) // len(pair) + 50
    return b"G91 G94 G1 F%s\n" % feed + pair * count + b"G90\nM30\n"


class Examiner:
    """Watches a running job from a thread of its own and ends it when the verdict is clear."""

    def __init__(self, stream: Stream, control: Control, resume_wait_s: float, say: Callable[[str], None]) -> None:
        self.verdict = Verdict.BROKEN_OFF
        self._stream, self._resume_wait_s, self._say = stream, resume_wait_s, say
        held_bytes = control.receive_buffer_bytes + control.lookahead_blocks * 20
        self._limit_bytes = held_bytes + stream.sender.clock.pace.unseen_bytes + 1000
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="examiner", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_exc: object) -> None:
        self._end.set()
        self._thread.join(2.0)

    def _run(self) -> None:
        self.verdict = self._examined(self._stream.sender)
        self._stream.command(Command.PAUSE)
        self._wait_until(lambda: self._stream.sender.state is not JobState.SENDING, 2.0)
        self._stream.command(Command.ABORT)

    def _examined(self, sender: Sender) -> Verdict:
        def is_full() -> bool:
            return sender.offset_bytes > self._limit_bytes and (sender.tally.held_s > 0 or not sender.tally.xoff_count)

        def is_settled() -> bool:
            is_held = sender.state is JobState.HELD and time.monotonic() - sender.held_since_s >= _HELD_LONG_ENOUGH_S
            return is_held or is_full()

        if not self._wait_until(is_settled, None):
            return self._unsettled(sender)
        if is_full():
            return Verdict.PASSED_MOVING if sender.tally.xoff_count else Verdict.NEVER_STOPPED
        self._say(f"held after {sender.offset_bytes} bytes: the control stops us. Now raise the feed override.")
        if self._wait_until(lambda: sender.state is JobState.SENDING, self._resume_wait_s):
            return Verdict.PASSED
        return Verdict.STOPPED_ONLY

    @staticmethod
    def _unsettled(sender: Sender) -> Verdict:
        if sender.state is JobState.SENT:
            return Verdict.TOO_SHORT
        return Verdict.BROKEN_OFF if sender.offset_bytes else Verdict.NEVER_STARTED

    def _wait_until(self, is_so: Callable[[], bool], limit_s: float | None) -> bool:
        """Poll until it is so; False when the time is up or the job is over."""
        until_s = None if limit_s is None else time.monotonic() + limit_s
        while not is_so():
            is_late = until_s is not None and time.monotonic() > until_s
            if is_late or self._stream.sender.is_over or self._end.wait(_PERIOD_S):
                return False
        return True


def examine(
    port: Port, profile: MachineProfile, machine: str, resume_wait_s: float, say: Callable[[str], None]
) -> dict[str, Any]:
    """Send the moves, watch, stop; the report says whether it passed and how many bytes ran on after XOFF.

    `say` hears what the operator is to do and what goes wrong meanwhile.
    """

    def tell(event: Event) -> None:
        if isinstance(event, Alarm):
            say(f"{event.severity.value} {event.id}: {event.text}; {event.remedy}")
        elif isinstance(event, StateChanged) and event.new is JobState.ARMED:
            say(f"waiting for the control's first XON; press cycle start (at most {profile.link.start_timeout_s:g} s)")

    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "test-handshake.mpf"
        unseen_bytes = pace_of(profile, is_networked=not port.is_bound_assured).unseen_bytes
        program.write_bytes(to_and_fro(profile.control, unseen_bytes))
        tape = load_tape(program, Tape(), made_state_folder() / "spool", profile.link.data_bits)
    silent = msgspec.structs.replace(profile, link=msgspec.structs.replace(profile.link, hold_timeout_s=0.0))
    job = Job(tape, port, silent, JobNames(new_job_id(known_ids(state_folder())), "test-handshake", machine), [tell])
    try:
        with Examiner(job.stream, profile.control, resume_wait_s, say) as examiner:
            finished = job.run()
    finally:
        tape.close()
    keys = ("xoff_count", "held_s", "inflight_at_xoff_bytes_max", "masked_xoff_count", "noise_bytes", "bytes_sent")
    return {
        "schema": "dripmill.test-handshake",
        "version": 1,
        "passed": examiner.verdict in {Verdict.PASSED, Verdict.PASSED_MOVING},
        "verdict": examiner.verdict.value,
        "simulated": finished.report["simulated"],
        "alarms": finished.report["alarms"],
        **{key: finished.report[key] for key in keys},
    }
