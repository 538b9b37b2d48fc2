"""Faults of the published list that are not shown elsewhere, each by its id (5.10); and the list itself, kept true."""

from __future__ import annotations

import errno
import json
import math
import os
import pty
import re
import threading
import time
import tty
from pathlib import Path

import pytest
import serial
from click.testing import CliRunner

from dnc import alarms
from dnc.capture import Capture
from dnc.cli.main import program as command_line
from dnc.errors import ExitCode, PortUnavailable
from dnc.events import Alarm, JobState, Noise, Severity
from dnc.forewarning import line_warnings
from dnc.pacing import Pace
from dnc.port import SerialPort
from dnc.profile import Control, Link, load_profile
from dnc.progress import printable
from dnc.record import doubt_of, doubt_words, in_doubt
from dnc.shipped import shipped_path
from tests.helpers.line import XOFF, XON, alarm_ids, drain, read_until, sender_of, tape_of

ROOT = Path(__file__).parents[2]
PROGRAM = b"".join(b"N%d G1 X%d\n" % (index * 10, index) for index in range(1, 201)) + b"M30\n%\n"


def test_every_row_of_the_table_names_a_test_that_exists() -> None:
    """(5.10) docs/faults.md: each id of the list once, with tests whose docstrings name the id; the totals are true."""
    page = (ROOT / "docs/faults.md").read_text()
    rows = re.findall(r"^\| ([LACPO]\d+) \|.*\| ([^|]+) \|$", page, re.MULTILINE)
    by_hand = [fault for fault, shown in rows if "manual" in shown]
    assert f"{len(rows)} faults: every one has a test, {len(by_hand)} of them a manual test too" in page
    named = set(re.findall(r"`(test_\w+)`", page))
    assert f"Each of the {len(named)} tests named here" in page
    wanted = [f"L{n}" for n in range(1, 15)] + [f"A{n}" for n in range(1, 13)] + [f"C{n}" for n in range(1, 13)]
    wanted += [f"P{n}" for n in range(1, 8)] + [f"O{n}" for n in range(1, 10)]
    assert [fault for fault, _ in rows] == wanted
    sources = {path: path.read_text() for path in (ROOT / "tests").rglob("test_*.py")}
    for fault, shown in rows:
        names = re.findall(r"`(test_\w+)`", shown)
        assert names, f"{fault} has no test"
        for name in names:
            places = [text for text in sources.values() if f"def {name}(" in text]
            assert places, f"{fault}: there is no {name}"
            cited = re.search(rf"def {name}\((?:.|\n)*?\"\"\"((?:.|\n)*?)\"\"\"", places[0])
            assert cited is not None
            assert re.search(rf"\b{fault}\b", cited[1]), f"{name} does not name {fault}"


def test_every_alarm_has_a_meaning_a_remedy_and_a_row() -> None:
    """(5.10) The id of an alarm is that of its fault in docs/faults.md, or of a fault of the host (H)."""
    kinds = [kind for kind in vars(alarms).values() if isinstance(kind, alarms.Kind)]
    assert len({kind.id for kind in kinds}) == len(kinds) > 10
    table = (ROOT / "docs/faults.md").read_text()
    for kind in kinds:
        assert len(kind.text) > 10
        assert len(kind.remedy) > 10
        found = re.fullmatch(r"DNC-([LACH]\d+)[TP]?", kind.id)
        assert found is not None, kind.id
        assert found[1].startswith("H") or f"| {found[1]} |" in table


def test_a_lost_xon_is_a_long_hold(tmp_path: Path) -> None:
    """(fault L2) Nothing is sent on a guess; the warning says what to look at, once."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    drain(sender, 0.0, until_s=0.1)
    sender.hear(XOFF, 0.1)
    sent = sender.offset_bytes
    events = [event for second in range(1000) for event in sender.tick(0.1 + second)]
    assert alarm_ids(events) == ["DNC-L1"]
    assert [event.severity for event in events if isinstance(event, Alarm)] == [Severity.WARNING]
    assert (sender.state, sender.offset_bytes) == (JobState.HELD, sent)


def test_a_lost_xoff_ends_by_the_controls_alarm(tmp_path: Path) -> None:
    """(fault L3) Nobody here can see a lost XOFF; the control's overrun alarm stops the job with a window."""
    tape = tape_of(tmp_path, PROGRAM)
    sender = sender_of(tape)
    sender.start(0.0)
    drain(sender, 0.0, until_s=1.0)
    assert alarm_ids(sender.hear(b"\x13\x15", 1.0)) == ["DNC-C2"]
    assert sender.state is JobState.FAULTED
    doubt = in_doubt(tape, sender.offset_bytes, 3, Control(receive_buffer_bytes=200, lookahead_blocks=2))
    assert doubt is not None
    assert "in doubt from line" in doubt_words(tape, doubt)


def test_after_an_overrun_only_what_xon_proved_counts_as_executed(tmp_path: Path) -> None:
    """(fault L3) The control kept no byte behind its full buffer: blocks never seen were called executed."""
    tape = tape_of(tmp_path, PROGRAM)
    control = Control(receive_buffer_bytes=200, xoff_free_bytes=50, xon_fill_bytes=60, lookahead_blocks=2)
    sender = sender_of(tape)
    sender.start(0.0)
    drain(sender, 0.0, until_s=0.3)
    sender.hear(XOFF, 0.3)
    sender.hear(XON, 0.4)
    at_xon = sender.offset_bytes
    drain(sender, 0.4, until_s=1.4)
    assert sender.offset_bytes - at_xon > 400
    sender.hear(b"\x13\x15", 1.4)
    doubt = doubt_of(sender, control)
    assert doubt is not None
    held_back = control.xon_fill_bytes + sender.clock.pace.inflight_max_bytes
    assert doubt.first == tape.lines.line_at(tape, at_xon - held_back) - 2
    assert f"what lies before line {doubt.first} (N" in doubt_words(tape, doubt)
    assert "if the control took" not in doubt_words(tape, doubt)


@pytest.mark.parametrize("told", [b"\x07", b"\x11"])
def test_where_noise_came_no_xon_is_a_proof(tmp_path: Path, told: bytes) -> None:
    """(faults L3, L4, L14) An XON that was noise, or came unasked, says nothing of what the control had executed."""
    tape = tape_of(tmp_path, PROGRAM)
    control = Control(receive_buffer_bytes=200, xoff_free_bytes=50, xon_fill_bytes=60, lookahead_blocks=2)
    sender = sender_of(tape)
    sender.start(0.0)
    for data, at_s in ((told, 0.2), (XOFF, 0.3), (XON, 0.4)):
        drain(sender, 0.0, until_s=at_s)
        sender.hear(data, at_s)
    drain(sender, 0.4, until_s=1.4)
    sender.hear(b"\x13\x15", 1.4)
    assert "if the control took all that was sent and was not switched off since" in doubt_words(
        tape, doubt_of(sender, control)
    )


def test_a_spurious_xoff_is_a_short_hold(tmp_path: Path) -> None:
    """(fault L5) No alarm; the hold is counted."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    drain(sender, 0.0, until_s=0.1)
    events = [*sender.hear(XOFF, 0.1), *sender.tick(0.4), *sender.hear(XON, 0.5)]
    assert alarm_ids(events) == []
    assert (sender.state, sender.tally.xoff_count) == (JobState.SENDING, 1)


def test_flipped_and_dropped_bytes_are_the_controls_to_find(tmp_path: Path) -> None:
    """(faults L8, L9) The control's alarm faults the job; the block being executed lies in the window."""
    tape = tape_of(tmp_path, PROGRAM)
    control = Control(receive_buffer_bytes=300, lookahead_blocks=5)
    sender = sender_of(tape)
    sender.start(0.0)
    drain(sender, 0.0, until_s=1.0)
    executed = tape.lines.line_at(tape, sender.offset_bytes - 3 - 300) - 5
    assert alarm_ids(sender.hear(b"\x13\x15", 1.0)) == ["DNC-C2"]
    assert sender.state is JobState.FAULTED
    doubt = in_doubt(tape, sender.offset_bytes, 3, control)
    assert doubt is not None
    assert doubt.first <= executed <= doubt.last


def test_no_byte_leaves_twice(tmp_path: Path) -> None:
    """(fault L10) Every byte once, in order, whatever the holds (see also the rule-based machine, I1)."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    out, now_s = b"", 0.0
    for _ in range(40):
        more, now_s = drain(sender, now_s, until_s=now_s + 0.05)
        sender.hear(XOFF, now_s)
        now_s += 0.1
        sender.hear(XON, now_s)
        out += more
    out += drain(sender, now_s)[0]
    assert out == PROGRAM


def test_a_close_that_blocks_is_left_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    """(fault A10) `close` gives up after its deadline and says so; the lock is free again."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    port = SerialPort(os.ttyname(slave), Link())
    release = threading.Event()
    really = serial.Serial.close
    monkeypatch.setattr(serial.Serial, "close", lambda self: (release.wait(10), really(self))[1])
    begun_s = time.monotonic()
    assert not port.close()
    assert 1.5 < time.monotonic() - begun_s < 4.0
    release.set()
    os.close(slave)
    os.close(master)


def test_a_port_that_does_not_close_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """(fault A10) The job ends as SENT, exit 0, with a warning that names the remedy."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    program, report = tmp_path / "part.mpf", tmp_path / "report.json"
    program.write_bytes(b"G0 Z500\nM30\n")
    closes = SerialPort.close
    monkeypatch.setattr(SerialPort, "close", lambda self: closes(self) and False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    done = CliRunner().invoke(
        command_line, ["send", str(program), "--port", os.ttyname(slave), "--report", str(report)]
    )
    assert (done.exit_code, read_until(master, b"M30\n")) == (0, program.read_bytes())
    (alarm,) = json.loads(report.read_text())["alarms"]
    assert (alarm["id"], alarm["severity"]) == ("DNC-A10", "warning")
    assert "unplug the adapter" in done.stderr
    os.close(slave)
    os.close(master)


def test_no_permission_names_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """(fault A11)"""
    master, slave = pty.openpty()

    def forbidden(**_options: object) -> serial.Serial:
        raise serial.SerialException(errno.EACCES, "Permission denied")

    monkeypatch.setattr(serial, "Serial", forbidden)
    with pytest.raises(PortUnavailable, match="usermod -aG dialout") as refused:
        SerialPort(os.ttyname(slave), Link())
    assert refused.value.exit_code == ExitCode.PORT
    os.close(slave)
    os.close(master)


def test_a_deep_fifo_does_not_widen_the_bound(tmp_path: Path) -> None:
    """(fault A7) It takes all it is given; the clock alone bounds what is under way, and records it at XOFF."""
    sender = sender_of(tape_of(tmp_path, PROGRAM), Pace(0.001, 3, lag_s=150e-6, slack=0.012))
    sender.start(0.0)
    now_s, free_s, worst = 0.0, 0.0, 0
    for _ in range(1000):
        free_s = max(free_s, now_s) + len(sender.take(4096, now_s)) * 0.001
        worst = max(worst, math.ceil((free_s - now_s) / 0.001 - 1e-6))
        now_s += 0.0007
    assert worst == 3
    now_s = max(now_s, sender.next_wake_s)
    sender.take(4096, now_s)
    sender.hear(XOFF, now_s)
    assert sender.tally.inflight_at_xoff_bytes_max == 3


def test_a_bound_beyond_what_the_control_forgives_is_said() -> None:
    """(5.3; fault A6) Adapter latency counts: 10 bytes forgiven behind a 16 ms adapter need another handshake."""
    import msgspec

    profile = load_profile(shipped_path("machines", "sinumerik-840d"))

    class Local:
        is_bound_assured = True

    strict = msgspec.structs.replace(
        profile,
        control=msgspec.structs.replace(profile.control, overrun_allowed_bytes=10),
        link=msgspec.structs.replace(profile.link, adapter_latency_s=0.016),
    )
    (warning,) = line_warnings(strict, Local())  # type: ignore[arg-type]
    assert "up to 18 bytes may arrive after XOFF, this control forgives 10" in warning
    assert "driver" in warning
    assert line_warnings(profile, Local()) == []  # type: ignore[arg-type]


def test_waiting_at_m0_is_no_alarm(tmp_path: Path) -> None:
    """(faults C6, C7) A hold at M0, a tool change or feed override 0 is neutral for two minutes, then a warning."""
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    sender.hear(XOFF, 0.0)
    assert [event for second in range(119) for event in sender.tick(float(second))] == []
    assert sender.state is JobState.HELD


def test_what_the_control_says_is_kept_and_never_shown_raw(tmp_path: Path) -> None:
    """(fault C12) Captured up to a limit, escaped, not obeyed."""
    keep = Capture(tmp_path / "heard", 10)
    keep(Noise(0.0, 0, b"ALARM 1\x1b[2J"))
    keep(Noise(0.0, 0, b"more"))
    assert (tmp_path / "heard").read_bytes() == b"ALARM 1\x1b[2"
    assert printable("ALARM\x1b[2J\u202e") == "ALARM<1B>[2J<202E>"
    sender = sender_of(tape_of(tmp_path, PROGRAM))
    sender.start(0.0)
    assert alarm_ids(sender.hear(b"N10 M30", 0.1)) == []
    assert sender.state is JobState.SENDING
