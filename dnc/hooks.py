"""The event hook: a command or a web address that hears of a job's alarms and of its changes of state.

The control's own stops, SENDING to HELD and back, are left out: there are hundreds in a minute, and a hold that lasts
is an alarm. Each message is one JSON object that says which job, program, machine and port it is about.
"""

from __future__ import annotations

import dataclasses
import json
import os
import shlex
import shutil
import signal
import subprocess
import threading
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable
from datetime import UTC, datetime
from enum import Enum
from http.client import HTTPException
from typing import Any

from dnc.errors import SettingsRejected
from dnc.eventlog import Listener
from dnc.events import Alarm, Event, JobState, StateChanged

_TIMEOUT_S = 5.0
_COMES_AND_GOES = {JobState.SENDING, JobState.HELD}


def hooks_of(command: str | None, url: str | None, about: dict[str, Any], say: Callable[[str], None]) -> list[Listener]:
    """The hooks that were asked for; raises SettingsRejected for one that cannot work.

    `about` goes into each message. A hook that fails later changes nothing for the job; `say` hears of it once.
    """
    hooks: list[Listener] = []
    if command is not None:
        words = _words(command)
        hooks.append(_Hook(f"hook {words[0]}", lambda data: _run(words, data), about, say))
    if url is not None:
        if urllib.parse.urlsplit(url).scheme not in ("http", "https"):
            raise SettingsRejected(f"webhook {url!r} is no web address", remedy="begin it with http:// or https://")
        hooks.append(_Hook(f"webhook {url}", lambda data: _post_in_time(url, data), about, say))
    return hooks


class _Hook:
    """Delivers the events that matter, and says once that it cannot."""

    def __init__(
        self, name: str, deliver: Callable[[bytes], None], about: dict[str, Any], say: Callable[[str], None]
    ) -> None:
        self._name, self._deliver, self._about, self._say = name, deliver, about, say
        self._is_broken = False

    def __call__(self, event: Event) -> None:
        if not _is_news(event):
            return
        try:
            self._deliver(message(event, self._about))
        except (OSError, subprocess.SubprocessError, HTTPException, ValueError) as problem:
            if not self._is_broken:
                self._say(f"{self._name} failed: {_in_words(problem)}; the job goes on")
            self._is_broken = True


def message(event: Event, about: dict[str, Any]) -> bytes:
    """An event as one JSON object: its kind, the time of day, what it is about, its own values."""
    values = {field.name: getattr(event, field.name) for field in dataclasses.fields(event)}
    plain = {name: value.value if isinstance(value, Enum) else value for name, value in values.items()}
    now = datetime.now(UTC).isoformat(timespec="milliseconds")
    return json.dumps({"event": type(event).__name__, "time": now, **about, **plain}).encode()


def _in_words(problem: Exception) -> str:
    """What the system said of it, without the library's brackets around."""
    if isinstance(problem, subprocess.CalledProcessError):
        return f"it ended with exit code {problem.returncode}"
    if isinstance(problem, subprocess.TimeoutExpired):
        return f"it took longer than {_TIMEOUT_S:g} s"
    is_answer = isinstance(problem, urllib.error.HTTPError)
    reason = problem.reason if isinstance(problem, urllib.error.URLError) and not is_answer else problem
    return (reason.strerror if isinstance(reason, OSError) else None) or str(reason)


def _is_news(event: Event) -> bool:
    if isinstance(event, StateChanged):
        return not {event.old, event.new} <= _COMES_AND_GOES
    return isinstance(event, Alarm)


def _words(command: str) -> list[str]:
    try:
        words = shlex.split(command)
    except ValueError as problem:
        raise SettingsRejected(f"hook {command!r}: {problem}", remedy="quote it as for a shell") from None
    if not words:
        raise SettingsRejected("the hook is empty", remedy="name a command")
    if shutil.which(words[0]) is None:
        raise SettingsRejected(
            f"hook {words[0]!r} is no command that can run", remedy="give its path, make it executable"
        )
    return words


def _run(words: list[str], data: bytes) -> None:
    """Run a command to its end; one that takes too long is killed with all it has started.

    Its group is its own: what a script waits for would outlive it, one more at each event, and the operator's Ctrl-C
    at the terminal is meant for the job.
    """
    quiet = subprocess.DEVNULL
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet, process_group=0) as child:
        try:
            child.communicate(data, timeout=_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            os.killpg(child.pid, signal.SIGKILL)
            raise
    if child.returncode:
        raise subprocess.CalledProcessError(child.returncode, words)


def _post_in_time(url: str, data: bytes) -> None:
    """As `_post`, given up after a time: a server that says a byte now and then keeps the library waiting for ever."""
    problems: list[Exception] = []

    def work() -> None:
        try:
            _post(url, data)
        except (OSError, HTTPException, ValueError) as problem:
            problems.append(problem)

    thread = threading.Thread(target=work, name="webhook", daemon=True)
    thread.start()
    thread.join(_TIMEOUT_S)
    if thread.is_alive():
        raise TimeoutError(f"it took longer than {_TIMEOUT_S:g} s")
    if problems:
        raise problems[0]


def _post(url: str, data: bytes) -> None:
    head = {"Content-Type": "application/json"}
    request = urllib.request.Request(url, data, head)  # noqa: S310 (scheme checked in hooks_of)
    try:
        urllib.request.urlopen(request, timeout=_TIMEOUT_S).close()  # noqa: S310 (same)
    except urllib.error.HTTPError as answer:
        answer.close()  # it holds the connection
        raise
