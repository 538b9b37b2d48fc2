"""Opening, locking and losing a port; the termios rim by values (1.3, 5.3, 5.4, 5.5)."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import pty
import select
import struct
import termios
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from dnc.device_names import identity_of
from dnc.errors import ExitCode, PortLost, PortUnavailable
from dnc.port import _MODEM, SerialPort
from dnc.port_settings import set_flow_characters
from dnc.profile import Link

COARSE_CLOCK = 5
"""The clock that dates files."""


@pytest.fixture
def cable() -> Iterator[tuple[int, str]]:
    master, slave = pty.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    os.close(slave)
    os.close(master)


def test_a_pty_is_simulated_and_carries_bytes(cable: tuple[int, str]) -> None:
    master, name = cable
    port = SerialPort(name, Link(format="7E2"))
    assert port.is_simulated
    assert port.write(b"G1\n") == 3
    assert os.read(master, 10) == b"G1\n"
    os.write(master, b"\x13")
    select.select([port.fileno()], [], [], 5)
    assert port.read() == b"\x13"
    assert port.read() == b""
    assert port.close()


@pytest.mark.parametrize("baud", [110, 300, 1200, 9600, 12345, 115200, 1152000])
def test_every_rate(cable: tuple[int, str], baud: int) -> None:
    """(5.4) Standard and custom rates."""
    assert SerialPort(cable[1], Link(baud=baud)).close()


@pytest.mark.parametrize("form", ["5N1.5", "6O1", "7E1", "7M1", "8N2", "8S1"])
def test_every_format(cable: tuple[int, str], form: str) -> None:
    """(5.4)"""
    assert SerialPort(cable[1], Link(format=form)).close()


def test_a_second_sender_is_told_who_holds_the_port(cable: tuple[int, str]) -> None:
    """(5.5; faults A4, O1)"""
    first = SerialPort(cable[1], Link())
    with pytest.raises(PortUnavailable, match=f"already in use by process {os.getpid()}"):
        SerialPort(cable[1], Link())
    assert first.close()
    assert SerialPort(cable[1], Link()).close()


def test_a_program_that_locks_without_lock_file_is_named_too(cable: tuple[int, str]) -> None:
    """(5.5)"""
    fd = os.open(cable[1], os.O_RDWR | os.O_NOCTTY)
    fcntl.flock(fd, fcntl.LOCK_EX)
    with pytest.raises(PortUnavailable, match=f"already in use by (process {os.getpid()}|another program)"):
        SerialPort(cable[1], Link())
    os.close(fd)
    assert SerialPort(cable[1], Link()).close()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("/dev/no-such-port", "No such file"),
        ("/dev/null", "not a serial port"),
        ("/tmp", "Is a directory"),
        ("", "name is empty"),
    ],
)
def test_what_is_no_port(name: str, words: str) -> None:
    """(1.3)"""
    with pytest.raises(PortUnavailable, match=words):
        SerialPort(name, Link())


def test_a_name_that_leads_in_a_circle_is_no_port(tmp_path: Path) -> None:
    """(1.3) It was an internal fault."""
    (tmp_path / "port").symlink_to(tmp_path / "port")
    with pytest.raises(PortUnavailable, match="symbolic links; see dnc ports"):
        SerialPort(str(tmp_path / "port"), Link())


def test_a_pty_has_no_modem_lines(cable: tuple[int, str]) -> None:
    """(5.3)"""
    for handshake in ("rtscts", "dtrdsr"):
        with pytest.raises(PortUnavailable, match="no modem lines"):
            SerialPort(cable[1], Link(handshake=handshake))  # type: ignore[arg-type]


@pytest.mark.parametrize("action", ["read", "write"])
@pytest.mark.parametrize("problem", [OSError(errno.EIO, "I/O"), OSError(errno.ENXIO, "gone")])
def test_every_error_is_one_port_lost(
    cable: tuple[int, str], monkeypatch: pytest.MonkeyPatch, action: str, problem: OSError
) -> None:
    """(5.5)"""
    port = SerialPort(cable[1], Link())

    def broken(*_args: object) -> int:
        raise problem

    with monkeypatch.context() as patch:
        patch.setattr(os, action, broken)
        with pytest.raises(PortLost):
            port.read() if action == "read" else port.write(b"x")
    port.close()


def test_eagain_is_not_an_error(cable: tuple[int, str]) -> None:
    """(5.5) A full pty accepts part, then nothing."""
    port = SerialPort(cable[1], Link())
    accepted = port.write(b"x" * 100_000)
    assert 0 < accepted < 100_000
    assert eventually(lambda: port.write(b"x" * 1000) == 0)
    port.close()


def test_termios_error_is_port_lost(cable: tuple[int, str], monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.5)"""
    port = SerialPort(cable[1], Link())
    port.is_simulated = False

    def broken(_fd: int) -> list[object]:
        raise termios.error(errno.EIO, "I/O")

    with monkeypatch.context() as patch:
        patch.setattr(termios, "tcgetattr", broken)
        with pytest.raises(PortLost):
            port.changed_settings()
    port.close()


def test_a_hang_up_is_port_lost() -> None:
    """(5.5; fault A1)"""
    master, slave = pty.openpty()
    tty.setraw(slave)
    port = SerialPort(os.ttyname(slave), Link())
    os.close(slave)
    os.close(master)
    with pytest.raises(PortLost, match="unplugged or its other end closed"):
        port.read()
    with pytest.raises(PortLost):
        port.write(b"x")
    assert port.close()


def test_closing_throws_nothing_away(cable: tuple[int, str], monkeypatch: pytest.MonkeyPatch) -> None:
    """(1.3, 5.5) The last bytes may lie in a queue or a chip when the job is SENT: only a stop in the middle purges."""
    master, name = cable
    port = SerialPort(name, Link())
    flushed: list[int] = []
    monkeypatch.setattr(termios, "tcflush", lambda _fd, what: flushed.append(what))
    port.write(b"M30\n")
    assert port.close()
    assert flushed == []
    assert os.read(master, 10) == b"M30\n"


def test_a_format_that_the_driver_drops_is_refused(cable: tuple[int, str], monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.4; fault A8) A pty drops 7E2 in silence, as some adapters do; taken for a real port it is found out."""
    monkeypatch.setattr("dnc.port.is_pty", lambda _device: False)
    with pytest.raises(PortUnavailable, match=r"does not accept .*; choose a format .* software_parity") as refused:
        SerialPort(cable[1], Link(format="7E2"))
    assert refused.value.exit_code == ExitCode.PORT
    assert SerialPort(cable[1], Link(format="7E2", software_parity=True)).close()


def test_another_program_that_changes_the_settings_is_noticed(
    cable: tuple[int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """(5.4; fault A5) Read back from the terminal itself, after another descriptor has set another rate."""
    monkeypatch.setattr("dnc.port.is_pty", lambda _device: False)
    port = SerialPort(cable[1], Link(format="8N1"))
    assert port.changed_settings() == ""
    other = termios.tcgetattr(cable[0])
    other[4] = other[5] = termios.B1200
    termios.tcsetattr(cable[0], termios.TCSANOW, other)
    assert "baud rate" in port.changed_settings()
    assert port.close()


@pytest.mark.parametrize(
    ("handshake", "line"), [("rtscts", termios.TIOCM_CTS), ("dtrdsr", termios.TIOCM_DSR), ("xonxoff", 0)]
)
def test_the_modem_line_of_the_handshake_is_read(
    cable: tuple[int, str], monkeypatch: pytest.MonkeyPatch, handshake: str, line: int
) -> None:
    """(5.3; fault L11) The line that falls with the cable; by a fake, because a pty has none."""
    port = SerialPort(cable[1], Link())
    port._modem = _MODEM.get(handshake)
    others = termios.TIOCM_CTS | termios.TIOCM_DSR | termios.TIOCM_CAR
    for lines, may_send in ((others, True), (others & ~line, not line)):
        monkeypatch.setattr(fcntl, "ioctl", lambda *_args, lines=lines: struct.pack("I", lines))
        assert port.may_send() is may_send
    monkeypatch.undo()
    assert port.close()


def with_modem_lines(monkeypatch: pytest.MonkeyPatch, lines: list[int]) -> None:
    """The pty passes for a device with these lines; an empty list is one that has none."""
    real = fcntl.ioctl

    def ioctl(fd: int, what: int, *more: object) -> object:
        if what == termios.TIOCMGET and not lines:
            raise OSError(errno.ENOTTY, "Inappropriate ioctl for device")
        return struct.pack("I", lines[0]) if what == termios.TIOCMGET else real(fd, what, *more)  # type: ignore[call-overload]

    monkeypatch.setattr(fcntl, "ioctl", ioctl)
    monkeypatch.setattr("dnc.port.is_pty", lambda _device: False)
    monkeypatch.setattr("dnc.port.refused_settings", lambda _settings, _link: "")


@pytest.mark.parametrize(
    ("handshake", "at_opening", "missed"),
    [
        ("xonxoff", termios.TIOCM_DSR, "DSR went off, the control was switched off or its cable was pulled$"),
        ("xonxoff", termios.TIOCM_CTS, ""),
        ("rtscts", termios.TIOCM_DSR | termios.TIOCM_CTS, "DSR went off.*, use --handshake dtrdsr, or xonxoff"),
        ("rtscts", termios.TIOCM_CTS, ""),
        ("dtrdsr", termios.TIOCM_DSR | termios.TIOCM_CTS, "CTS went off.*, use --handshake rtscts, or xonxoff"),
        ("dtrdsr", termios.TIOCM_DSR, ""),
    ],
)
def test_a_control_that_is_switched_off_is_port_lost(
    cable: tuple[int, str], monkeypatch: pytest.MonkeyPatch, handshake: str, at_opening: int, missed: str
) -> None:
    """(5.7; faults C9, L11) Where it showed at the opening that it is there; by a fake, because a pty has no lines.

    With RTS/CTS and DTR/DSR its next power-on resumed the job by itself.
    """
    lines = [at_opening]
    with_modem_lines(monkeypatch, lines)
    port = SerialPort(cable[1], Link(handshake=handshake))  # type: ignore[arg-type]
    assert port.changed_settings() == ""
    lines[0] = 0
    with pytest.raises(PortLost, match=missed) if missed else contextlib.nullcontext():
        port.changed_settings()
    assert port.close()


@pytest.mark.parametrize("handshake", ["rtscts", "dtrdsr"])
def test_a_device_without_modem_lines_is_refused(
    cable: tuple[int, str], monkeypatch: pytest.MonkeyPatch, handshake: str
) -> None:
    """(5.3) It was opened, and PORT LOST at the first byte."""
    with_modem_lines(monkeypatch, [])
    with pytest.raises(PortUnavailable, match="has no modem lines"):
        SerialPort(cable[1], Link(handshake=handshake))  # type: ignore[arg-type]
    SerialPort(cable[1], Link()).close()


def test_software_parity_on_the_wire(cable: tuple[int, str]) -> None:
    """(5.4) 7E1 where the driver cannot: the parity bit is in the bytes."""
    master, name = cable
    port = SerialPort(name, Link(format="7E1", software_parity=True))
    port.write(b"G1\n")
    data = os.read(master, 10)
    assert bytes(code & 0x7F for code in data) == b"G1\n"
    assert all(code.bit_count() % 2 == 0 for code in data)
    port.close()


def test_custom_flow_characters_reach_the_driver(cable: tuple[int, str]) -> None:
    """(5.3) Driver handshake: the kernel obeys our characters, and a held pty takes nothing."""
    master, name = cable
    port = SerialPort(name, Link(handshake="driver", xon=0x91, xoff=0x93))
    settings = termios.tcgetattr(port.fileno())
    assert settings[0] & termios.IXON
    assert (settings[6][termios.VSTART], settings[6][termios.VSTOP]) == (b"\x91", b"\x93")
    os.write(master, b"\x93")
    assert eventually(lambda: port.write(b"x") == 0)
    os.write(master, b"\x91")
    assert eventually(lambda: port.write(b"x") == 1)
    set_flow_characters(port.fileno(), Link())
    assert termios.tcgetattr(port.fileno())[6][termios.VSTOP] == b"\x13"
    port.close()


def eventually(is_so: Callable[[], bool]) -> bool:
    """The kernel hands the control's bytes over in a worker of its own."""
    end_s = time.monotonic() + 5
    while time.monotonic() < end_s:
        if is_so():
            return True
    return False


def test_a_pty_born_anew_is_another_port() -> None:
    """(5.5; fault A2) The same name later is not the same control."""
    seen = {born_now() for _ in range(20)}
    names = {identity.split()[0] for identity in seen}
    assert len(seen) > len(names)


def born_now() -> str:
    """The identity of a new pty, gone again; at least a tick of the clock that dates it after the one before."""
    ticked_s = time.clock_gettime(COARSE_CLOCK)
    while time.clock_gettime(COARSE_CLOCK) == ticked_s:
        pass
    master, slave = pty.openpty()
    try:
        name = Path(os.ttyname(slave))
        identity = identity_of(name)
        assert identity == identity_of(name)
        return identity
    finally:
        os.close(slave)
        os.close(master)
