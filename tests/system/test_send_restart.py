"""Restart and resume by computed preamble, and the check before sending (5.7, 6.8; faults O4, H9)."""

from __future__ import annotations

import hashlib
import json
import re
import signal
from pathlib import Path

import pytest

from dnc.record import append_record
from tests.helpers.line import PeerProcess, SendProcess
from tests.helpers.sending import wait_for_state

pytestmark = pytest.mark.system
MACHINES = Path(__file__).parents[2] / "configs/machines"
THESIS = Path(__file__).parents[2] / "configs/jobs/thesis.toml"
HEAD = ["%_N_PART_MPF", ";CONTROL=sinumerik-840d REFERENCE=tip", "G17 G40 G64 G71 G90 G94", "G54", "T2 M6", "D1"]
HEAD += ["G0 Z50", "S1000 M3", "G4 F2", "M8"]


def planned(folder: Path, passes: int = 20, long_from: int = 99) -> Path:
    """A program as the planner writes them, with its sidecar; block N of pass k is N k.

    From pass `long_from` on blocks carry a comment.
    """
    lines, points = list(HEAD), []
    for number in range(1, passes + 1):
        points.append({"pass": number, "block": number, "line": len(lines) + 1})
        lines += [f"N{number} G0 X0 Y{number}", "G0 Z10", "G1 G9 Z-1 F100"]
        comment = " ;" + "as long as a block of a spline" * (number >= long_from)
        lines += [f"G1 X{x}.5 F250{comment}" for x in range(10)] + ["G0 Z10"]
    data = ("\n".join([*lines, "G0 Z50", "M9", "M5", "M30"]) + "\n").encode()
    path = folder / "part.mpf"
    path.write_bytes(data)
    state: dict[str, float] = {
        "safe_z_mm": 50.0,
        "clearance_z_mm": 10.0,
        "plunge_mm_min": 100.0,
        "spindle_dwell_s": 2.0,
    }
    state["tool"] = 2
    sha256 = hashlib.sha256(data).hexdigest()
    sidecar = {"sha256": sha256, "radius_mm": 4.0, "state": state, "restart_points": points}
    (folder / "part.mpf.json").write_text(json.dumps(sidecar))
    return path


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


def small_buffer(folder: Path) -> Path:
    """The machine with a control that holds next to nothing, so that little is in doubt."""
    machine = folder / "small.toml"
    text = (Path(__file__).parents[2] / "configs/machines/sinumerik-840d.toml").read_text()
    for key, value in [("receive_buffer_bytes", 500), ("xon_fill_bytes", 200), ("lookahead_blocks", 5)]:
        old = next(line for line in text.splitlines() if line.startswith(key))
        text = text.replace(old, f"{key} = {value}")
    machine.write_text(text)
    return machine


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
    program = planned(tmp_path)
    with PeerProcess(baud=115200, quiet_s=0) as peer:
        lifting = small_buffer(tmp_path)
        lifting.write_text(lifting.read_text().replace("[control]", "[control]\nretract_z_mm = 0.0"))
        machine = ("--machine", str(lifting), "--baud=115200")
        with SendProcess(tmp_path, program, peer.pty, *machine, "--start-at", "N3") as asked:
            code, words = asked.finish()
        assert code == 2
        assert "RAISE Z" not in words
        assert "the block is your choice" in words
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


def test_a_sidecar_that_lacks_something_is_told(tmp_path: Path) -> None:
    """(6.8) A damaged sidecar is a sentence, not a fault of ours."""
    program = planned(tmp_path)
    (tmp_path / "part.mpf.json").write_text('{"sha256": "00", "restart_points": []}')
    with PeerProcess() as peer, SendProcess(tmp_path, program, peer.pty, "--start-at", "N3", "--yes") as sending:
        code, words = sending.finish()
        assert peer.stop()["bytes_received"] == 0
    assert code == 9
    assert "sidecar cannot be read" in words


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
