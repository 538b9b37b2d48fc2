"""The virtual mill as a process: the line is paced, nothing hides in the pseudo-terminal, every end leaves a report."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import json
import os
import select
import subprocess
import sys
import time
from pathlib import Path

import jsonschema
import pytest
from pymodbus.client import ModbusTcpClient

from dnc.shipped import shipped_path
from tests.helpers.mill import MillProcess, listen, port, small_machine, stuff

pytestmark = pytest.mark.system

HEAD = b"G90 G64\n"
PROGRAM = HEAD + b"".join(b"N%d G1 X%d Y1 Z500 F3000\n" % (step, step % 2 * 5) for step in range(1, 61)) + b"M30\n"
SCHEMA = json.loads((Path(__file__).parents[2] / "docs/schemas/mill.schema.json").read_text())


def test_a_program_is_received_cut_and_reported(tmp_path: Path) -> None:
    """(1.4, 1.7): the report keeps its schema and knows the bytes; the link is gone afterwards."""
    link = tmp_path / "mill"
    with MillProcess(tmp_path, "--speed", "20", "--link", link, "--motion", tmp_path / "motion.csv") as mill:
        assert mill.ready["line_baud"] == 192_000
        assert Path(mill.ready["pty"]) == link.resolve()
        with port(str(link)) as fd:
            left, _ = stuff(fd, PROGRAM, 30.0, obeys=True)
            assert left == b""
            assert mill.end() == 0
    report = mill.report
    jsonschema.validate(report, SCHEMA)
    assert report["sha256"] == hashlib.sha256(PROGRAM).hexdigest()
    assert (report["blocks"], report["overrun_bytes"], report["alarms"]) == (62, 0, [])
    assert report["is_completed"]
    assert not link.is_symlink()
    with (tmp_path / "motion.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(rows[-1][f"{axis}_mm"]) for axis in "xyz"] == [0.0, 1.0, 500.0]
    assert not list(tmp_path.glob("*.part"))


def test_the_job_of_nominal_gives_the_tool_radii(tmp_path: Path) -> None:
    """(6.2): a compensated program runs through the line without an alarm."""
    program = b"T2 M6\nD1 G90 G0 X0 Y9 Z500\nG1 G41 X10 Y0 F3000\nX20\nG40 X30 Y9\nM30\n"
    job = shipped_path("jobs", "thesis")
    with (
        MillProcess(tmp_path, "--speed", "20", "--nominal", job, "--probe-pitch", "5") as mill,
        port(mill.ready["pty"]) as fd,
    ):
        stuff(fd, program, 30.0, obeys=True)
        assert mill.end() == 0
    assert (mill.report["alarms"], mill.report["is_completed"]) == ([], True)


def test_the_pseudo_terminal_cannot_hide_overshoot(tmp_path: Path) -> None:
    """(1.4, 5.2): a host that stops at DC3 but has stuffed 4 kB before it overruns a 256-byte buffer."""
    machine = small_machine(
        tmp_path, receive_buffer_bytes=256, xoff_free_bytes=32, xon_fill_bytes=64, lookahead_blocks=4
    )
    with MillProcess(tmp_path, "--machine", machine, "--speed", "4") as mill, port(mill.ready["pty"]) as fd:
        stuff(fd, PROGRAM * 3, 3.0, obeys=False)
        assert b"\x13" in listen(fd, b"\x15", 30.0)
        assert mill.terminate() == 143
    report = mill.report
    jsonschema.validate(report, SCHEMA)
    assert report["overrun_bytes"] > 0
    assert report["overshoot_bytes_max"] > 32
    assert [alarm["number"] for alarm in report["alarms"]] == [87]


def test_bytes_arrive_no_faster_than_the_baud_rate(tmp_path: Path) -> None:
    """(1.4): 2000 bytes handed over at once at 9600 baud are not there after half a second."""
    with MillProcess(tmp_path) as mill, port(mill.ready["pty"]) as fd:
        begun_s = time.monotonic()
        os.write(fd, b"; " + b"x" * 2000)
        select.select([], [], [], 0.5)
        mill.terminate()
        took_s = time.monotonic() - begun_s
    assert 200 < mill.report["bytes_received"] < 960 * took_s


def test_sigterm_leaves_a_whole_report(tmp_path: Path) -> None:
    """(2.7)"""
    with MillProcess(tmp_path) as mill:
        assert mill.terminate() == 143
    jsonschema.validate(mill.report, SCHEMA)
    assert mill.report["execution"] == "ACTIVE"
    assert mill.report["bytes_received"] == 0


def test_a_pulled_adapter_hangs_up(tmp_path: Path) -> None:
    """(5.8, A1)"""
    with MillProcess(tmp_path, "--fault", "unplug=100b", "--speed", "4") as mill, port(mill.ready["pty"]) as fd:
        with contextlib.suppress(OSError):
            stuff(fd, PROGRAM * 9, 10.0, obeys=False)
        hung_up = select.poll()
        hung_up.register(fd, 0)
        assert hung_up.poll(10_000)
        with pytest.raises(OSError, match="Input/output error"):
            os.write(fd, b"N1")
        assert mill.terminate() == 143


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (["--fault", "teapot=1"], 8, "there is no fault 'teapot'"),
        (["--machine", "nosuch"], 8, "no machine named 'nosuch'"),
        (["--modbus", "here"], 8, "is not HOST:PORT"),
        (["--nominal", "nosuch.toml"], 3, "cannot be read"),
        (["--report", "nosuch/mill.json"], 3, "its folder does not exist"),
        (["--motion", "nosuch/motion.csv"], 3, "its folder does not exist"),
        (["--report", "."], 3, "is a directory"),
        (["--report", "/dev/null"], 3, "/dev/null: is not a regular file"),
        (["--link", "nosuch/link"], 8, "--link"),
        (["--speed", "0"], 2, "--speed"),
    ],
)
def test_wrong_words_are_one_sentence(words: list[str], code: int, sentence: str, tmp_path: Path) -> None:
    """(2.7)"""
    done = subprocess.run(
        [sys.executable, "-m", "dnc", "mill", *words],
        capture_output=True,
        text=True,
        timeout=120,
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == code, done.stderr
    assert sentence in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


def test_modbus_agrees_with_the_motion_log(tmp_path: Path) -> None:
    """(2.1, 7.7): position and block as read stand in the log at the time of reading, within one poll."""
    circle = b"G90 G64 G17\nN10 G1 X0 Y0 Z500 F600\nN20 G1 X10 Y0\nN30 G3 X10 Y0 I-10 J0\nN40 G1 X20\nM30\n"
    readings: list[tuple[float, tuple[float, float], int]] = []
    with MillProcess(tmp_path, "--speed", "2", "--motion", tmp_path / "motion.csv") as mill:
        zero_s = time.monotonic()
        with port(mill.ready["pty"]) as fd:
            os.write(fd, circle)
            host, number = mill.ready["modbus"].split(":")
            client = ModbusTcpClient(host, port=int(number), timeout=1.0, retries=0)
            assert client.connect()
            while mill.process.poll() is None:
                before_s = time.monotonic()
                try:
                    words = client.read_input_registers(0, count=64).registers
                except Exception:  # noqa: BLE001 (the mill has ended meanwhile)
                    break
                signed = [
                    int.from_bytes(b"".join(w.to_bytes(2, "big") for w in words[k : k + 2]), "big", signed=True)
                    for k in (8, 10, 12)
                ]
                if words[2] == 2:
                    readings.append((before_s - zero_s, (signed[1] / 1000, signed[2] / 1000), signed[0]))
                select.select([], [], [], 0.1)
            client.close()
            assert mill.end() == 0
    with (tmp_path / "motion.csv").open() as file:
        log = [
            (float(row["t_s"]), float(row["x_mm"]), float(row["y_mm"]), int(row["block"] or 0))
            for row in csv.DictReader(file)
        ]
    assert {place for _, place, block in readings if block == 0} <= {(0.0, 0.0)}  # running, but nothing moves yet
    readings = [reading for reading in readings if reading[2]]
    moving = [reading for reading in readings if any(abs(row[0] - 2 * reading[0]) < 0.01 for row in log)]
    assert len(moving) > 10
    for at_s, (x, y), block in moving:
        near = [row for row in log if abs(row[0] - 2 * at_s) < 0.8]
        assert any(abs(row[1] - x) < 0.001 and abs(row[2] - y) < 0.001 and row[3] == block for row in near), (
            at_s,
            x,
            y,
        )
