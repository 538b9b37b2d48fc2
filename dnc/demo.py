"""The chain of `dnc demo`: every step is a command a user could type, in a process of its own.

So the mill sees nothing but bytes and the surface file, and the demo cannot know more than a user would.
"""

from __future__ import annotations

import json
import os
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from dnc.errors import ExitCode, UserError
from planner.files import made_folder, write_file
from sim.lifeline import end_with_parent

_MEASURED = (
    *("sha256", "is_completed", "alarms", "machining_time_s", "starved_s", "blocks", "peak_acceleration_mm_s2"),
    *("peak_jerk_mm_s3", "scallop_mm", "gouge_mm", "deviation_mm", "coverage", "inaccessible", "probe_pitch_mm"),
    *("probes", "reach_mm", "worst_scallops", "worst_gouges"),
)
_WAITS = re.compile(rb"T\d|S\d|G4 |M8")

Report = dict[str, Any]
Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Settings:
    """What the demo runs: job and machine, the main run's time scale, and the window at true speed.

    `line` are options of `dnc send` that hold the line to what the machine's profile says: a shop's own settings are
    for its cables, and no pseudo-terminal has their modem lines.
    """

    job: Path
    machine: str
    speed: float
    window_s: float
    window_override_percent: float
    probe_pitch_mm: float
    line: tuple[str, ...] = ()


class StepFailed(UserError):
    """A step of the chain failed; carries the step's own sentence and exit code."""

    def __init__(self, step: str, code: int, sentence: str) -> None:
        self.exit_code = ExitCode(code) if code in list(ExitCode) else ExitCode.INTERNAL
        super().__init__(f"{step} failed with code {code}: {sentence}")


def run_chain(folder: Path, settings: Settings, say: Say) -> Report:
    """Plan, check, window at true speed, feed through the virtual mill, measure; writes and returns `report.json`.

    Raises StepFailed with the sentence of the step that failed.
    """
    made_folder(folder)
    program = folder / "part.mpf"
    with ExitStack() as mills:
        say(f"plan     {settings.job.name}; the first time slower, because what must be fast is compiled")
        hurried = mills.enter_context(_window_mill(folder, settings))
        plan = _plan(folder, program, settings)
        say("check    the tape, block by block")
        measuring = mills.enter_context(_measuring_mill(folder, settings))
        check = json.loads(_dnc("check", program, "--machine", settings.machine, "--json"))
        say(f"window   {settings.window_s:g} s of the line at its true speed")
        window = _window(folder, program, settings, hurried)
        say(f"feed     through a pseudo-terminal to the mill, {settings.speed:g} times as fast as life")
        send, mill = _feed(folder, program, settings, measuring, say)
    report = {
        "schema": "dripmill.demo",
        "version": 1,
        "simulated": True,
        "plan": plan,
        "check": check,
        "window": window,
        "send": send,
        "mill": mill,
        "simulate": _simulated(program, settings.machine, mill),
    }
    _write_json(folder / "report.json", report)
    return report


def _simulated(program: Path, machine: str, mill: Report) -> Report:
    """What the mill cut and measured, in the words of the report of `dnc simulate`."""
    heading = {"schema": "dripmill.simulate", "version": 1, "simulated": True}
    return heading | {"program": program.name, "machine": machine} | {key: mill[key] for key in _MEASURED}


def _plan(folder: Path, program: Path, settings: Settings) -> Report:
    report = folder / "plan.json"
    _dnc(
        *("plan", settings.job, "-o", program, "--machine", settings.machine),
        *("--report", report, "--plot", folder / "paths.png"),
    )
    return _read_json(report)


def _window_mill(folder: Path, settings: Settings) -> AbstractContextManager[_Mill]:
    """At true speed, with the feed overridden so that the control asks for bytes often; the line does not know."""
    hurry = ("--fault", f"override={settings.window_override_percent:g}")
    return _mill(settings.machine, 1.0, *hurry, "--report", folder / "window-mill.json")


def _measuring_mill(folder: Path, settings: Settings) -> AbstractContextManager[_Mill]:
    options = ("--nominal", settings.job, "--plot", folder / "deviation.png", "--motion", folder / "motion.csv")
    pitch = ("--probe-pitch", f"{settings.probe_pitch_mm:g}")
    return _mill(settings.machine, settings.speed, *options, *pitch, "--report", folder / "mill.json")


def _window(folder: Path, program: Path, settings: Settings, mill: _Mill) -> Report:
    """Line figures at true speed, stopped by the operator's SIGINT when the window is over.

    The tape is the program without tool change, spindle start and dwell, for which the line would only wait.
    """
    report, tape = folder / "window-send.json", folder / "window.mpf"
    lines = program.read_bytes().splitlines(keepends=True)
    write_file(tape, b"".join(line for line in lines if not _WAITS.match(line)))
    sender = _start("send", tape, *mill.port(settings), "--report", report, stderr=subprocess.PIPE)
    _wait_or_interrupt(sender, settings.window_s)
    mill.stop()
    return {
        "feed_override_percent": settings.window_override_percent,
        "send": _read_json(report),
        "mill": _read_json(folder / "window-mill.json"),
    }


def _feed(folder: Path, program: Path, settings: Settings, mill: _Mill, say: Say) -> tuple[Report, Report]:
    report = folder / "send.json"
    sender = _start("send", program, *mill.port(settings), "--report", report)
    _finish("send", sender)
    say("measure  what the cutter left, along the design's normals")
    _finish("mill", mill.process)
    return _read_json(report), _read_json(folder / "mill.json")


class _Mill:
    """A mill's process; asked where it listens only when that is needed, so that several can start at once."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process

    def port(self, settings: Settings) -> tuple[str, ...]:
        """Options of `dnc send` that lead to this mill; waits until it is ready."""
        said = json.loads(_first_line(self.process, timeout_s=60.0))
        port = ("--port", said["pty"], "--machine", settings.machine, "--baud", str(said["effective_baud"]))
        return (*port, *settings.line)

    def stop(self) -> None:
        """Ask it to end and to write its report, if it has not yet."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        self.process.wait(timeout=30.0)


@contextmanager
def _mill(machine: str, speed: float, *options: str | Path) -> Iterator[_Mill]:
    listening = ("--machine", machine, "--speed", f"{speed:g}", "--modbus", "127.0.0.1:0")
    mill = _Mill(_start("mill", *listening, *options, stdout=subprocess.PIPE))
    try:
        yield mill
    finally:
        mill.stop()
        assert mill.process.stdout is not None
        mill.process.stdout.close()


def _first_line(process: subprocess.Popen[str], timeout_s: float) -> str:
    assert process.stdout is not None
    readable, _, _ = select.select([process.stdout], [], [], timeout_s)
    line = process.stdout.readline() if readable else ""
    if not line:
        raise StepFailed("mill", process.poll() or int(ExitCode.INTERNAL), "it never said that it is ready")
    return line


def _wait_or_interrupt(process: subprocess.Popen[str], time_s: float) -> None:
    try:
        process.wait(timeout=time_s)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=30.0)
    if process.returncode not in (ExitCode.OK, ExitCode.ABORTED):
        raise StepFailed("send", process.returncode, said.strip().removeprefix("dnc: "))


def _finish(step: str, process: subprocess.Popen[str], timeout_s: float = 600.0) -> None:
    try:
        code = process.wait(timeout=timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        raise StepFailed(step, int(ExitCode.INTERNAL), f"not finished after {timeout_s:g} s") from None
    if code != 0:
        raise StepFailed(step, code, "see the message above")


def _start(
    *arguments: str | Path | float, stdout: int | None = None, stderr: int | None = None
) -> subprocess.Popen[str]:
    command = _command(arguments)
    return subprocess.Popen(
        command,
        stdout=stdout,
        stderr=stderr,
        text=True,
        stdin=subprocess.DEVNULL,
        preexec_fn=partial(end_with_parent, os.getpid()),  # noqa: PLW1509 (no thread of ours runs yet)
    )


def _dnc(*arguments: str | Path) -> str:
    done = subprocess.run(_command(arguments), capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    if done.returncode != 0:
        raise StepFailed(str(arguments[0]), done.returncode, done.stderr.strip().removeprefix("dnc: "))
    return done.stdout


def _command(arguments: tuple[str | Path | float, ...]) -> list[str]:
    return [sys.executable, "-m", "dnc", *(str(argument) for argument in arguments)]


def _read_json(path: Path) -> Report:
    report = json.loads(path.read_text())
    assert isinstance(report, dict)
    return report


def _write_json(path: Path, report: Report) -> None:
    write_file(path, f"{json.dumps(report, indent=1)}\n".encode())


def elapsed(say: Say) -> Say:
    """The same voice, with the seconds since now in front of every line."""
    begin_s = time.monotonic()

    def said(text: str) -> None:
        say(f"{time.monotonic() - begin_s:6.1f} s  {text}")

    return said
