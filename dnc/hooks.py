"""The event hook: a command or a web address that hears of every change of state and every alarm."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import shlex
import subprocess
import urllib.error
import urllib.parse
import urllib.request
from enum import Enum

from dnc.errors import SettingsRejected
from dnc.eventlog import Listener
from dnc.events import Alarm, Event, StateChanged

_TIMEOUT_S = 5.0


def hooks_of(command: str | None, url: str | None) -> list[Listener]:
    """The hooks that were asked for; a hook that fails changes nothing for the job."""
    hooks: list[Listener] = []
    if command is not None:
        words = _words(command)
        hooks.append(lambda event: _run(words, event))
    if url is not None:
        if urllib.parse.urlsplit(url).scheme not in ("http", "https"):
            raise SettingsRejected(f"webhook {url!r} is no web address", remedy="begin it with http:// or https://")
        hooks.append(lambda event: _post(url, event))
    return hooks


def event_json(event: Event) -> str:
    """An event as one JSON object with its kind."""
    values = {name: value.value if isinstance(value, Enum) else value for name, value in _fields(event)}
    return json.dumps({"event": type(event).__name__, **values})


def _fields(event: Event) -> list[tuple[str, object]]:
    return [(field.name, getattr(event, field.name)) for field in dataclasses.fields(event)]


def _words(command: str) -> list[str]:
    try:
        words = shlex.split(command)
    except ValueError as problem:
        raise SettingsRejected(f"hook {command!r}: {problem}", remedy="quote it as for a shell") from None
    if not words:
        raise SettingsRejected("the hook is empty", remedy="name a command")
    return words


def _run(words: list[str], event: Event) -> None:
    if isinstance(event, StateChanged | Alarm):
        with contextlib.suppress(OSError, subprocess.SubprocessError):
            subprocess.run(
                words,
                input=event_json(event).encode(),
                timeout=_TIMEOUT_S,
                check=False,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )


def _post(url: str, event: Event) -> None:
    if not isinstance(event, StateChanged | Alarm):
        return
    head = {"Content-Type": "application/json"}
    request = urllib.request.Request(url, event_json(event).encode(), head)  # noqa: S310 (scheme checked in hooks_of)
    with (
        contextlib.suppress(OSError, urllib.error.URLError, ValueError),
        urllib.request.urlopen(  # noqa: S310 (same)
            request, timeout=_TIMEOUT_S
        ),
    ):
        pass
