"""Restart and resume by computed preamble, and the check before sending (5.7, 6.8; faults O4, H9)."""

from __future__ import annotations

import hashlib
import re
import signal
from pathlib import Path

import pytest

from tests.helpers.line import PeerProcess, SendProcess
from tests.helpers.restarts import HEAD, planned, small_buffer
from tests.helpers.sending import wait_for_state

pytestmark = pytest.mark.system
MACHINES = Path(__file__).parents[2] / "configs/machines"
THESIS = Path(__file__).parents[2] / "configs/jobs/thesis.toml"


def test_start_at_a_pass(tmp_path: Path) -> None:
    """(6.8) Header, preamble with Z first and spindle before XY, then exactly the rest of the program."""
    program, record = planned(tmp_path), tmp_path / "heard"
    with (
        PeerProcess(baud=115200, quiet_s=0, record=record) as peer,
        SendProcess(tmp_path, program, peer.pty, "--baud=115200", "--start-at", "N15", "--yes") as sending,
    ):
        code, words = sending.finish()
        assert code == 0, words
        peer.stop()
    heard, whole = record.read_bytes(), program.read_bytes()
    rest = whole[whole.index(b"N15 ") :]
    assert heard.startswith(b"%_N_PART_MPF\n")
    assert heard.endswith(rest)
    preamble = heard[: -len(rest)].decode().split("\n")
    assert "T2 M6" in preamble
    up = next(index for index, block in enumerate(preamble) if block.startswith("G0 Z50"))
    turn = next(index for index, block in enumerate(preamble) if "M3" in block)
    across = next(index for index, block in enumerate(preamble) if block.startswith("G0 X"))
    assert up < across
    assert turn < across
    assert "preamble" in words
    restart = sending.report()["restart"]
    assert isinstance(restart, dict)
    assert (restart["block"], restart["program_sha256"]) == (15, hashlib.sha256(whole).hexdigest())


def test_blocks_that_were_cut_are_not_sent_again_where_the_control_wants_cr_lf(tmp_path: Path) -> None:
    """(5.4, 6.8) Of a file with LF all that lies before the point was taken for its first line, and sent again."""
    program, record, machine = planned(tmp_path), tmp_path / "heard", tmp_path / "crlf.toml"
    machine.write_text((MACHINES / "sinumerik-840d.toml").read_text().replace('"as-is"', '"crlf"'))
    options = ("--machine", str(machine), "--baud=115200", "--start-at", "N15", "--yes")
    with (
        PeerProcess(baud=115200, quiet_s=0, record=record) as peer,
        SendProcess(tmp_path, program, peer.pty, *options) as sending,
    ):
        code, words = sending.finish()
        assert code == 0, words
        peer.stop()
    heard, whole = record.read_bytes(), program.read_bytes()
    rest = whole[whole.index(b"N15 ") :].replace(b"\n", b"\r\n")
    assert heard.startswith(b"%_N_PART_MPF\r\n")
    assert heard.endswith(rest)
    assert b"N1 " not in heard[: -len(rest)]


def test_a_restart_is_asked_for(tmp_path: Path) -> None:
    """Without a terminal and without --yes nothing is sent."""
    with PeerProcess() as peer, SendProcess(tmp_path, planned(tmp_path), peer.pty, "--start-at", "N3") as sending:
        code, words = sending.finish()
        assert peer.stop()["bytes_received"] == 0
    assert code == 2
    assert "--yes" in words


def test_only_the_planners_points_unless_forced(tmp_path: Path) -> None:
    """(fault O4)"""
    program = planned(tmp_path)
    line = str(len(HEAD) + 14 * 4 + 8)
    with PeerProcess() as peer:
        with SendProcess(tmp_path, program, peer.pty, "--start-at", line, "--yes") as sending:
            code, words = sending.finish()
        assert (code, "use N5" in words) == (3, True)
        assert peer.stop()["bytes_received"] == 0
    with (
        PeerProcess(baud=115200, quiet_s=0.5) as peer,
        SendProcess(tmp_path, program, peer.pty, "--baud=115200", "--start-at", line, "--yes", "--force") as sending,
    ):
        assert sending.finish()[0] == 0


@pytest.mark.parametrize(("where", "code"), [("N999", 3), ("here", 2)])
def test_no_such_block(tmp_path: Path, where: str, code: int) -> None:
    with PeerProcess() as peer, SendProcess(tmp_path, planned(tmp_path), peer.pty, "--start-at", where) as sending:
        found, words = sending.finish()
    assert found == code
    assert "Traceback" not in words


def test_a_restarted_job_is_told_in_lines_of_the_program(tmp_path: Path) -> None:
    """(5.7; fault O4) Words and console named lines of the tape, of which the preamble is a part."""
    program = planned(tmp_path, passes=40, long_from=20)
    begin = program.read_bytes().split(b"\n").index(b"N20 G0 X0 Y20") + 1
    options = ("--machine", str(small_buffer(tmp_path)), "--baud=19200", "--start-at", "N20", "--yes")
    with PeerProcess(baud=19200, quiet_s=0) as peer, SendProcess(tmp_path, program, peer.pty, *options) as sending:
        shown = wait_for_state(tmp_path, "SENDING", sent=3000)
        sending.child.send_signal(signal.SIGINT)
        _, words = sending.finish()
        peer.stop()
    lines = program.read_bytes().split(b"\n")
    for one in shown["window"]:
        assert one["line"] is None or lines[one["line"] - 1].decode() == one["text"]
    assert shown["line_sent"] > begin
    said = re.search(r"to line (\d+)(?: \(N\d+\))?; nothing behind it", words)
    assert said is not None
    assert begin < int(said[1]) < len(lines)


def test_what_a_restart_says_first(tmp_path: Path) -> None:
    """(6.8) Where the profile lifts the tool nothing is asked for; another machine and a whole job are no resume."""
    program = planned(tmp_path, head=[*HEAD[:2], "/M7", *HEAD[2:]])
    with PeerProcess(baud=115200, quiet_s=0) as peer:
        lifting = small_buffer(tmp_path)
        lifting.write_text(lifting.read_text().replace("[control]", "[control]\nretract_z_mm = 0.0"))
        machine = ("--machine", str(lifting), "--baud=115200")
        with SendProcess(tmp_path, program, peer.pty, *machine, "--start-at", "N3") as asked:
            code, words = asked.finish()
        assert code == 2
        assert "RAISE Z" not in words
        assert "the block is your choice" in words
        assert "blocks with / before it, the first in line 3, count as run" in words
        with SendProcess(tmp_path, program, peer.pty, *machine) as sending:
            assert sending.finish()[0] == 0
        with SendProcess(tmp_path, program, peer.pty, *machine, "--resume") as sent:
            code, words = sent.finish()
        assert code == 9
        assert "restart with --start-at and the block that the control shows" in words
        with SendProcess(tmp_path, program, peer.pty, *machine) as sending:
            wait_for_state(tmp_path, "SENDING", "HELD", sent=500)
            sending.child.kill()
        with SendProcess(tmp_path, program, peer.pty, "--resume") as other:
            code, words = other.finish()
        assert code == 9
        assert f"give --machine {lifting}" in words


def test_check_first_stops_a_bad_program(tmp_path: Path) -> None:
    """Errors of the check stop the job; --yes does not skip them."""
    program = tmp_path / "bad.mpf"
    program.write_bytes(b"G90 G1 X10 Y10\nG2 X20 Y0 I1 J77 F100\nQQQ7\nM30\n")
    with PeerProcess() as peer, SendProcess(tmp_path, program, peer.pty, "--check", "--yes") as sending:
        code, words = sending.finish()
        assert peer.stop()["bytes_received"] == 0
    assert code == 3
    assert "--yes does not skip" in words


def test_check_first_knows_tool_radii_and_stock_of_the_job(tmp_path: Path) -> None:
    """(6.2, 6.10) An arc too tight for the job's tool keeps the program back; without a job nothing is known of it."""
    head = "G17 G40 G64 G71 G90 G94\nG54\nT2 M6\nD1\nG0 Z50\nG0 X0 Y0\nS1000 M3\nG4 F2\n"
    cut = "G1 Z11 F100\nG1 G41 X20 Y0 F250\nX40\n{}\nG40 X60 Y60\nG0 Z50\nM5\nM30\n"
    wide, tight = tmp_path / "wide.mpf", tmp_path / "tight.mpf"
    wide.write_text(head + cut.format("Y40"))
    tight.write_text(head + cut.format("G3 X40 Y1 CR=0.5\nG1 X20"))
    with PeerProcess(baud=38400, quiet_s=0) as peer:
        for program, options, code_wanted in (
            (tight, [f"--job={THESIS}"], 3),
            (wide, [f"--job={THESIS}"], 0),
            (wide, [], 0),
        ):
            with SendProcess(tmp_path, program, peer.pty, "--baud=38400", "--check", *options) as sending:
                code, words = sending.finish()
            assert code == code_wanted, words
            assert ("the arc's radius is not above the tool's" in words) == (code == 3)


def test_check_first_finds_a_missing_end(tmp_path: Path) -> None:
    """(fault P7) Without --check it is sent as it is."""
    program = tmp_path / "open.mpf"
    program.write_bytes(b"G90 G94 G17\nG0 Z50\nG0 X0\n")
    with PeerProcess(baud=38400, quiet_s=0) as peer:
        with SendProcess(tmp_path, program, peer.pty, "--baud=38400", "--check") as sending:
            code, words = sending.finish()
        assert code == 3
        assert "M30" in words
        with SendProcess(tmp_path, program, peer.pty, "--baud=38400") as sending:
            assert sending.finish()[0] == 0
