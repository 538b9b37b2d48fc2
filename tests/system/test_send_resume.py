"""Resume: which job, from which line, and what keeps it from being taken up (5.7; faults O4, H1, H9)."""

from __future__ import annotations

import hashlib
import re
import signal
from pathlib import Path

import pytest

from dnc.record import append_record
from tests.helpers.line import PeerProcess, SendProcess
from tests.helpers.restarts import planned, small_buffer
from tests.helpers.sending import wait_for_state

pytestmark = pytest.mark.system


def test_a_restart_killed_on_its_way_is_resumed_from_what_it_had_sent(tmp_path: Path) -> None:
    """(5.7) Its bytes were counted from the head of the whole program: 100 lines that nobody had sent were left out."""
    program, record = planned(tmp_path, passes=40, long_from=20), tmp_path / "heard"
    options = ("--machine", str(small_buffer(tmp_path)), "--baud=19200")
    begin = program.read_bytes().split(b"\n").index(b"N20 G0 X0 Y20") + 1
    with PeerProcess(baud=19200, quiet_s=0, record=record) as peer:
        with SendProcess(tmp_path, program, peer.pty, *options, "--start-at", "N20", "--yes") as sending:
            wait_for_state(tmp_path, "SENDING", sent=3000)
            sending.child.kill()
        with SendProcess(tmp_path, program, peer.pty, *options, "--resume") as asked:
            code, words = asked.finish()
        peer.stop()
    heard = record.read_bytes()
    reached = begin + heard[heard.index(b"N20 G0") :].count(b"\n")
    said = re.search(r"lines (\d+) to (\d+) are in doubt", words)
    again = re.search(r"restart at line (\d+) \(N\d+\): everything", words)
    assert code == 2
    assert said is not None
    assert again is not None
    assert begin <= int(again[1]) <= int(said[1]) <= reached <= int(said[2])
    assert "FIRST RAISE Z BY HAND" in words


def test_resume_where_an_aborted_job_was_in_doubt(tmp_path: Path) -> None:
    """(5.7) After a reset of the control: the last restart point before everything in doubt."""
    program = planned(tmp_path, passes=40)
    options = ("--machine", str(small_buffer(tmp_path)), "--baud=19200")
    with PeerProcess(baud=19200, quiet_s=0) as peer:
        with SendProcess(tmp_path, program, peer.pty, *options) as sending:
            wait_for_state(tmp_path, "SENDING", sent=3000)
            sending.child.send_signal(signal.SIGINT)
            code, words = sending.finish()
            doubt = sending.report()["in_doubt"]
        assert code == 7
        assert isinstance(doubt, list)
        assert f"in doubt from line {doubt[0]} " in words
        assert f"to line {doubt[1]}" in words
        resume = (*options, "--resume", "--yes")
        if sending.report()["is_block_cut"]:
            with SendProcess(tmp_path, program, peer.pty, *resume) as refused:
                code, words = refused.finish()
            assert (code, "--control-was-reset" in words) == (9, True)
            resume = (*resume, "--control-was-reset")
        with SendProcess(tmp_path, program, peer.pty, *resume) as resumed:
            assert resumed.finish()[0] == 0
            restart = resumed.report()["restart"]
    assert isinstance(restart, dict)
    assert restart["line"] <= doubt[0] < restart["line"] + 14


def test_another_program_cannot_be_resumed(tmp_path: Path) -> None:
    """(fault H9) Changed program, or none sent before: exit 9."""
    program = planned(tmp_path)
    with PeerProcess(quiet_s=0) as peer:
        with SendProcess(tmp_path, program, peer.pty, "--resume", "--yes") as sending:
            assert sending.finish()[0] == 9
        program.write_bytes(program.read_bytes().replace(b"F250", b"F251"))
        with SendProcess(tmp_path, program, peer.pty, "--resume", "--yes") as sending:
            code, words = sending.finish()
        assert code == 9
        assert "another version" in words
        assert peer.stop()["bytes_received"] == 0


@pytest.mark.parametrize(
    ("missing", "words"),
    [("sidecar", "a restart needs the planner's sidecar"), ("point", "no restart point lies before it")],
)
def test_a_job_that_cannot_be_resumed_is_exit_9(missing: str, words: str, tmp_path: Path) -> None:
    """(Interface, section 6) Neither the profile nor the program is at fault."""
    program, beside = planned(tmp_path), tmp_path / "part.mpf.json"
    record: dict[str, object] = {"job": "1", "outcome": "ABORTED", "in_doubt": [2, 3]}
    record["program_sha256"] = hashlib.sha256(program.read_bytes()).hexdigest()
    if missing == "sidecar":
        beside.unlink()
    with PeerProcess() as peer:
        append_record(tmp_path / "state/dnc", {**record, "port": peer.pty})
        with SendProcess(tmp_path, program, peer.pty, "--resume", "--yes") as sending:
            code, said = sending.finish()
        assert peer.stop()["bytes_received"] == 0
    assert code == 9
    assert words in said


def test_a_job_is_resumed_through_its_own_port(tmp_path: Path) -> None:
    """(5.7; fault O4) A rehearsal, or another machine's job of the same program, tells nothing of this control."""
    program = planned(tmp_path)
    sha = hashlib.sha256(program.read_bytes()).hexdigest()
    base: dict[str, object] = {"outcome": "ABORTED", "program_sha256": sha, "bytes_sent": 900}
    with PeerProcess() as peer:
        for number, more in enumerate((
            {"port": peer.pty, "in_doubt": [60, 70], "started": "2026-01-02"},
            {"port": "/dev/pts/98", "in_doubt": [200, 210], "rehearsal": True},
            {"port": "/dev/ttyOTHER", "in_doubt": [210, 220]},
            {"port": peer.pty, "in_doubt": None, "bytes_sent": 0, "outcome": "NOT_STARTED"},
        )):  # fmt: skip
            append_record(tmp_path / "state/dnc", {**base, "job": str(number), **more})
        with SendProcess(tmp_path, program, peer.pty, "--resume") as sending:
            code, words = sending.finish()
        assert code == 2
        assert f"the stopped job is 0, started 2026-01-02, through {peer.pty}" in words
        assert "lines 60 to 70 are in doubt" in words
        assert "before line 60 was executed, if the control took all that was sent" in words
        with PeerProcess() as another:
            with SendProcess(tmp_path, program, another.pty, "--resume", "--yes") as sending:
                code, words = sending.finish()
            assert another.stop()["bytes_received"] == 0
    assert code == 9
    assert "no job of this program through" in words
    assert "the last was 2, started --, through /dev/ttyOTHER" in words


def test_the_last_job_is_resumed_though_the_clock_was_set_back(tmp_path: Path) -> None:
    """(5.7; fault O4) A computer without a battery starts in the past: an older job passed for the last one."""
    program = planned(tmp_path, passes=40)
    sha = hashlib.sha256(program.read_bytes()).hexdigest()
    options = ("--machine", str(small_buffer(tmp_path)), "--baud=19200")
    before: dict[str, object] = {"job": "29990101T000000.000000-7", "outcome": "ABORTED", "program_sha256": sha}
    before |= {"bytes_sent": 9000, "in_doubt": [550, 560], "machine": options[1]}
    with PeerProcess(baud=19200, quiet_s=0) as peer:
        append_record(tmp_path / "state/dnc", {**before, "port": peer.pty})
        with SendProcess(tmp_path, program, peer.pty, *options) as sending:
            wait_for_state(tmp_path, "SENDING", sent=4500)
            sending.child.kill()
        with SendProcess(tmp_path, program, peer.pty, *options, "--resume") as asked:
            _, words = asked.finish()
    assert f"the stopped job is 29990101T000000.000001-{sending.child.pid}" in words
    said = re.search(r"lines (\d+) to (\d+) are in doubt", words)
    assert said is not None
    assert int(said[1]) < 500


@pytest.mark.parametrize("more", [(), ("--start-at", "N9", "--yes")])
def test_a_killed_job_is_not_counted_on_another_tape(more: tuple[str, ...], tmp_path: Path) -> None:
    """(5.7; fault O4) Its journal counts bytes; with other block ends or another leader they lie in other lines."""
    program = planned(tmp_path, passes=40)
    machine = small_buffer(tmp_path)
    options = ("--machine", str(machine), "--baud=19200")
    as_it_was = machine.read_text()
    with PeerProcess(baud=19200, quiet_s=0) as peer:
        machine.write_text(as_it_was.replace('"as-is"', '"crlf"'))
        with SendProcess(tmp_path, program, peer.pty, *options, *more) as sending:
            wait_for_state(tmp_path, "SENDING", sent=4500)
            sending.child.kill()
        for text, code_wanted in ((as_it_was, 9), (as_it_was.replace('"as-is"', '"crlf"'), 2)):
            machine.write_text(text)
            with SendProcess(tmp_path, program, peer.pty, *options, "--resume") as asked:
                code, words = asked.finish()
            assert code == code_wanted, words
            assert ("with other block ends, leader or trailer" in words) == (code == 9)


def test_a_sidecar_that_lacks_something_is_told(tmp_path: Path) -> None:
    """(6.8) A damaged sidecar is a sentence, not a fault of ours."""
    program = planned(tmp_path)
    (tmp_path / "part.mpf.json").write_text('{"sha256": "00", "restart_points": []}')
    with PeerProcess() as peer, SendProcess(tmp_path, program, peer.pty, "--start-at", "N3", "--yes") as sending:
        code, words = sending.finish()
        assert peer.stop()["bytes_received"] == 0
    assert code == 9
    assert "sidecar cannot be read" in words


def test_resume_refuses_another_adapter(tmp_path: Path) -> None:
    """(fault A3) Real ports only: the same name, another serial number."""
    from dnc.errors import PortUnavailable
    from dnc.joblist import PastJob
    from dnc.restart import RestartPoint
    from dnc.resuming import Plan

    class Adapter:
        name, identity, is_simulated = "/dev/ttyUSB0", "usb-FTDI_B", False

    point = RestartPoint(1, None, 0, (0.0, 0.0, 0.0), (), is_inch=False)
    stopped = [PastJob("1", "FAULTED", {"port_identity": identity}) for identity in ("usb-FTDI_A", "usb-FTDI_B")]
    other, same = (Plan(point, b"", 0, "ab" * 32, None, is_lifted=True, stopped=job) for job in stopped)
    with pytest.raises(PortUnavailable, match="another adapter"):
        other.refuse_other_port(Adapter(), is_forced=False)  # type: ignore[arg-type]
    other.refuse_other_port(Adapter(), is_forced=True)  # type: ignore[arg-type]
    same.refuse_other_port(Adapter(), is_forced=False)  # type: ignore[arg-type]
