"""The event hook: a real command and a real web server hear what matters, and never in the way of the job (5.7)."""

from __future__ import annotations

import http.server
import json
import os
import select
import socket
import socketserver
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from dnc import alarms
from dnc.errors import SettingsRejected
from dnc.eventlog import EventLog
from dnc.events import Alarm, Event, Held, JobState, StateChanged
from dnc.hooks import hooks_of

ABOUT = {"job": "J1", "program": "part.mpf", "machine": "mill", "port": "/dev/ttyS0", "simulated": False}
STARTED = StateChanged(1.0, 0, JobState.LOADED, JobState.SENDING, "the operator started the job")
STOPPED = StateChanged(2.0, 50, JobState.SENDING, JobState.HELD, "the control sent XOFF")
GONE_ON = StateChanged(3.0, 50, JobState.HELD, JobState.SENDING, "the control sent XON")
LOST = StateChanged(4.0, 60, JobState.SENDING, JobState.FAULTED, "the port was lost")


def tell(listener: Any, *events: Event) -> None:
    for event in events:
        listener(event)


def test_a_command_hears_alarms_and_changes_but_not_the_controls_stops(tmp_path: Path) -> None:
    """(5.7)"""
    script = tmp_path / "hook.sh"
    script.write_text(f"#!/bin/sh\ncat >> {tmp_path}/heard\necho >> {tmp_path}/heard\n")
    script.chmod(0o755)
    said: list[str] = []
    (hook,) = hooks_of(str(script), None, ABOUT, said.append)
    tell(hook, STARTED, STOPPED, Held(2.0, 50, 3, False), GONE_ON, alarms.PORT_LOST.at(4.0, 60, "unplugged"), LOST)
    heard = [json.loads(line) for line in (tmp_path / "heard").read_text().splitlines()]
    assert [item["event"] for item in heard] == ["StateChanged", "Alarm", "StateChanged"]
    assert [item.get("new") for item in heard] == ["SENDING", None, "FAULTED"]
    assert all(item["job"] == "J1" and item["machine"] == "mill" and item["time"] for item in heard)
    assert heard[1]["remedy"]
    assert said == []


class Server(http.server.ThreadingHTTPServer):
    """Keeps what is posted and answers with `status`."""

    def __init__(self, status: int) -> None:
        super().__init__(("127.0.0.1", 0), Answer)
        self.status = status
        self.heard: list[dict[str, Any]] = []


class Answer(http.server.BaseHTTPRequestHandler):
    server: Server

    def do_POST(self) -> None:
        """Keep one message."""
        self.server.heard.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
        self.send_response(self.server.status)
        self.end_headers()

    def log_message(self, *_words: object) -> None:
        """Say nothing."""


@pytest.fixture(params=[204, 500])
def server(request: pytest.FixtureRequest) -> Iterator[Server]:
    with Server(request.param) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()


def test_a_web_address_hears_the_same_and_a_failure_is_said_once(server: Server) -> None:
    """(5.7)"""
    said: list[str] = []
    (hook,) = hooks_of(None, f"http://127.0.0.1:{server.server_port}/mill", ABOUT, said.append)
    tell(hook, STARTED, LOST)
    assert [item["new"] for item in server.heard] == ["SENDING", "FAULTED"]
    assert len(said) == (server.status == 500)
    assert all("500" in sentence and sentence.endswith("the job goes on") for sentence in said)


@pytest.mark.parametrize(
    ("command", "url", "words"),
    [
        ("/no/such/command -x", None, "no command that can run"),
        ("'", None, "quote it"),
        (" ", None, "empty"),
        (None, "ftp://here", "http://"),
    ],
)
def test_a_hook_that_cannot_work_is_refused(command: str | None, url: str | None, words: str) -> None:
    """(5.7)"""
    with pytest.raises(SettingsRejected, match=words):
        hooks_of(command, url, ABOUT, print)


def test_a_command_that_fails_is_said_once() -> None:
    """(5.7)"""
    said: list[str] = []
    (hook,) = hooks_of("false", None, ABOUT, said.append)
    tell(hook, STARTED, LOST)
    assert said == ["hook false failed: it ended with exit code 1; the job goes on"]


class Slow:
    """A listener that answers nothing until it is released."""

    def __init__(self) -> None:
        self.begun, self.release = threading.Event(), threading.Event()
        self.told: list[Event] = []

    def __call__(self, event: Event) -> None:
        self.begun.set()
        self.release.wait(10)
        self.told.append(event)


def test_an_address_where_nobody_listens_is_said_in_words() -> None:
    """(5.7) In the system's words, not in the library's brackets."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{taken.getsockname()[1]}/mill"
        said: list[str] = []
        (hook,) = hooks_of(None, url, ABOUT, said.append)
        hook(alarms.LOOPBACK.at(1.0, 0, ""))
    assert said == [f"webhook {url} failed: Connection refused; the job goes on"]


def test_a_listener_that_hangs_delays_no_other() -> None:
    """(5.7) The operator's lines appear though a web address does not answer."""
    slow, shown = Slow(), threading.Event()
    log = EventLog([slow, lambda event: shown.set()])
    log.add(STARTED)
    assert shown.wait(10)
    slow.release.set()
    log.close()


def test_a_slow_listener_hears_the_end_of_the_job() -> None:
    """(5.7) What came before is left out, and counted: why the job ended must get through."""
    slow = Slow()
    log = EventLog([slow])
    ending = [alarms.PORT_LOST.at(4.0, 60, "unplugged"), LOST]
    log.add(STARTED)
    assert slow.begun.wait(10)
    for event in [*[STOPPED, GONE_ON] * 50, *ending]:
        log.add(event)
    threading.Timer(0.3, slow.release.set).start()
    assert log.close(patience_s=0.0) == 99
    assert slow.told == [STARTED, GONE_ON, *ending]


def test_events_that_nobody_heard_are_counted() -> None:
    """(5.7) A web address that never answers does not hold the end of the job, and the operator is told."""
    slow = Slow()
    log = EventLog([slow])
    log.add(STARTED)
    assert slow.begun.wait(10)
    log.add(LOST)
    assert log.close(patience_s=0.0, last_s=0.0) == 2
    slow.release.set()


def test_an_alarm_is_told_each_time_and_kept_once() -> None:
    """(5.7) The job that stops again after a resume says why again; a warning is said once."""
    told: list[Event] = []
    log = EventLog([told.append])
    for _ in range(3):
        log.add(alarms.TOO_NOISY.at(1.0, 10))
        log.add(alarms.LONG_HOLD.at(1.0, 10))
    log.close()
    assert [alarm.id for alarm in told if isinstance(alarm, Alarm)] == ["DNC-L14P", "DNC-L1", "DNC-L14P", "DNC-L14P"]
    assert [alarm.id for alarm in log.alarms] == ["DNC-L14P", "DNC-L1"]


def test_a_command_that_hangs_is_said_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.7) It is given up after a time; the library's own sentence had the time with 15 digits."""
    monkeypatch.setattr("dnc.hooks._TIMEOUT_S", 0.05)
    said: list[str] = []
    (hook,) = hooks_of("sleep 60", None, ABOUT, said.append)
    tell(hook, STARTED, LOST)
    assert said == ["hook sleep failed: it took longer than 0.05 s; the job goes on"]


def test_a_command_that_hangs_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.7) What a script waits for outlived it: one more at each event, on the computer that feeds the mill."""
    monkeypatch.setattr("dnc.hooks._TIMEOUT_S", 0.5)
    script, alive = tmp_path / "hook.sh", tmp_path / "alive"
    os.mkfifo(alive)
    script.write_text(f"#!/bin/sh\nsleep 600 > {alive}\n")
    script.chmod(0o755)
    said: list[str] = []
    (hook,) = hooks_of(str(script), None, ABOUT, said.append)
    reader = os.open(alive, os.O_RDONLY | os.O_NONBLOCK)
    try:
        tell(hook, STARTED)
        ended = select.poll()
        ended.register(reader, select.POLLIN)
        assert ended.poll(10_000) == [(reader, select.POLLHUP)]
    finally:
        os.close(reader)
    assert len(said) == 1


def test_a_web_address_that_answers_for_ever_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.7) A byte now and then kept each wait of the library short: nothing more was delivered, and nobody told."""
    monkeypatch.setattr("dnc.hooks._TIMEOUT_S", 0.2)
    is_over, said = threading.Event(), list[str]()

    class Trickle(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            """One endless head."""
            self.request.sendall(b"HTTP/1.1 200 OK\r\nX-Mill: ")
            while not is_over.wait(0.02):
                self.request.sendall(b"a")

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Trickle) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        url = f"http://127.0.0.1:{server.server_address[1]}/mill"
        (hook,) = hooks_of(None, url, ABOUT, said.append)
        told = threading.Thread(target=tell, args=(hook, STARTED, LOST), daemon=True)
        told.start()
        told.join(10)
        is_over.set()
        server.shutdown()
    assert said == [f"webhook {url} failed: it took longer than 0.2 s; the job goes on"]
