"""Mill, sender, status and console as four processes: whoever watches may die, the job does not notice."""

from __future__ import annotations

import json
import os
import pty
import select
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path

import jsonschema
import pytest

from tests.helpers.mill import MillProcess

pytestmark = pytest.mark.system

PROGRAM = b"G90 G64\n" + b"".join(b"N%d G1 X%d Y1 Z500 F3000\n" % (n, n % 2 * 20) for n in range(1, 201)) + b"M30\n"
SCHEMA = json.loads((Path(__file__).parents[2] / "docs/schemas/status.schema.json").read_text())


def seen(fd: int, text: bytes, within_s: float) -> bytes:
    """What a terminal was sent, up to a text."""
    data, end_s = b"", time.monotonic() + within_s
    while text not in data:
        left_s = end_s - time.monotonic()
        assert left_s > 0, data[-2000:]
        if select.select([fd], [], [], left_s)[0]:
            data += os.read(fd, 65536)
    return data


def test_a_killed_console_leaves_the_job_alone_and_status_reads_both(tmp_path: Path) -> None:
    """(2.1, 2.2, O2)"""
    program = tmp_path / "part.mpf"
    program.write_bytes(PROGRAM)
    dnc = [sys.executable, "-m", "dnc"]
    runtime = tmp_path / ("longer-than-a-socket-path-may-be-" * 4)
    with MillProcess(tmp_path, "--speed", "4", "--baud", "1200") as mill:
        env = {**os.environ, "XDG_RUNTIME_DIR": str(runtime), "XDG_STATE_HOME": str(tmp_path), "TERM": "xterm"}
        words = [
            "--port",
            mill.ready["pty"],
            "--baud",
            str(mill.ready["line_baud"]),
            "--report",
            str(tmp_path / "s.json"),
        ]
        master, slave = pty.openpty()
        console = subprocess.Popen(
            [*dnc, "console", "--modbus", mill.ready["modbus"]], env=env, stdin=slave, stdout=slave, stderr=slave
        )
        os.close(slave)
        seen(master, b"F10 leave", 60.0)
        sender = subprocess.Popen([*dnc, "send", str(program), *words], env=env, stderr=subprocess.DEVNULL)
        seen(master, b"SIMULATED", 60.0)
        console.send_signal(signal.SIGKILL)
        console.wait(10.0)
        os.close(master)
        said = subprocess.run(
            [*dnc, "status", "--json", "--modbus", mill.ready["modbus"]], env=env, capture_output=True, check=True
        ).stdout
        assert sender.wait(60.0) == 0
        assert mill.end() == 0
    status = json.loads(said)
    jsonschema.validate(status, SCHEMA)
    assert status["machine"]["values"]["execution"]["value"] in ("ACTIVE", "PROGRAM_COMPLETED")
    assert status["job"]["snapshot"]["simulated"] is True
    assert json.loads((tmp_path / "s.json").read_text())["sha256"] == mill.report["sha256"]


def test_a_console_that_is_ended_gives_the_terminal_back(tmp_path: Path) -> None:
    """(2.2, O2) SIGTERM left the terminal raw and on its other screen."""
    env = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path), "XDG_STATE_HOME": str(tmp_path), "TERM": "xterm"}
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    words = [sys.executable, "-m", "dnc", "console", "--modbus", "127.0.0.1:1"]
    with subprocess.Popen(words, env=env, stdin=slave, stdout=slave, stderr=slave) as console:
        seen(master, b"F10 leave", 60.0)
        assert termios.tcgetattr(slave) != before
        console.send_signal(signal.SIGTERM)
        seen(master, b"\x1b[?1049l", 20.0)
    assert console.returncode == 128 + signal.SIGTERM
    assert termios.tcgetattr(slave) == before
    os.close(slave)
    os.close(master)


def test_status_without_a_machine_says_so_and_exits_with_10(tmp_path: Path) -> None:
    """(2.1)"""
    env = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-m", "dnc", "status", "--json", "--modbus", "127.0.0.1:1"],
        env=env,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 10
    assert "the machine cannot be read: nothing answers at 127.0.0.1:1" in done.stderr
    status = json.loads(done.stdout)
    jsonschema.validate(status, SCHEMA)
    assert status["job"] is None
    assert status["machine"]["values"]["x_mm"]["value"] is None
