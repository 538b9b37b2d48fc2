"""One job from the loaded tape to the report: puts port, sender, stream, journal and publisher together."""

from __future__ import annotations

import contextlib
import json
import signal
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from types import FrameType
from typing import Any

from dnc import alarms
from dnc.aftermath import begin_mark, leave_mark
from dnc.capture import Capture
from dnc.errors import ControlStopped, LineFault, OperatorAbort
from dnc.eventlog import EventLog, Listener
from dnc.events import JobState, Severity
from dnc.handshake import Cause
from dnc.journal import Journal
from dnc.line_pace import pace_of
from dnc.names import JobNames
from dnc.pacing import ByteClock
from dnc.places import runtime_folder, state_folder, write_whole
from dnc.port import Flow, Port
from dnc.priority import Punctuality, on_time
from dnc.profile import Link, MachineProfile, framing_of
from dnc.record import append_record, doubt_of, doubt_words, send_report
from dnc.rules import Rules
from dnc.sender import Sender
from dnc.service.publisher import Publisher
from dnc.service.snapshot import JobView
from dnc.stream import Command, Stream
from dnc.tape import Tape

_AHEAD_S = 6.0
_AHEAD_MIN_BYTES = 4096
_HEARD_BYTES = 65536
SIGTERM_EXIT = 143
_UNTOLD = "nobody can tell from here whether the device server passed them on"


@dataclass(frozen=True, slots=True)
class Finished:
    """What a job left behind."""

    report: dict[str, Any]
    state: JobState
    cause: Cause
    exit_code: int
    sentence: str


def rules_of(link: Link) -> Rules:
    """What the sender needs of the profile."""
    return Rules(
        xon=link.xon,
        xoff=link.xoff,
        hears_xoff=link.handshake == "xonxoff",
        is_driver_asked=link.handshake == "driver",
        waits_for_xon=link.start == "wait-xon",
        start_timeout_s=link.start_timeout_s,
        hold_timeout_s=link.hold_timeout_s,
        hold_warning_s=link.hold_warning_s,
    )


class Job:
    """Runs once; `stream` may be asked to pause, resume or abort meanwhile.

    `unheard_events` is how many events a slow listener had not heard when the job's end could wait no longer,
    `not_kept` why the record or the mark of the port could not be written, empty if they were.
    """

    def __init__(
        self, tape: Tape, port: Port, profile: MachineProfile, names: JobNames, listeners: list[Listener]
    ) -> None:
        self.tape, self.port, self.profile, self.names = tape, port, profile, names
        self.sender = Sender(
            tape, ByteClock(pace_of(profile, is_networked=not port.is_bound_assured)), rules_of(profile.link)
        )
        self._folder = state_folder() / "jobs" / names.job_id
        self.events = EventLog([*listeners, Capture(self._folder / "heard", _HEARD_BYTES)])
        ahead = max(_AHEAD_MIN_BYTES, int(_AHEAD_S * profile.link.baud / 10))
        self.journal = Journal(self._folder / "journal", tape.sha256, ahead, self._wake)
        self.stream = Stream(self.sender, port, self.journal, self.events.add)
        self.unheard_events = 0
        self.not_kept = ""
        self._granted = Punctuality(is_realtime=False, is_light_sleeper=False)
        self._started = datetime.now(UTC)

    def run(self) -> Finished:
        """Send the tape; always ends with a report, whatever happened."""
        view = JobView(self.sender, self.port, self.profile, self.names, self.events)
        publisher = Publisher(runtime_folder(), view, self.stream.command)
        if not publisher.start():
            self.events.add(alarms.UNWATCHED.at(time.monotonic(), 0))
        self._write_about()
        self.journal.open()
        self._keep(lambda: begin_mark(self.port.identity, self.names.job_id, self.names.program))
        with _signals(self.stream):  # to the end: a second Ctrl-C must not take the record away
            try:
                with on_time() as self._granted:
                    self.stream.run()
            finally:
                finished = self._ended()
                publisher.close()
                self.unheard_events = self.events.close()
        self.stream.close()
        return finished

    def _ended(self) -> Finished:
        """Let go of the port and put the job on record, before anybody is waited for who may be slow."""
        ended_s = time.monotonic()
        self.journal.close(self.sender.offset_bytes, self.sender.state)
        if not self.port.close():
            self.events.add(alarms.CLOSE_STUCK.at(ended_s, self.sender.offset_bytes))
        return self._finished(ended_s)

    def _write_about(self) -> None:
        """What `dnc jobs` and `--resume` need of a job that ends without a word; on disk before its journal is."""
        about = {
            "program": self.names.program,
            "machine": self.names.machine,
            "port": self.port.name,
            "identity": self.port.identity,
            "simulated": self.port.is_simulated,
            "sha256": self.tape.sha256,
            "program_sha256": self.tape.program_sha256,
            "bytes_total": self.tape.size_bytes,
            "framing": framing_of(self.profile.tape),
            "receive_buffer_bytes": self.profile.control.receive_buffer_bytes,
            "lookahead_blocks": self.profile.control.lookahead_blocks,
            "beyond_recall_bytes": self.sender.clock.pace.beyond_recall_bytes,
            "restart": self.names.restart,
            "rehearsal": self.names.is_rehearsal,
            "started": self._started.isoformat(timespec="milliseconds"),
        }
        with contextlib.suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            write_whole(self._folder / "job.json", json.dumps(about, indent=1) + "\n", to_disk=True)

    def _keep(self, write: Callable[[], None]) -> None:
        """Write something of the job to disk; what fails is told afterwards, and stops nothing."""
        try:
            write()
        except OSError as problem:
            self.not_kept = problem.strerror or str(problem)

    def _wake(self) -> None:
        self.stream.wake()

    def _finished(self, ended_s: float) -> Finished:
        sender = self.sender
        code, sentence = self._verdict()
        report = send_report(
            sender,
            self.profile.control,
            baud=self.profile.link.baud,
            simulated=self.port.is_simulated,
            now_s=ended_s,
            alarms=self.events.alarms,
            job=self.names.job_id,
            program=self.names.program,
            machine=self.names.machine,
            port=self.port.name,
            port_identity=self.port.identity,
            restart=self.names.restart,
            rehearsal=self.names.is_rehearsal,
            started=self._started.isoformat(timespec="milliseconds"),
            handshake=self.profile.link.handshake,
            bound_assured=self.port.is_bound_assured and self.port.flow is Flow.BYTES,
            realtime=self._granted.is_realtime,
            light_sleep=self._granted.is_light_sleeper,
            hold_up_s_max=round(self.stream.hold_ups.worst_s, 6),
            hold_ups=[[round(ended_s, 6), round(lasted_s, 6)] for ended_s, lasted_s in self.stream.hold_ups.recent],
            xoff_heard_s=[round(heard_s, 6) for heard_s in sender.tally.xoff_heard_s],
            exit_code=code,
        )
        self._keep(lambda: append_record(state_folder(), report))
        self._keep(lambda: leave_mark(self.port.identity, report))
        return Finished(report, sender.state, sender.last_cause, code, sentence)

    def _verdict(self) -> tuple[int, str]:
        """Exit code and sentence for the operator."""
        sender = self.sender
        window = doubt_words(self.tape, doubt_of(sender, self.profile.control), self.names.restart)
        grave = [alarm for alarm in self.events.alarms if alarm.severity is Severity.ALARM]
        why = grave[-1] if grave else None
        told = f"{why.text}; {why.remedy}" if why is not None else sender.last_cause.value
        if sender.state is JobState.SENT:
            # Connection and device server may still hold all of a short program, and neither tells.
            told = "" if self.port.is_bound_assured else " into the network; " + _UNTOLD
            sent = f"sent {sender.tally.bytes_sent} bytes{told}; SENT does not mean that the part is done"
            return 0, sender.note or sent
        if sender.last_cause in (Cause.CONTROL_RESET, Cause.CONTROL_ALARM):
            return int(ControlStopped.exit_code), f"{told}; {window}"
        cut = "is" if sender.is_cut else "may be"
        cut = f"the last block {cut} cut: reset the control; " if sender.may_be_cut else ""
        is_left = sender.last_cause is Cause.ABORT and self.stream.last_command is Command.LEAVE
        if sender.state is JobState.PAUSED or is_left:
            return SIGTERM_EXIT, f"stopped by SIGTERM at {sender.offset_bytes} bytes; {cut}{window}"
        if sender.last_cause is Cause.ABORT:
            return int(OperatorAbort.exit_code), f"aborted by the operator; {cut}{window}"
        return int(LineFault.exit_code), f"{told}; {window}"


@contextlib.contextmanager
def _signals(stream: Stream) -> Iterator[None]:
    """SIGINT aborts, SIGTERM pauses at a block end and leaves, SIGHUP (a lost terminal) changes nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def on_signal(number: int, _frame: FrameType | None) -> None:
        stream.command(Command.ABORT if number == signal.SIGINT else Command.LEAVE)

    handlers: dict[signal.Signals, Callable[[int, FrameType | None], None] | signal.Handlers] = {
        signal.SIGINT: on_signal,
        signal.SIGTERM: on_signal,
        signal.SIGHUP: signal.SIG_IGN,
    }
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
