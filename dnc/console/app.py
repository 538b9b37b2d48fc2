"""The operator's console: a screen over a running job and its machine; it watches, and asks the job to pause or go on.

It owns neither the port nor the job: killing it changes nothing at the machine.
"""

from __future__ import annotations

import asyncio
import signal
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

from rich.style import Style
from rich.text import Text
from textual.app import App, ComposeResult
from textual.events import Key
from textual.widgets import Static

from dnc.console.alarms import AlarmLine, AlarmList, present_alarms
from dnc.console.forecast import Forecast, forecast_apart
from dnc.console.known import Known, is_other_mill, planned
from dnc.console.rows import Row, Tone
from dnc.console.view import screen, shown_alarms
from dnc.profile import Modbus
from dnc.status.job import JobReading, JobWatcher
from dnc.status.monitor import StatusMonitor

STYLES = {
    Tone.PLAIN: Style(),
    Tone.QUIET: Style(dim=True),
    Tone.STRONG: Style(bold=True),
    Tone.RUNS: Style(color="#000000", bgcolor="#35b34a", bold=True),
    Tone.ABNORMAL: Style(color="#000000", bgcolor="#e6b800", bold=True),
    Tone.FAULT: Style(color="#ffffff", bgcolor="#c81e1e", bold=True),
    Tone.ASKS: Style(color="#ffffff", bgcolor="#1d5fd0", bold=True),
    Tone.SIMULATED: Style(reverse=True, bold=True),
}
_KEYS = {
    "f1": "help",
    "question_mark": "help",
    "f5": "resume",
    "r": "resume",
    "f6": "hold",
    "space": "hold",
    "h": "hold",
    "f8": "abort",
    "x": "abort",
    "f9": "acknowledge",
    "k": "acknowledge",
    "f10": "leave",
    "q": "leave",
    "ctrl+c": "leave",
}
"""Ctrl-S and Ctrl-Q are not among them: they stop and start the operator's own terminal."""

_QUESTIONS = {
    "resume": ("enter", "RESUME? The axes may move as soon as data comes. Enter: yes, any other: no"),
    "abort": ("a", "ABORT? It may cut a block; reset the control then. A: yes, any other: no"),
}


@dataclass(frozen=True, slots=True)
class Machine:
    """The machine that is watched: its name, and its profile for the forecast."""

    name: str
    profile: Path


class Console(App[None], inherit_bindings=False):
    """Redraws twice a second; acts on keys at once."""

    ENABLE_COMMAND_PALETTE = False
    CSS = "Screen { overflow: hidden; } Static { width: 100%; height: 100%; }"

    def __init__(self, machine: Machine, modbus: Modbus, watcher: JobWatcher, redraw_s: float = 0.5) -> None:
        super().__init__()
        self.machine, self.watcher = machine, watcher
        self.monitor = StatusMonitor(modbus)
        self.alarms = AlarmList()
        self.question = ""
        self._asked_of: object = None
        self.notice = ""
        self.is_help = False
        self._rest = ""
        self._redraw_s = redraw_s
        self._forecasts: dict[str, Forecast | None] = {}
        self._tasks: list[asyncio.Task[None]] = []
        self.face: list[Row] = []
        self._seen: list[AlarmLine] = []
        self._shown = Static("", markup=False)

    def compose(self) -> ComposeResult:
        """One widget: the view is made of text."""
        yield self._shown

    async def on_mount(self) -> None:
        """Begin to watch. SIGTERM leaves like a key does, with the terminal as it was."""
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, self.exit, None, 128 + signal.SIGTERM)
        self._tasks = [asyncio.create_task(self.monitor.run()), asyncio.create_task(self.watcher.run())]
        self.set_interval(self._redraw_s, self.redraw_face)
        self.redraw_face()

    async def on_unmount(self) -> None:
        """Stop watching; the job goes on."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def on_resize(self) -> None:
        """Another size of terminal."""
        self.redraw_face()

    def on_key(self, event: Key) -> None:
        """A waiting question takes the next key, whatever it is; else the key does what it is for.

        What was asked of one job is not done to another one that is shown by now.
        """
        event.stop()
        if self.question:
            what, self.question = self.question, ""
            if event.key == _QUESTIONS[what][0]:
                self.order(what, self._asked_of)
            else:
                self.notice = f"no {what}"
        else:
            self._do(_KEYS.get(event.key, ""))
        self.redraw_face()

    def order(self, what: str, job: object) -> None:
        """Ask this job's process."""
        why = "there is no job to ask" if job in (None, self.watcher.job) else "another job is shown now"
        self.notice = f"asked the job: {what}" if self.watcher.order(what, job) else f"no {what}: {why}"

    def _do(self, verb: str) -> None:
        self.notice = "" if verb else self.notice
        match verb:
            case "help":
                self.is_help = not self.is_help
            case "hold":
                self.order("pause", self.watcher.job)
            case "resume" | "abort":
                self.question, self._asked_of = verb, self.watcher.job
            case "acknowledge":
                self.alarms.acknowledge(self._seen)
            case "leave":
                job = self.watcher.reading()
                is_running = job is not None and job.is_attached
                self.exit(message="The job goes on; dnc console shows it again." if is_running else None)

    def redraw_face(self) -> None:
        """Everything anew from what is known now."""
        job = self.watcher.reading()
        is_other = self.monitor.is_simulated and is_other_mill(job, self.monitor.modbus.port)
        status = None if is_other else self.monitor.status()
        self._forget_notice(job)
        if self.alarms.update(present_alarms(job, status)):
            self.bell()
        now = datetime.now().astimezone()
        known = Known(
            clock=now.strftime("%H:%M:%S"),
            machine_name=self.machine.name,
            job=job,
            machine=status,
            is_machine_simulated=self.monitor.is_simulated and not is_other,
            forecast=self._forecast_of(job),
            alarms=self.alarms.lines(),
            question=_QUESTIONS[self.question][1] if self.question else "",
            notice=self.watcher.answer or self.notice,
            is_help=self.is_help,
        )
        known = _with_end(known, now)
        size = self.size
        self.face = screen(known, size.width, size.height)
        self._seen = shown_alarms(known, size.width, size.height)
        self._shown.update(_text(self.face))

    def _forget_notice(self, job: JobReading | None) -> None:
        """Once the job has come to rest, what to do now matters more than what was asked before."""
        state = str(job.snapshot.get("state")) if job is not None else ""
        rest = "" if state in ("SENDING", "HELD") else state
        if rest and rest != self._rest:
            self.notice = self.watcher.answer = ""
        self._rest = rest

    def _forecast_of(self, job: JobReading | None) -> Forecast | None:
        """The plan's clock of this program; made in a process of its own the first time it is wanted."""
        if job is None:
            return None
        key = str(job.snapshot.get("sha256"))
        if key not in self._forecasts:
            self._forecasts[key] = None
            self._tasks.append(asyncio.create_task(self._make_forecast(key, Path(str(job.snapshot.get("program"))))))
        return self._forecasts[key]

    async def _make_forecast(self, key: str, program: Path) -> None:
        self._forecasts[key] = await forecast_apart(program, self.machine.profile)


def _with_end(known: Known, now: datetime) -> Known:
    plan = planned(known)
    if plan is None:
        return known
    return replace(known, end_clock=(now + timedelta(seconds=plan[1] - plan[0])).strftime("%H:%M"))


def _text(rows: list[Row]) -> Text:
    whole = Text(no_wrap=True, overflow="crop")
    for number, spans in enumerate(rows):
        if number:
            whole.append("\n")
        for span in spans:
            whole.append(span.text, STYLES[span.tone])
    return whole
