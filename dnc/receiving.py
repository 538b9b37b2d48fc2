"""What `dnc receive` does: listen on a port and put away the programs that the control punches out."""

from __future__ import annotations

import hashlib
import os
import select
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from dnc.errors import InputRejected, UserError
from dnc.port import Port
from dnc.punch_in import PunchIn, Received

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@dataclass(frozen=True, slots=True)
class Stored:
    """A program as it lies in the folder now; one that is not whole bears the ending .partial."""

    path: Path
    size_bytes: int
    sha256: str
    ended_by: str
    is_new: bool
    is_whole: bool


@dataclass(frozen=True, slots=True)
class Haul:
    """All that came, and what ended the listening too early, if anything did: a signal, or a fault of port or disk."""

    stored: list[Stored]
    signal: int | None
    fault: UserError | None = None


def receive(
    port: Port, punch_in: PunchIn, folder: Path, count: int, wait_s: float, say: Callable[[Stored], None]
) -> Haul:
    """Listen for `count` programs (0: no limit), until nothing came for `wait_s` (0: for ever), or a signal.

    Whatever ends it, a lost port included, what came of a program that is under way is stored too, and all is told.
    """
    stored: list[Stored] = []
    signals: list[int] = []
    fault: UserError | None = None

    def keep(programs: list[Received]) -> None:
        for program in programs:
            stored.append(put_away(program, folder))
            say(stored[-1])

    stop_read, stop_write = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)

    def on_signal(number: int, _frame: FrameType | None) -> None:
        signals.append(number)
        os.write(stop_write, b"!")

    before = {number: signal.signal(number, on_signal) for number in _ENDING}
    try:
        quiet_since_s = time.monotonic()
        while not 0 < count <= len(stored):
            now_s = time.monotonic()
            until_s = min(punch_in.next_wake_s, quiet_since_s + wait_s if wait_s > 0 else now_s + 3600)
            ready, _, _ = select.select([port.fileno(), stop_read], [], [], max(0.0, until_s - now_s))
            now_s = time.monotonic()
            keep(punch_in.tick(now_s))
            if port.fileno() in ready:
                keep(punch_in.hear(port.read(), now_s))
                quiet_since_s = now_s
            if stop_read in ready or (not ready and 0 < wait_s <= now_s - quiet_since_s):
                break
    except UserError as problem:
        fault = problem
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        os.close(stop_read)
        os.close(stop_write)
    try:
        if not 0 < count <= len(stored):
            keep(punch_in.break_off())
    except UserError as problem:
        fault = fault or problem
    return Haul(stored, signals[0] if signals else None, fault)


def put_away(program: Received, folder: Path) -> Stored:
    """Write a program under its own name; an equal file is left alone, a different one keeps its name."""
    unfinished = folder / f".receiving-{os.getpid()}.tmp"
    try:
        unfinished.write_bytes(program.data)
        path, is_new = _linked(unfinished, folder, program)
    except OSError as problem:
        raise InputRejected(f"the program cannot be stored: {problem.strerror}", path=folder) from None
    finally:
        unfinished.unlink(missing_ok=True)
    sha256 = hashlib.sha256(program.data).hexdigest()
    return Stored(path, len(program.data), sha256, program.end.value, is_new, program.end.is_whole)


def _linked(unfinished: Path, folder: Path, program: Received) -> tuple[Path, bool]:
    name = program.name if program.end.is_whole else f"{program.name}.partial"
    stem, dot, suffix = name.partition(".")
    number = 1
    while True:
        path = folder / (name if number == 1 else f"{stem}-{number}{dot}{suffix}")
        try:
            path.hardlink_to(unfinished)
        except FileExistsError:
            if path.is_file() and path.stat().st_size == len(program.data) and path.read_bytes() == program.data:
                return path, False
            number += 1
            continue
        return path, True
