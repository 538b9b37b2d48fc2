"""`dnc send` against the virtual mill: the same bytes, and the mill's own faults at the other end (5.1 to 5.10)."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

import configs
from tests.helpers.line import PeerProcess, SendProcess, runtime_of
from tests.helpers.mill import MillProcess, small_machine
from tests.helpers.schemas import validated
from tests.helpers.sending import wait_for, wait_for_state

pytestmark = pytest.mark.system
PROGRAM = (
    b"G90 G64\n"
    + b"".join(b"N%d G1 X%d Y1 Z500 F3000\n" % (step, step % 2 * 5) for step in range(1, 101))
    + b"M30\n%\n"
)
SPEED = 4
"""The line runs at 38400 baud in real time; the machine is that much hurried."""


@dataclass(frozen=True)
class Case:
    """A fault of the mill, the options of send, and what must come out."""

    mill: str
    send: tuple[str, ...]
    code: int
    outcome: str
    alarms: tuple[str, ...] = ()
    blocks: int = 60

    def program(self) -> bytes:
        """Moves of 5 mm to and fro."""
        moves = (b"N%d G1 X%d Y1 Z500 F3000\n" % (step, step % 2 * 5) for step in range(1, self.blocks + 1))
        return b"G90 G64\n" + b"".join(moves) + b"M30\n%\n"


CASES = {
    "clean": Case("fifo=4096", (), 0, "SENT"),
    "L3": Case("lose-xoff=1", (), 6, "FAULTED", ("DNC-C2",), blocks=1000),
    "C3": Case("start=repeat-xon", ("--start", "wait-xon"), 0, "SENT"),
    "C5": Case("end-stops-reading=yes", (), 0, "SENT"),
    "C1, driver": Case("reset=900b", ("--handshake", "driver"), 6, "ABORTED", ("DNC-C1",), blocks=1000),
    "C2, driver": Case("alarm=900b", ("--handshake", "driver"), 6, "FAULTED", ("DNC-C2",), blocks=1000),
}


@pytest.mark.parametrize("name", CASES)
def test_every_fault_of_the_mill(name: str, tmp_path: Path) -> None:
    """(5.10; faults L3, C1, C2, C3, C5) Exit code, outcome, alarms; both ends agree on the bytes."""
    case = CASES[name]
    machine = small_machine(
        tmp_path, receive_buffer_bytes=1024, xoff_free_bytes=512, xon_fill_bytes=200, lookahead_blocks=5
    )  # a reserve of 130 ms: a computer that stood still for 30 overran 120 bytes, and the alarm came before the fault
    program = tmp_path / "part.mpf"
    program.write_bytes(case.program())
    with (
        MillProcess(tmp_path, "--machine", machine, "--speed", str(SPEED), "--fault", case.mill) as mill,
        SendProcess(
            tmp_path, program, mill.ready["pty"], "--machine", str(machine), "--baud", str(9600 * SPEED), *case.send
        ) as sending,
    ):
        code, words = sending.finish(60)
        mill.process.terminate()
        mill.process.wait(60)
    sent, seen = sending.report(), mill.report
    ids = [alarm["id"] for alarm in sent["alarms"]]  # type: ignore[attr-defined]
    assert (code, sent["outcome"]) == (case.code, case.outcome), words
    assert set(case.alarms) <= set(ids)
    assert "Traceback" not in words
    assert sent["simulated"] is True
    if case.outcome == "SENT" and name != "C5":
        assert seen["sha256"] == sent["sha256"]
        assert seen["overrun_bytes"] == 0
        assert sent["xoff_count"] > 0  # type: ignore[operator]
    if name == "C5":
        assert "trailer not taken" in str(sent["note"]) or sent["bytes_sent"] == len(case.program())
    if name == "L3":
        assert seen["overrun_bytes"] > 0


def test_dry_run_starts_its_own_mill(tmp_path: Path) -> None:
    """(1.3) `--dry-run --speed`: sent to a mill of its own, labelled, nothing left running."""
    program = tmp_path / "part.mpf"
    program.write_bytes(CASES["clean"].program())
    words = ["send", str(program), "--dry-run", "--speed", "10", "--report", str(tmp_path / "report.json")]
    environment = {"XDG_STATE_HOME": str(tmp_path), "PATH": "/usr/bin:/bin"}
    ran = subprocess.run(
        [sys.executable, "-m", "dnc", *words], env=environment, capture_output=True, check=False, text=True, timeout=120
    )
    assert ran.returncode == 0, ran.stderr
    assert "SIMULATED" in ran.stderr
    assert "the mill came to the end of the program after 0:" in ran.stderr
    assert '"baud": 96000' in (tmp_path / "report.json").read_text()


def test_a_profile_whose_status_is_read_at_the_real_machine_is_rehearsed(tmp_path: Path) -> None:
    """(1.3) The virtual mill wanted the real machine's Modbus address for itself and did not start."""
    program, profile = tmp_path / "part.mpf", tmp_path / "real.toml"
    program.write_bytes(b"N10 G0 Z50\nN20 M30\n")
    shipped = (Path(configs.__file__).parent / "machines" / "virtual-mill.toml").read_text()
    profile.write_text(shipped.replace('host = "127.0.0.1"', 'host = "192.0.2.7"'))
    words = ["send", str(program), "--dry-run", "--speed", "50", "--machine", str(profile)]
    environment = {"XDG_STATE_HOME": str(tmp_path), "PATH": "/usr/bin:/bin"}
    ran = subprocess.run(
        [sys.executable, "-m", "dnc", *words], env=environment, capture_output=True, check=False, text=True, timeout=120
    )
    assert ran.returncode == 0, ran.stderr
    assert "192.0.2.7:5020 of the profile is taken, or no address of this computer" in ran.stderr
    assert "dnc console --modbus 127.0.0.1:" in ran.stderr


def test_a_rehearsed_control_says_the_first_xon_where_it_is_waited_for(tmp_path: Path) -> None:
    """(5.4) A profile with start wait-xon is rehearsed, with the line's options too; it waited for ever."""
    program = tmp_path / "part.mpf"
    program.write_bytes(b"N10 G90 T1 D1\nN20 G0 Z50\nN30 M30\n")
    words = ["send", str(program), "--dry-run", "--machine", "slow-serial-1990s", "--speed", "20", "--baud", "4800"]
    environment = {"XDG_STATE_HOME": str(tmp_path), "PATH": "/usr/bin:/bin"}
    ran = subprocess.run(
        [sys.executable, "-m", "dnc", *words, "--format", "8N1", "--report", str(tmp_path / "report.json")],
        env=environment, capture_output=True, check=False, text=True, timeout=120,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    assert '"baud": 96000' in (tmp_path / "report.json").read_text()


def test_a_dry_run_tells_what_the_mill_found_in_its_buffer(tmp_path: Path) -> None:
    """(1.3) All bytes had left before the mill met the mistake: it ended with code 0 and not a word of the alarm."""
    program = tmp_path / "part.mpf"
    program.write_bytes(CASES["clean"].program().replace(b"N50 ", b"N50 XYZ "))
    words = ["send", str(program), "--dry-run", "--speed", "50", "--report", str(tmp_path / "report.json")]
    environment = {"XDG_STATE_HOME": str(tmp_path), "PATH": "/usr/bin:/bin"}
    ran = subprocess.run(
        [sys.executable, "-m", "dnc", *words], env=environment, capture_output=True, check=False, text=True, timeout=120
    )
    assert ran.returncode == 6, ran.stderr
    assert "the mill alarmed in line 51: 12550 XYZ" in ran.stderr
    assert '"exit_code": 6' in (tmp_path / "report.json").read_text()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 7), (signal.SIGTERM, 143)])
def test_a_rehearsal_ended_behind_its_last_byte_still_reports(
    number: signal.Signals, code: int, tmp_path: Path
) -> None:
    """(1.3, O1) The mill is still cutting: the report was lost, and Ctrl-C ended with 130."""
    program, report = tmp_path / "part.mpf", tmp_path / "report.json"
    program.write_bytes(b"G90 G64 G1 F100\n" + b"N1 X100\nN2 X0\n" * 3 + b"M30\n")
    environment = {**os.environ, "XDG_STATE_HOME": str(tmp_path), "XDG_RUNTIME_DIR": str(runtime_of(tmp_path))}
    command = [sys.executable, "-m", "dnc", "send", str(program), "--dry-run", "--report", str(report)]
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as sender:
        assert sender.stderr is not None
        while "Ctrl-C ends the rehearsal" not in (line := sender.stderr.readline()):
            assert line, "it ended without a word"
        sender.send_signal(number)
        words = sender.stderr.read()
    assert sender.returncode == code, words
    assert "ended the rehearsal before the mill had cut them" in words
    assert validated(report.read_text())["exit_code"] == code


def test_a_killed_sender_leaves_no_mill_behind(tmp_path: Path) -> None:
    """(1.3) kill -9 in the middle of a rehearsal: the mill and its control end with the sender."""
    program = tmp_path / "part.mpf"
    program.write_bytes(PROGRAM)
    environment = {**os.environ, "XDG_STATE_HOME": str(tmp_path), "XDG_RUNTIME_DIR": str(runtime_of(tmp_path))}
    command = [sys.executable, "-m", "dnc", "send", str(program), "--dry-run"]
    with subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL) as sender:
        wait_for_state(tmp_path, "SENDING", "HELD")
        left = {os.pidfd_open(pid) for pid in offspring(sender.pid)}
        assert len(left) >= 2
        sender.kill()
    try:
        while left:
            ended, _, _ = select.select(left, [], [], 10.0)
            assert ended
            left -= set(ended)
            for each in ended:
                os.close(each)
    finally:
        for each in left:
            signal.pidfd_send_signal(each, signal.SIGKILL)
            os.close(each)


def offspring(pid: int) -> list[int]:
    """The children of a process, and theirs."""
    children = [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return children + [each for child in children for each in offspring(child)]


@pytest.mark.parametrize(
    ("faults", "exit_code", "verdict"),
    [
        (("start=repeat-xon", "feed-hold=150b+8"), 0, "the control stopped us and let us go on; reset"),
        (("start=repeat-xon",), 0, "the control stopped us and let us go on by itself, so its feed override was not"),
        (("start=repeat-xon", "silence=20b"), 5, "never sent XOFF; if its feed override was at 0"),
        (("start=immediate",), 5, "the control sent no XON in the time given"),
    ],
)
def test_verdicts_on_a_cable(tmp_path: Path, faults: tuple[str, ...], exit_code: int, verdict: str) -> None:
    """(5.9) A control that stops us, one whose override was left up, one that never stops us, one not started."""
    words = {"receive_buffer_bytes": 512, "xoff_free_bytes": 120, "xon_fill_bytes": 200, "lookahead_blocks": 5}
    machine = small_machine(tmp_path, **words)
    text = machine.read_text().replace('start = "immediate"', 'start = "wait-xon"')
    machine.write_text(re.sub(r"start_timeout_s = \S+", "start_timeout_s = 2.5", text))
    options = [word for fault in faults for word in ("--fault", fault)]
    with MillProcess(tmp_path, "--machine", machine, *options) as mill:
        ran = subprocess.run(
            [sys.executable, "-m", "dnc", "test-handshake", "--port", mill.ready["pty"], "--machine", machine, "--yes"],
            env={"XDG_STATE_HOME": str(tmp_path), "PATH": "/usr/bin:/bin"},
            capture_output=True, check=False, text=True, timeout=120,
        )  # fmt: skip
    assert (ran.returncode, verdict in ran.stderr) == (exit_code, True), ran.stderr
    assert ("reset the control, it still holds moves" in ran.stderr) == ("no XON" not in verdict)


def test_handshake_test_asks_for_a_reset_of_a_control_that_holds_a_cut_job(tmp_path: Path) -> None:
    """(5.9; fault C10) Raising the override would have executed the old job's blocks."""
    program = tmp_path / "part.mpf"
    program.write_bytes(b"G1 X1 F1\n" * 500 + b"M30\n")
    environment = {**os.environ, "XDG_STATE_HOME": str(tmp_path / "state")}
    with PeerProcess(quiet_s=0) as peer:
        with SendProcess(tmp_path, program, peer.pty) as sending:
            wait_for_state(tmp_path, "SENDING", sent=500)
            sending.child.send_signal(signal.SIGINT)
            assert sending.finish()[0] == 7
        words = [sys.executable, "-m", "dnc", "test-handshake", "--port", peer.pty, "--yes"]
        ran = subprocess.run(words, env=environment, capture_output=True, check=False, text=True, timeout=60)
    assert ran.returncode == 9, ran.stderr
    assert "--control-was-reset" in ran.stderr


def test_handshake_test_on_the_mill(tmp_path: Path) -> None:
    """(5.9) With feed override 0 the mill stops us; it cannot be raised there, and the verdict says so."""
    machine = small_machine(
        tmp_path, receive_buffer_bytes=512, xoff_free_bytes=120, xon_fill_bytes=200, lookahead_blocks=5
    )
    with MillProcess(tmp_path, "--machine", machine, "--speed", str(SPEED), "--fault", "override=0") as mill:
        words = ["test-handshake", "--port", mill.ready["pty"], "--machine", str(machine), "--baud", str(9600 * SPEED)]
        ran = subprocess.run(
            [sys.executable, "-m", "dnc", *words, "--yes", "--resume-wait", "1", "--json"],
            env={"XDG_STATE_HOME": str(tmp_path), "PATH": "/usr/bin:/bin"},
            capture_output=True,
            check=False,
            text=True,
            timeout=120,
        )
    assert ran.returncode == 5, ran.stderr
    assert "the control stops us" in ran.stderr
    assert '"passed": false' in ran.stdout
    assert '"xoff_count": 1' in ran.stdout
    validated(ran.stdout)


def test_nothing_is_called_executed_while_the_machine_stands(tmp_path: Path) -> None:
    """(5.7) With comments between the moves the window began 24 lines behind the block that the mill stood before."""
    machine = small_machine(
        tmp_path, receive_buffer_bytes=256, xoff_free_bytes=100, xon_fill_bytes=100, lookahead_blocks=10
    )
    program = tmp_path / "part.mpf"
    moves = (b"N%d G1 X%d Y1 F3000\n; a word on it\n\nM8\n" % (step, step % 7) for step in range(1, 101))
    program.write_bytes(b"G90 G64\n" + b"".join(moves) + b"M30\n")
    words = ("--machine", machine, "--fault", "override=0")
    with (
        MillProcess(tmp_path, *words) as mill,
        SendProcess(tmp_path, program, mill.ready["pty"], "--machine", str(machine)) as sending,
    ):
        held = wait_for(tmp_path, lambda values: values["state"] == "HELD" and values["held_now_s"] > 1)
        sending.child.send_signal(signal.SIGINT)
        _, words_said = sending.finish()
    first_move = 2
    for first, _ in (held["in_doubt"], sending.report()["in_doubt"]):
        assert first <= first_move
    assert "was executed" not in words_said
