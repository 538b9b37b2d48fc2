"""`dnc send` as a process against a peer process behind a pty: bytes, exit codes, sentences, reports (1.3, 5.x)."""

from __future__ import annotations

import hashlib
import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.line import PeerProcess, SendProcess
from tests.helpers.sending import FAST, checked, only_alarm, program_at, wait_for_state

pytestmark = pytest.mark.system


def test_the_bytes_arrive_and_both_ends_agree(tmp_path: Path) -> None:
    """(1.3, 1.7; fault O7) Held a few times, no overrun, same hash at both ends, exit 0, valid report, record kept."""
    program = program_at(tmp_path, 200)
    with (
        PeerProcess(
            baud=38400, buffer_bytes=512, eat_bytes_s=3000, expect_bytes=program.stat().st_size, quiet_s=0.3
        ) as peer,
        SendProcess(tmp_path, program, peer.pty, FAST) as sending,
    ):
        code, words = sending.finish()
        seen = peer.report()
    report = checked(sending.report())
    assert code == 0, words
    assert seen["sha256"] == report["sha256"] == hashlib.sha256(program.read_bytes()).hexdigest()
    assert seen["overrun_bytes"] == 0
    assert report["xoff_count"] == seen["xoff_sent"] > 0  # type: ignore[operator]
    assert report["inflight_at_xoff_bytes_max"] <= report["inflight_max_bytes"] == 2  # type: ignore[operator]
    assert report["simulated"] is True
    assert "SIMULATED" in words
    records = (tmp_path / "state/dnc/records.jsonl").read_text().splitlines()
    assert [json.loads(line)["sha256"] for line in records] == [report["sha256"]]


def test_send_loads_nothing_heavy(tmp_path: Path) -> None:
    """(design, 2) A whole job without numpy, scipy, textual, matplotlib, pymodbus."""
    program = program_at(tmp_path, 20)
    script = (
        "import sys\nfrom dnc.cli.main import run_with\n"
        f"code = run_with(['send', {str(program)!r}, '--port', sys.argv[1], '--baud', '38400'])\n"
        "print(code, sorted({'numpy', 'scipy', 'textual', 'matplotlib', 'pymodbus', 'sim'} & set(sys.modules)))\n"
    )
    with PeerProcess(baud=38400, quiet_s=0.3) as peer:
        environment = {**os.environ, "XDG_STATE_HOME": str(tmp_path / "state")}
        shown = subprocess.run(
            [sys.executable, "-c", script, peer.pty],
            env=environment,
            capture_output=True,
            check=False,
            text=True,
            timeout=30,
        )
    assert shown.stdout.strip() == "0 []", shown.stderr


@pytest.mark.parametrize("port", ["/dev/no-such-port", "/dev/null", "socket://127.0.0.1:9"])
def test_absent_port_is_exit_4(tmp_path: Path, port: str) -> None:
    """(1.3)"""
    with SendProcess(tmp_path, program_at(tmp_path), port) as sending:
        code, words = sending.finish()
    assert code == 4
    assert len(words.strip().splitlines()) == 1
    assert "Traceback" not in words


def test_two_senders_on_one_port(tmp_path: Path) -> None:
    """(1.3, 2.7; faults A4, O1) One job; the second is told by whom the port is used, and disturbs nothing."""
    program = program_at(tmp_path)
    (tmp_path / "second").mkdir()
    with (
        PeerProcess(say_first="11", expect_bytes=program.stat().st_size, quiet_s=0.3) as peer,
        SendProcess(tmp_path, program, peer.pty, "--start", "wait-xon") as first,
    ):
        wait_for_state(tmp_path, "ARMED", sent=0)
        with SendProcess(tmp_path / "second", program, peer.pty) as second:
            code, words = second.finish()
        peer.say_first()
        assert (code, str(first.child.pid) in words) == (4, True)
        assert first.finish()[0] == 0
        assert peer.report()["sha256"] == hashlib.sha256(program.read_bytes()).hexdigest()


def test_unplugged_is_exit_5(tmp_path: Path) -> None:
    """(1.3; fault A1)"""
    with (
        PeerProcess(hang_up_after_bytes=300) as peer,
        SendProcess(tmp_path, program_at(tmp_path), peer.pty) as sending,
    ):
        code, words = sending.finish()
    report = checked(sending.report())
    assert code == report["exit_code"] == 5
    assert report["outcome"] == "FAULTED"
    assert only_alarm(report) == "DNC-A1"
    assert report["in_doubt"] is not None
    assert "in doubt" in words
    assert "Traceback" not in words


def test_no_first_xon_is_exit_5(tmp_path: Path) -> None:
    """(1.3, 5.4; fault C3)"""
    options = ("--start", "wait-xon", "--start-timeout", "0.5")
    with PeerProcess() as peer, SendProcess(tmp_path, program_at(tmp_path), peer.pty, *options) as sending:
        code, words = sending.finish()
        assert peer.stop()["bytes_received"] == 0
    report = checked(sending.report())
    assert (code, report["outcome"], only_alarm(report)) == (5, "NOT_STARTED", "DNC-C3")
    assert "cycle start" in words


def test_first_xon_starts(tmp_path: Path) -> None:
    """(5.4)"""
    program = program_at(tmp_path, 20)
    with (
        PeerProcess(say_first="11", expect_bytes=program.stat().st_size, baud=38400) as peer,
        SendProcess(tmp_path, program, peer.pty, "--start", "wait-xon", FAST) as sending,
    ):
        wait_for_state(tmp_path, "ARMED", sent=0)
        peer.say_first()
        assert sending.finish()[0] == 0
        assert peer.report()["bytes_received"] == program.stat().st_size


def test_hold_timeout_is_exit_5(tmp_path: Path) -> None:
    """(1.3; fault L1)"""
    with (
        PeerProcess(baud=38400, buffer_bytes=400, eat_bytes_s=1, never_xon=1) as peer,
        SendProcess(tmp_path, program_at(tmp_path), peer.pty, FAST, "--hold-timeout", "0.5") as sending,
    ):
        code, words = sending.finish()
        seen = peer.stop()
    report = checked(sending.report())
    assert (code, report["outcome"], only_alarm(report)) == (5, "FAULTED", "DNC-L1T")
    assert "--hold-timeout" in words
    assert seen["overrun_bytes"] == 0


@pytest.mark.parametrize("said", [("1316", 6, "ABORTED"), ("1315", 6, "FAULTED")])
def test_reset_and_alarm_are_exit_6(tmp_path: Path, said: tuple[str, int, str]) -> None:
    """(faults C1, C2)"""
    with (
        PeerProcess(baud=38400, say_after_bytes=300, say=said[0]) as peer,
        SendProcess(tmp_path, program_at(tmp_path), peer.pty, FAST) as sending,
    ):
        code, words = sending.finish()
        seen = peer.stop()
    report = checked(sending.report())
    assert (code, report["outcome"]) == said[1:]
    assert only_alarm(report) == f"DNC-{'C1' if said[0] == '1316' else 'C2'}"
    assert "dnc send --resume" in words
    assert "in doubt from line 1" in words
    assert seen["bytes_received"] <= 600  # type: ignore[operator]


def test_what_the_control_says_is_kept_with_the_job(tmp_path: Path) -> None:
    """(fault C12) As it came, in the job's folder; the job goes on, and the operator's terminal sees none of it."""
    said = b"LOW OIL\x1b[2J"
    with (
        PeerProcess(baud=38400, say_after_bytes=300, say=said.hex(), quiet_s=0.3) as peer,
        SendProcess(tmp_path, program_at(tmp_path), peer.pty, FAST) as sending,
    ):
        code, words = sending.finish()
    assert (code, checked(sending.report())["noise_bytes"]) == (0, len(said))
    assert next((tmp_path / "state/dnc/jobs").glob("*/heard")).read_bytes() == said
    assert "\x1b" not in words


def test_m30_that_stops_reading(tmp_path: Path) -> None:
    """(5.4; fault C5)"""
    program = program_at(tmp_path, 20, end=b"M30\n%\n" + b"\n" * 40)
    with (
        PeerProcess(baud=38400, stop_reading_after="M30\n", quiet_s=0) as peer,
        SendProcess(tmp_path, program, peer.pty, FAST) as sending,
    ):
        code, words = sending.finish()
    report = checked(sending.report())
    assert (code, report["outcome"], report["alarms"]) == (0, "SENT", [])
    assert "trailer not taken" in words


@pytest.mark.parametrize(
    ("head", "words"),
    [
        (b";DRIPMILL CONTROL=fanuc-30i REFERENCE=tip R=4 T=2 D=1 TOLERANCE=0.001\n", "written for fanuc-30i"),
        (
            b";DRIPMILL CONTROL=sinumerik-840d REFERENCE=centre R=4 T=2 D=1 TOLERANCE=0.001\n",
            "drives the tool's centre",
        ),
    ],
)
def test_a_program_for_another_control_is_refused(tmp_path: Path, head: bytes, words: str) -> None:
    """(6.8; fault O3)"""
    program = tmp_path / "part.mpf"
    program.write_bytes(head + b"G0 X0\nM30\n")
    with PeerProcess() as peer, SendProcess(tmp_path, program, peer.pty) as sending:
        code, said = sending.finish()
        assert peer.stop()["bytes_received"] == 0
    assert code == 3
    assert words in said


def test_no_handshake_needs_a_buffer_or_force(tmp_path: Path) -> None:
    """(5.3)"""
    program = program_at(tmp_path, 3000)
    with PeerProcess() as peer, SendProcess(tmp_path, program, peer.pty, "--handshake", "none") as sending:
        code, words = sending.finish()
        assert peer.stop()["bytes_received"] == 0
    assert code == 8
    assert "30720" in words
    small = program_at(tmp_path, 20)
    with (
        PeerProcess(baud=38400, quiet_s=0.3) as peer,
        SendProcess(tmp_path, small, peer.pty, "--handshake", "none", FAST) as sending,
    ):
        assert sending.finish()[0] == 0


def test_hook_hears_the_states(tmp_path: Path) -> None:
    """(5.7)"""
    heard = tmp_path / "heard"
    hook = tmp_path / "hook.sh"
    hook.write_text(f"#!/bin/sh\ncat >> {heard}\necho >> {heard}\n")
    hook.chmod(0o755)
    with (
        PeerProcess(baud=38400, quiet_s=0.3) as peer,
        SendProcess(tmp_path, program_at(tmp_path, 20), peer.pty, FAST, "--hook", str(hook)) as sending,
    ):
        assert sending.finish()[0] == 0
    events = [json.loads(line) for line in heard.read_text().splitlines()]
    assert [event["new"] for event in events] == ["SENDING", "DRAINING", "SENT"]


def test_driver_handshake_on_a_pty(tmp_path: Path) -> None:
    """(5.3) The kernel obeys XOFF; the hold is inferred; nothing is lost."""
    program = program_at(tmp_path, 100)
    with (
        PeerProcess(baud=38400, buffer_bytes=512, eat_bytes_s=1500, expect_bytes=program.stat().st_size) as peer,
        SendProcess(tmp_path, program, peer.pty, FAST, "--handshake", "driver") as sending,
    ):
        assert sending.finish()[0] == 0
        seen = peer.report()
    report = checked(sending.report())
    assert seen["sha256"] == report["sha256"]
    assert seen["overrun_bytes"] == 0
    assert report["bound_assured"] is False
    assert report["xoff_count"] > 0  # type: ignore[operator]


def test_socket_port_is_labelled(tmp_path: Path) -> None:
    """(5.3) Across a network: sent, but the bound is not assured."""
    program = program_at(tmp_path, 20)
    with socket.create_server(("127.0.0.1", 0)) as server:
        name = f"socket://127.0.0.1:{server.getsockname()[1]}"
        with SendProcess(tmp_path, program, name, FAST) as sending:
            server.settimeout(10)
            connection, _ = server.accept()
            data = b""
            while len(data) < program.stat().st_size:
                data += connection.recv(65536)
            code, words = sending.finish()
            connection.close()
    assert (code, data) == (0, program.read_bytes())
    assert checked(sending.report())["bound_assured"] is False
    assert "bound not assured" in words
