"""The job's socket outlives whatever a watcher does to it (5.10; fault O6)."""

from __future__ import annotations

import json
import os
import select
import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from dnc.eventlog import EventLog
from dnc.names import JobNames
from dnc.port import SerialPort
from dnc.profile import load_profile
from dnc.service.publisher import Publisher
from dnc.service.snapshot import JobView
from dnc.shipped import shipped_path
from dnc.stream import Command
from tests.helpers.line import sender_of, tape_of


@contextmanager
def published(folder: Path, ordered: list[Command]) -> Iterator[Path]:
    """A job that is under way, and its socket."""
    profile = load_profile(shipped_path("machines", "sinumerik-840d"))
    master, slave = os.openpty()
    port = SerialPort(os.ttyname(slave), profile.link)
    with closing(tape_of(folder, b"N1 G1 X1\nM30\n")) as tape:
        sender = sender_of(tape)
        sender.start(0.0)
        view = JobView(sender, port, profile, JobNames("1", "part.mpf", "sinumerik-840d"), EventLog([]))
        publisher = Publisher(folder, view, ordered.append)
        assert publisher.start()
        yield publisher.path
        publisher.close()
    port.close()
    os.close(master)
    os.close(slave)


@contextmanager
def watcher(path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX) as end:
        end.settimeout(10.0)
        end.connect(str(path))
        yield end


def answers(end: socket.socket, count: int) -> list[dict[str, object]]:
    """So many answers to orders; snapshots between them are left out."""
    found: list[dict[str, object]] = []
    with end.makefile("rb") as lines:
        while len(found) < count:
            line = next(lines)
            found += [json.loads(line)] if b'"answer"' in line else []
    return found


def test_an_order_nested_without_end_is_refused_like_any_other(tmp_path: Path) -> None:
    """It ended the thread that publishes: no console saw the job any more, and none could abort it."""
    ordered: list[Command] = []
    with published(tmp_path, ordered) as path, watcher(path) as end:
        end.sendall(b"[" * 4000 + b"\n")
        assert answers(end, 1)[0]["answer"] == "refused"
        end.sendall(b'{"do": "lease"}\n{"do": "abort"}\n')
        assert [one["answer"] for one in answers(end, 2)] == ["ok", "ok"]
    assert ordered == [Command.ABORT]


def test_a_watcher_that_has_gone_does_not_keep_the_lease(tmp_path: Path) -> None:
    """What it had asked for behind its last answer was obeyed after it was dropped, and nobody else could act then."""
    with published(tmp_path, []) as path, watcher(path) as end, watcher(path) as gone:
        assert end.recv(1)
        gone.sendall(b'{"do": "lease"}\n' * 2000)  # and reads no answer until it is dropped for that
        dropped = select.poll()
        dropped.register(gone, 0)
        assert dropped.poll(10_000)
        end.sendall(b'{"do": "lease"}\n')
        assert answers(end, 1) == [{"answer": "ok", "do": "lease"}]
