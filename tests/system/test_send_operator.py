"""What the operator does to a running `dnc send`: signals, orders over its socket, a kill (5.7)."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import pty
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from dnc.journal import read_journal
from tests.helpers.line import PeerProcess, SendProcess, runtime_of
from tests.helpers.sending import FAST, checked, program_at, wait_for_pausing, wait_for_state

pytestmark = pytest.mark.system


def test_sigint_stops_purges_and_tells(tmp_path: Path) -> None:
    """(1.3, 5.7; fault C10) Exit 7, window, journal ABORTED; the next start asks for a reset of the control."""
    program = program_at(tmp_path, 300)
    with PeerProcess(quiet_s=0) as peer:
        with SendProcess(tmp_path, program, peer.pty) as sending:
            wait_for_state(tmp_path, "SENDING", sent=500)
            sending.child.send_signal(signal.SIGINT)
            code, words = sending.finish()
        report = checked(sending.report())
        assert (code, report["outcome"]) == (7, "ABORTED")
        assert "in doubt from line 1 (N10)" in words
        journal = next((tmp_path / "state/dnc/jobs").glob("*/journal"))
        last = read_journal(journal)[-1]
        assert (last.state.value, last.sent_bytes) == ("ABORTED", report["bytes_sent"])
        with SendProcess(tmp_path, program, peer.pty) as again:
            code, words = again.finish()
        assert code == 9
        assert "--control-was-reset" in words
        assert 0 <= report["bytes_sent"] - peer.stop()["bytes_received"] <= 3  # type: ignore[operator]


def test_an_impatient_operator_loses_nothing(tmp_path: Path) -> None:
    """(5.7; fault C10) Ctrl-C again while the job still ends: it is on record, and the next start asks for a reset."""
    program, reached, hook = program_at(tmp_path, 300), tmp_path / "reached", tmp_path / "hook.sh"
    os.mkfifo(reached)
    hook.write_text(f"#!/bin/sh\ngrep -q ABORTED && echo now > {reached} && cat {reached} > /dev/null\n")
    hook.chmod(0o755)
    with PeerProcess(quiet_s=0) as peer:
        with SendProcess(tmp_path, program, peer.pty, "--hook", str(hook)) as sending:
            wait_for_state(tmp_path, "SENDING", sent=500)
            sending.child.send_signal(signal.SIGINT)
            assert reached.read_text() == "now\n"
            sending.child.send_signal(signal.SIGINT)
            sending.child.send_signal(signal.SIGTERM)
            reached.write_text("go on\n")
            code, _ = sending.finish()
        assert (code, checked(sending.report())["outcome"]) == (7, "ABORTED")
        with SendProcess(tmp_path, program, peer.pty) as again:
            code, words = again.finish()
    assert (code, "--control-was-reset" in words) == (9, True)


@pytest.mark.parametrize("how", ["2>/dev/full", "2>&-", ">&- 2>&- <&-"])
def test_a_lost_terminal_changes_nothing(tmp_path: Path, how: str) -> None:
    """(5.7; fault O2) Whatever became of stderr, the bytes are the tape's alone, and the exit code is the job's."""
    program = program_at(tmp_path, 20)
    with PeerProcess(baud=38400, quiet_s=0.3) as peer:
        command = (
            f"exec {sys.executable} -m dnc send {program} --port {peer.pty} {FAST} --report {tmp_path}/r.json {how}"
        )
        environment = {**os.environ, "XDG_STATE_HOME": str(tmp_path), "XDG_RUNTIME_DIR": str(runtime_of(tmp_path))}
        ran = subprocess.run(["/bin/sh", "-c", command], env=environment, check=False, timeout=30)
        seen = peer.report()
    report = checked(json.loads((tmp_path / "r.json").read_text()))
    assert (ran.returncode, report["outcome"]) == (0, "SENT")
    assert seen["bytes_received"] == report["bytes_sent"] == len(program.read_bytes())


def test_sigterm_pauses_at_a_block_end(tmp_path: Path) -> None:
    """(1.3; fault H7) Exit 143 within 2 s, no block cut."""
    with (
        PeerProcess(quiet_s=0) as peer,
        SendProcess(tmp_path, program_at(tmp_path, 300), peer.pty) as sending,
    ):
        wait_for_state(tmp_path, "SENDING", sent=500)
        sending.child.send_signal(signal.SIGTERM)
        code, _ = sending.finish(timeout_s=5)
        seen = peer.stop()
    report = checked(sending.report())
    assert (code, report["outcome"], report["is_block_cut"]) == (143, "PAUSED", False)
    assert seen["bytes_received"] == report["bytes_sent"]


def test_sigterm_while_held_ends_in_time(tmp_path: Path) -> None:
    """(fault H7) Held in the middle of a block: after 2 s the job is aborted, and the report says that it is cut."""
    with (
        PeerProcess(baud=38400, buffer_bytes=401, eat_bytes_s=0.001, never_xon=1) as peer,
        SendProcess(tmp_path, program_at(tmp_path, 300), peer.pty, FAST) as sending,
    ):
        wait_for_state(tmp_path, "HELD")
        sending.child.send_signal(signal.SIGTERM)
        code, _ = sending.finish(timeout_s=6)
    report = checked(sending.report())
    assert code == 143
    assert report["outcome"] == ("ABORTED" if report["is_block_cut"] else "PAUSED")


def test_sighup_changes_nothing(tmp_path: Path) -> None:
    """(fault O2) A lost terminal is no reason to stop cutting."""
    program = program_at(tmp_path)
    with PeerProcess(quiet_s=0) as peer, SendProcess(tmp_path, program, peer.pty) as sending:
        wait_for_state(tmp_path, "SENDING")
        sending.child.send_signal(signal.SIGHUP)
        assert sending.finish()[0] == 0
        assert peer.stop()["bytes_received"] == program.stat().st_size


def test_nothing_typed_at_the_terminal_reaches_the_job(tmp_path: Path) -> None:
    """(faults O5, O9) Ctrl-S stops the operator's screen only, a pasted text is read by nobody: every byte arrives."""
    program = program_at(tmp_path, 150)
    master, slave = pty.openpty()
    with (
        PeerProcess(baud=38400, expect_bytes=program.stat().st_size, quiet_s=0.3) as peer,
        SendProcess(tmp_path, program, peer.pty, FAST, terminal=slave) as sending,
    ):
        os.close(slave)
        os.write(master, b"\x13hxa\r r\r q\x1b[15~\r" + b"G0 Z-100\r" * 9)
        assert peer.report()["sha256"] == hashlib.sha256(program.read_bytes()).hexdigest()
        os.write(master, b"\x11")
        shown = b""
        with contextlib.suppress(OSError):  # the end of a terminal that its last program has left
            while data := os.read(master, 4096):
                shown += data
        assert sending.child.wait(10) == 0
    os.close(master)
    assert sending.report()["outcome"] == "SENT"
    assert b"SIMULATED: sent" in shown


def test_kill_9_leaves_a_bound(tmp_path: Path) -> None:
    """(decision 8; fault H1) Whatever reached the control lies within the last durable bound."""
    with PeerProcess(quiet_s=0) as peer, SendProcess(tmp_path, program_at(tmp_path, 800), peer.pty) as sending:
        wait_for_state(tmp_path, "SENDING", sent=700)
        sending.child.kill()
        sending.child.wait(10)
        seen = peer.stop()
    last = read_journal(next((tmp_path / "state/dnc/jobs").glob("*/journal")))[-1]
    assert 700 <= seen["bytes_received"] <= last.bound_bytes  # type: ignore[operator]
    assert last.state.value == "SENDING"


def test_after_kill_9_the_next_start_asks_for_a_reset(tmp_path: Path) -> None:
    """(5.7; fault C10) The control holds a cut block: nothing may leave behind it."""
    program = program_at(tmp_path, 300)
    with PeerProcess(quiet_s=0) as peer:
        with SendProcess(tmp_path, program, peer.pty) as sending:
            wait_for_state(tmp_path, "SENDING", sent=500)
            sending.child.kill()
            sending.child.wait(10)
        with SendProcess(tmp_path, program, peer.pty) as again:
            code, words = again.finish()
    assert (code, "ended INTERRUPTED" in words, "--control-was-reset" in words) == (9, True, True)
    environment = {**os.environ, "XDG_STATE_HOME": str(tmp_path / "state")}
    listed = subprocess.run([sys.executable, "-m", "dnc", "jobs"], env=environment, capture_output=True, check=True)
    assert re.search(rb"INTERRUPTED +\d+ to \d+/\d+ bytes", listed.stdout)


def test_a_job_that_nobody_can_watch_says_so(tmp_path: Path) -> None:
    """(5.7) A file stands where the folder of the sockets should be: the job is sent, and the operator warned."""
    program = program_at(tmp_path, 5)
    (runtime_of(tmp_path) / "dnc").write_text("")
    with PeerProcess(quiet_s=0.3) as peer, SendProcess(tmp_path, program, peer.pty, FAST) as sending:
        code, words = sending.finish()
    assert (code, "no console can see or pause this job" in words) == (0, True)


def test_orders_over_the_socket(tmp_path: Path) -> None:
    """(5.7; faults O6, O8) One watcher holds the lease and pauses; another is refused; leaving changes nothing."""
    program = program_at(tmp_path, 100)
    with PeerProcess(quiet_s=0) as peer, SendProcess(tmp_path, program, peer.pty) as sending:
        wait_for_state(tmp_path, "SENDING")
        path = str(next((runtime_of(tmp_path) / "dnc").glob("job-*.sock")))
        with socket.socket(socket.AF_UNIX) as one, socket.socket(socket.AF_UNIX) as two:
            for watcher in (one, two):
                watcher.settimeout(10)
                watcher.connect(path)
            assert ordered(two, "pause")["answer"] == "refused"
            assert ordered(one, "lease")["answer"] == "ok"
            assert ordered(two, "lease")["answer"] == "refused"
            assert ordered(one, "fly")["answer"] == "refused"
            assert ordered(one, "pause")["answer"] == "ok"
            paused = wait_for_state(tmp_path, "PAUSED")
            assert paused["window"]
            assert ordered(one, "resume")["answer"] == "ok"
            wait_for_state(tmp_path, "SENDING", "SENT")
        assert sending.finish()[0] == 0
        assert peer.stop()["sha256"] == hashlib.sha256(program.read_bytes()).hexdigest()


def ordered(watcher: socket.socket, word: str) -> dict[str, object]:
    watcher.sendall(json.dumps({"do": word}).encode() + b"\n")
    pending = b""
    while True:
        pending += watcher.recv(65536)
        *lines, pending = pending.split(b"\n")
        for line in lines:
            values = json.loads(line)
            if "answer" in values:
                assert isinstance(values, dict)
                return values


def test_a_pause_before_the_first_xon(tmp_path: Path) -> None:
    """(5.4, 5.7; fault O6) Nothing leaves when the XON comes; what changes nothing is refused."""
    program = program_at(tmp_path, 100)
    with (
        PeerProcess(say_first="11", expect_bytes=1 << 30, quiet_s=60) as peer,
        SendProcess(tmp_path, program, peer.pty, "--start", "wait-xon") as sending,
    ):
        wait_for_state(tmp_path, "ARMED", sent=0)
        path = str(next((runtime_of(tmp_path) / "dnc").glob("job-*.sock")))
        with socket.socket(socket.AF_UNIX) as one:
            one.settimeout(10)
            one.connect(path)
            ordered(one, "lease")
            assert ordered(one, "resume")["why"] == "resume changes nothing while the job is ARMED"
            assert ordered(one, "pause")["answer"] == "ok"
            peer.say_first()
            assert wait_for_state(tmp_path, "PAUSED", sent=0)["bytes_sent"] == 0
            ordered(one, "abort")
        assert sending.finish()[0] == 7
        assert peer.stop()["bytes_received"] == 0


def test_an_alarm_goes_before_sigterm(tmp_path: Path) -> None:
    """(Interface, section 6; fault H7) The control stopped while the process was about to leave: 6, not 143."""
    with (
        PeerProcess(baud=38400, buffer_bytes=401, eat_bytes_s=0.001, never_xon=1, say_first="15") as peer,
        SendProcess(tmp_path, program_at(tmp_path, 300), peer.pty, FAST) as sending,
    ):
        wait_for_state(tmp_path, "HELD")
        sending.child.send_signal(signal.SIGTERM)
        wait_for_pausing(tmp_path)
        peer.say_first()
        code, words = sending.finish(timeout_s=10)
    report = checked(sending.report())
    assert (code, report["outcome"]) == ((6, "FAULTED") if report["alarms"] else (143, "PAUSED")), words


@pytest.mark.parametrize("where", ["/dev/full", "closed"])
def test_stdout_that_takes_nothing_loses_no_report(where: str, tmp_path: Path) -> None:
    """(5.7, O2) --json after SENT ended with 3, "run it again", and --report was not written."""
    program = program_at(tmp_path, 20)
    runtime = runtime_of(tmp_path)
    environment = {**os.environ, "XDG_STATE_HOME": str(tmp_path / "state"), "XDG_RUNTIME_DIR": str(runtime)}
    report = tmp_path / "sent.json"
    with PeerProcess(baud=38400) as peer:
        words = ["send", str(program), "--port", peer.pty, FAST, "--json", "--report", str(report)]
        read, write = os.pipe()
        os.close(read)
        out = write if where == "closed" else os.open(where, os.O_WRONLY)
        done = subprocess.run(
            [sys.executable, "-m", "dnc", *words],
            env=environment,
            stdout=out,
            stderr=subprocess.PIPE,
            check=False,
        )
        os.close(out)
    assert done.returncode == 8, done.stderr
    assert checked(json.loads(report.read_text()))["outcome"] == "SENT"
    assert b"the job itself ended as said before" in done.stderr


def test_a_report_that_cannot_be_written_does_not_call_the_program_refused(tmp_path: Path) -> None:
    """(5.7) Exit code 3 is that of a program that was never sent; who reads it sends the job again."""
    program, gone = tmp_path / "part.mpf", tmp_path / "gone"
    program.write_bytes(b"G1 X1\n" * 500 + b"M30\n")
    gone.mkdir()
    with (
        PeerProcess(baud=19200) as peer,
        SendProcess(tmp_path, program, peer.pty, "--baud=19200", "--report", str(gone / "sent.json")) as sending,
    ):
        wait_for_state(tmp_path, "SENDING")
        gone.rmdir()
        code, words = sending.finish()
    assert code == 8, words
    assert "sent 3004 bytes" in words
    assert re.search(r"gone/sent\.json: .*the job itself ended as said before", words)
