"""The virtual mill as a child process, for `dnc send --dry-run`; it sees only the bytes on its pty.

The rehearsal is over when the mill has cut what it was sent, not when the last byte has left: what it found is told.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

from dnc.errors import ExitCode, PortUnavailable
from dnc.profile import Link
from sim.lifeline import end_with_parent

_READY_S = 30.0
_END_S = 60.0
_SLACK_S = 15.0
_TOLD_S = 2.0
_START_RULES = {"immediate": "immediate", "wait-xon": "repeat-xon"}


@dataclass(frozen=True, slots=True)
class Wanted:
    """The mill of a rehearsal: its profile, the line as it is sent to, time scale, the job that tells tool radii."""

    machine: str
    link: Link
    speed: float
    programs: Path
    job: Path | None


class Rehearsal:
    """A running mill: its pty, the baud rate that counts there, where its status is read, its verdict at the end."""

    def __init__(self, child: subprocess.Popen[bytes], report: Path, speed: float) -> None:
        self._child, self._report, self._speed = child, report, speed
        ready = _first_line(child)
        self.pty, self.baud = str(ready["pty"]), round(float(ready["effective_baud"]))
        self.modbus = str(ready["modbus"])

    @contextlib.contextmanager
    def ended_by_signals(self) -> Iterator[list[int]]:
        """Inside, SIGINT and SIGTERM end the mill and nothing else; yields the list of those that came."""
        heard: list[int] = []

        def on_signal(number: int, _frame: FrameType | None) -> None:
            heard.append(number)
            self._child.terminate()

        before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield heard
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def ending(self, machining_s: float, say: Callable[[str], None]) -> tuple[ExitCode, str]:
        """Wait until the mill has cut what it was sent; the exit code and what it found, as the end of a sentence.

        `machining_s` is how long this takes at speed 1 by the plan.
        """
        planned_s = machining_s / self._speed
        if planned_s > _TOLD_S:
            say(f"all bytes sent; the virtual mill needs about {planned_s:.0f} s for them, Ctrl-C ends the rehearsal")
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._child.wait(1.5 * planned_s + _SLACK_S)
        _end(self._child)
        return _verdict(json.loads(self._report.read_text()) if self._report.is_file() else None)


@contextlib.contextmanager
def rehearsal_mill(wanted: Wanted) -> Iterator[Rehearsal]:
    """Start `dnc mill` and give the rehearsal; the mill is ended afterwards.

    `wanted.programs` is the folder of the subprograms that it has in its memory.
    """
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "mill.json"
        words = [*("--machine", wanted.machine), *("--speed", str(wanted.speed)), *("--programs", str(wanted.programs))]
        words += [*("--baud", str(wanted.link.baud)), *("--format", wanted.link.format)]
        words += [*("--fault", f"start={_START_RULES[wanted.link.start]}")]
        words += [] if wanted.job is None else ["--nominal", str(wanted.job)]
        words += ["--end-on-alarm", "--report", str(report)]
        child = subprocess.Popen(
            [sys.executable, "-m", "dnc", "mill", *words],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            start_new_session=True,
            preexec_fn=partial(end_with_parent, os.getpid()),  # noqa: PLW1509 (no thread of ours runs yet)
        )
        try:
            yield Rehearsal(child, report, wanted.speed)
        finally:
            _end(child)
            if child.stdout is not None:
                child.stdout.close()


def _verdict(report: dict[str, Any] | None) -> tuple[ExitCode, str]:
    if report is None:
        return ExitCode.INTERNAL, "the virtual mill ended without a report; run dnc mill to see why"
    if report["alarms"]:
        alarm = report["alarms"][0]
        return ExitCode.CONTROL, f"the mill alarmed in line {alarm['line']}: {alarm['number']} {alarm['text']}"
    if not report["is_completed"]:
        state = report["execution"]
        what = f"the mill did not come to the end of the program, it stands {state}"
        return ExitCode.LINE, f"{what}; is there an M30, and an end of line behind it?"
    minutes, seconds = divmod(round(report["machining_time_s"]), 60)
    found = f"the mill came to the end of the program after {minutes}:{seconds:02d} min"
    if report["starved_s"] > 0.0:
        found += f", {report['starved_s']:.1f} s of it waiting for blocks"
    if "scallop_mm" in report:
        found += f"; scallop {1000 * report['scallop_mm']:.2f} um, gouge {1000 * report['gouge_mm']:.2f} um"
    return ExitCode.OK, found


def _first_line(child: subprocess.Popen[bytes]) -> dict[str, Any]:
    assert child.stdout is not None
    readable, _, _ = select.select([child.stdout], [], [], _READY_S)
    line = child.stdout.readline() if readable else b""
    try:
        ready = json.loads(line)
        return {key: ready[key] for key in ("pty", "effective_baud", "modbus")}
    except (ValueError, KeyError, TypeError):
        raise PortUnavailable("the virtual mill did not start; run dnc mill to see why") from None


def _end(child: subprocess.Popen[bytes]) -> None:
    """Ask it to end, with time to write its report; harmless when it has ended."""
    if child.poll() is not None:
        return
    child.terminate()
    try:
        child.wait(_END_S)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()
