"""The virtual mill from start to report: the line here, the control in a child process, one report at the end."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import select
import signal
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, TypeVar

from planner.errors import ExitCode, UserError
from planner.files import check_outputs, write_file
from sim.clock import MachineClock
from sim.control_process import run_control
from sim.endpoint_pty import LineProcess, Patience, Pty
from sim.messages import Failed, Finish, Ready, Result, Start, Wire
from sim.setup import Setup
from sim.uart import Uart

SCHEMA = "dripmill.mill"
VERSION = 1
_START_S = 60.0
_RESULT_S = 600.0

T = TypeVar("T", Ready, Result)


@dataclass(frozen=True, slots=True)
class Wishes:
    """What the user asked for beside the machine; `fault_words` are the switches as he wrote them.

    With `ends_on_alarm` an alarm or a reset ends the mill as the program's end does.
    """

    seed: int
    fault_words: tuple[str, ...]
    link: Path | None
    report: Path | None
    ends_on_alarm: bool = False


def run_mill(setup: Setup, wishes: Wishes, announce: Callable[[dict[str, Any]], None]) -> int:
    """Run until the program has ended and the line is quiet, or a signal comes; the exit code.

    `announce` is given one value when the mill is ready. Raises SettingsRejected or InputRejected with one sentence.
    """
    check_outputs([wishes.report, setup.motion, setup.plot], [setup.nominal])
    with _signals() as stop, contextlib.closing(Pty(wishes.link)) as pty, _child(setup) as (child, wire):
        ready = _wait_for(wire, child, Ready, _START_S, stop.fd)
        if ready is None:
            return stop.exit_code()
        uart = Uart(setup.profile, setup.faults, wishes.seed)
        begun_s = time.monotonic()
        patience = Patience(ends_on_alarm=wishes.ends_on_alarm)
        line = LineProcess(pty, uart, wire, MachineClock(setup.speed, begun_s), patience)
        wire.send(Start(begun_s))
        announce(_announcement(setup, wishes, pty, ready))
        is_over = line.run(stop.fd)
        report = line.report()
        wire.send(Finish())
        result = _wait_for(wire, child, Result, _RESULT_S, None)
        if wishes.report is not None and result is not None:
            whole = {**_heading(setup, wishes), **report, **json.loads(result.report)}
            write_file(wishes.report, f"{json.dumps(whole, indent=1)}\n".encode())
        return int(ExitCode.OK) if is_over else stop.exit_code()


def _announcement(setup: Setup, wishes: Wishes, pty: Pty, ready: Ready) -> dict[str, Any]:
    return {
        "schema": f"{SCHEMA}-ready",
        "version": VERSION,
        "simulated": True,
        "pty": pty.name,
        "link": None if wishes.link is None else str(wishes.link),
        "modbus": ready.modbus,
        "effective_baud": round(setup.profile.baud * setup.speed),
        "line_baud": round(setup.profile.baud * setup.speed),
        "time_scale": setup.speed,
        "pid": os.getpid(),
    }


def _heading(setup: Setup, wishes: Wishes) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "version": VERSION,
        "simulated": True,
        "line_baud": round(setup.profile.baud * setup.speed),
        "time_scale": setup.speed,
        "seed": wishes.seed,
        "faults": list(wishes.fault_words),
        "receive_buffer_bytes": setup.profile.receive_buffer_bytes,
        "fifo_bytes": setup.faults.fifo,
    }


class _Stop:
    """Signals that ask for the end, as something select can wait for."""

    def __init__(self) -> None:
        self.fd, self._write_fd = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        self._number = 0

    def ask(self, number: int, _frame: object) -> None:
        """The handler."""
        self._number = number
        os.write(self._write_fd, b"!")

    def exit_code(self) -> int:
        """128 and the signal; a child that died is an internal fault."""
        return 128 + self._number if self._number else int(ExitCode.INTERNAL)


@contextlib.contextmanager
def _signals() -> Iterator[_Stop]:
    stop = _Stop()
    before = {number: signal.signal(number, stop.ask) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def _child(setup: Setup) -> Iterator[tuple[BaseProcess, Wire]]:
    ours, theirs = socket.socketpair()
    context = multiprocessing.get_context("spawn")
    child = context.Process(target=run_control, args=(theirs, setup), name="control")
    resource_tracker.ensure_running()  # it would let the signals through again if it began only with the child
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        child.start()  # Ctrl-C goes to it too, and while it still loads its parts it would end with a traceback
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    theirs.close()
    try:
        yield child, Wire(ours)
    finally:
        ours.close()
        child.join(5.0)
        if child.is_alive():
            child.kill()
            child.join()


def _wait_for(wire: Wire, child: BaseProcess, kind: type[T], within_s: float, stop_fd: int | None) -> T | None:
    """The next message of this kind; None if a signal came. Raises UserError with the child's sentence if it failed."""
    deadline_s = time.monotonic() + within_s
    while (left_s := deadline_s - time.monotonic()) > 0:
        watched: list[int | Wire] = [wire] if stop_fd is None else [wire, stop_fd]
        readable, _, _ = select.select(watched, [], [], left_s)
        if stop_fd in readable:
            return None
        wire.flush()
        for message in wire.receive():
            if isinstance(message, Failed):
                problem = UserError(message.sentence)
                problem.exit_code = ExitCode(message.exit_code)
                raise problem
            if isinstance(message, kind):
                return message
        if wire.is_closed:
            break
    if not wire.is_closed:
        raise UserError(f"the mill's control process took longer than {within_s:g} s; try again when less else runs")
    raise UserError(f"the mill's control process ended without a word (code {child.exitcode}); please report this")
