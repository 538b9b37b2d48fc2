"""The console under Textual's own driver, attached to a real socket and a real Modbus server; and under tmux."""

from __future__ import annotations

import asyncio
import contextlib
import json
import shutil
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from dnc.console.app import Console, Machine
from dnc.console.rows import text_of
from dnc.profile import Modbus
from dnc.shipped import shipped_path
from dnc.status.job import JobWatcher
from sim.control import Execution
from sim.endpoint_modbus import ModbusEnd
from sim.panel import Panel
from tests.dnc.console.test_view import SNAPSHOT

PROFILE = shipped_path("machines", "sinumerik-840d")


class Job:
    """A job's socket as `dnc send` serves it: snapshots out, orders in."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "job-20261122T000000-1.sock"
        self.orders: list[str] = []
        self.snapshot = dict(SNAPSHOT, program=str(folder / "absent.mpf"))
        self.is_asked = asyncio.Event()

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        async def publish() -> None:
            while True:
                writer.write(json.dumps(self.snapshot).encode() + b"\n")
                await asyncio.sleep(0.05)

        task = asyncio.create_task(publish())
        with contextlib.suppress(ConnectionError):
            while line := await reader.readline():
                self.orders.append(json.loads(line)["do"])
                self.is_asked.set()
        task.cancel()
        writer.close()


@contextlib.asynccontextmanager
async def published(folder: Path) -> AsyncIterator[Job]:
    job = Job(folder)
    server = await asyncio.start_unix_server(job.serve, str(job.path))
    try:
        yield job
    finally:
        server.close()


def console(folder: Path, port: int = 1) -> Console:
    return Console(Machine("MILL-2", PROFILE), Modbus(port=port), JobWatcher(folder, retry_s=0.05), redraw_s=0.05)


async def until(pilot: object, app: Console, wanted: Callable[[str], bool]) -> str:
    """The screen's text as soon as it is as wanted."""
    end_s = time.monotonic() + 10.0
    while not wanted(text := text_of(app.face)):
        assert time.monotonic() < end_s, text
        await pilot.pause(0.02)  # type: ignore[attr-defined]
    return text


async def test_it_shows_job_and_machine(tmp_path: Path) -> None:
    """(2.2): 80x24, from the socket and from Modbus."""
    end = ModbusEnd("127.0.0.1", 0)
    end.show(Panel(execution=Execution.ACTIVE, position_mm=(12.402, 0.0, 0.0), block=27))
    end.start()
    app = console(tmp_path, end.port)
    async with published(tmp_path), app.run_test(headless=True, size=(80, 24)) as pilot:
        text = await until(pilot, app, lambda text: "SENDING" in text and "ACTIVE" in text)
        assert "12.402" in text
        assert "control at N27" in text
    await asyncio.to_thread(end.stop)


async def test_hold_takes_one_key_resume_and_abort_take_two(tmp_path: Path) -> None:
    """(2.2, O6)"""
    app = console(tmp_path)
    async with published(tmp_path) as job, app.run_test(headless=True, size=(80, 24)) as pilot:
        await until(pilot, app, lambda text: "SENDING" in text)
        await pilot.press("f8")
        await until(pilot, app, lambda text: "ABORT?" in text)
        await pilot.press("f8")
        await until(pilot, app, lambda text: "no abort" in text)
        await pilot.press("f5", "space")
        await until(pilot, app, lambda text: "no resume" in text)
        assert job.orders == []
        await pilot.press("space")
        await job.is_asked.wait()
        await pilot.press("f5", "enter", "x", "a")
        while len(job.orders) < 9:
            await pilot.pause(0.02)
        assert [order for order in job.orders if order not in ("lease", "release")] == ["pause", "resume", "abort"]


async def test_what_was_asked_gives_way_to_what_to_do_now(tmp_path: Path) -> None:
    """(2.2) `asked the job: pause` stood there for ever, where it should say how to go on."""
    app = console(tmp_path)
    async with published(tmp_path) as job, app.run_test(headless=True, size=(80, 24)) as pilot:
        await until(pilot, app, lambda text: "SENDING" in text)
        await pilot.press("space")
        await until(pilot, app, lambda text: "asked the job: pause" in text)
        job.snapshot["state"] = "PAUSED"
        await until(pilot, app, lambda text: "Paused. F5 then Enter goes on" in text)
        await pilot.press("f5", "enter")
        await until(pilot, app, lambda text: "asked the job: resume" in text)


async def test_without_a_job_a_key_says_so(tmp_path: Path) -> None:
    app = console(tmp_path)
    async with app.run_test(headless=True, size=(80, 24)) as pilot:
        await pilot.press("f6")
        await until(pilot, app, lambda text: "there is no job to ask" in text)
        await pilot.press("question_mark")
        await until(pilot, app, lambda text: "No key here is an emergency stop" in text)


async def test_ctrl_s_and_ctrl_q_do_nothing(tmp_path: Path) -> None:
    """(2.2, O5)"""
    app = console(tmp_path)
    async with published(tmp_path) as job, app.run_test(headless=True, size=(80, 24)) as pilot:
        await until(pilot, app, lambda text: "SENDING" in text)
        await pilot.press("ctrl+s", "ctrl+q", "ctrl+p", "escape")
        await pilot.pause(0.1)
        assert app.is_running
        assert (app.question, app.notice, job.orders) == ("", "", [])
        await pilot.press("f10")
        await pilot.pause()
        assert not app.is_running


async def test_a_pasted_text_is_not_obeyed(tmp_path: Path) -> None:
    """(2.2, O9)"""
    from textual.events import Paste

    app = console(tmp_path)
    async with published(tmp_path) as job, app.run_test(headless=True, size=(80, 24)) as pilot:
        await until(pilot, app, lambda text: "SENDING" in text)
        app.post_message(Paste("hxa"))
        await pilot.pause(0.1)
        assert job.orders == []


async def test_a_job_that_ends_is_kept_and_the_next_one_is_found(tmp_path: Path) -> None:
    """(2.2)"""
    app = console(tmp_path)
    async with app.run_test(headless=True, size=(80, 24)) as pilot:
        await until(pilot, app, lambda text: "NO JOB" in text)
        async with published(tmp_path) as job:
            await until(pilot, app, lambda text: "SENDING" in text)
            job.snapshot["state"] = "SENT"
            await until(pilot, app, lambda text: "### SENT ###" in text)


@pytest.mark.debian
@pytest.mark.skipif(shutil.which("tmux") is None, reason="needs the Debian package tmux")
def test_in_a_real_terminal_and_killed(tmp_path: Path) -> None:
    """(2.2, O2): 80x24 under tmux; keys arrive; too small is told; a kill leaves the terminal's shell alive."""
    name = f"console-{tmp_path.name}"
    tmux = ["tmux", "-L", name, "-f", "/dev/null"]
    command = f"env XDG_RUNTIME_DIR={tmp_path} {sys.executable} -m dnc console --modbus 127.0.0.1:1; sleep 30"

    def run(*words: str) -> str:
        return subprocess.run([*tmux, *words], capture_output=True, text=True, check=True).stdout

    def wait_for(*texts: str) -> str:
        """The pane, once all of it is drawn: it comes in pieces."""
        end_s = time.monotonic() + 30.0
        while not all(text in (pane := run("capture-pane", "-p")) for text in texts):
            assert time.monotonic() < end_s, pane
            time.sleep(0.1)
        return pane

    run("new-session", "-d", "-x", "80", "-y", "24", command)
    try:
        pane = wait_for("### NO JOB ###", "modbus UNAVAILABLE", "\n F1 help")
        assert pane.splitlines()[-1].startswith(" F1 help")
        run("send-keys", "F1")
        wait_for("No key here is an emergency stop")
        run("resize-window", "-x", "40", "-y", "5")
        wait_for("too small: 40x5")
        run("resize-window", "-x", "80", "-y", "24")
        wait_for("F10 or q")
        run("send-keys", "q")
        end_s = time.monotonic() + 20.0
        while "F10 or q" in run("capture-pane", "-p"):
            assert time.monotonic() < end_s
            time.sleep(0.1)
    finally:
        run("kill-server")
