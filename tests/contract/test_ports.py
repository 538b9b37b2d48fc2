"""One suite for every kind of port: what the stream may rely on (5.3, 5.5)."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import socket
import threading
import time
import tty
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest
import serial
import serial.rfc2217

from dnc.errors import PortLost, PortUnavailable
from dnc.port import Port, SerialPort
from dnc.port_url import UrlPort
from dnc.profile import Link

pytestmark = pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")
"""pyserial's rfc2217 still calls them."""


@dataclass
class Cable:
    """A port and the other end: what the control says, what it hears, pulling the plug."""

    port: Port
    say: Callable[[bytes], object]
    hear: Callable[[int], bytes]
    pull: Callable[[], None]


@contextlib.contextmanager
def over_pty(handshake: str = "xonxoff") -> Iterator[Cable]:
    master, slave = pty.openpty()
    tty.setraw(slave)
    port = SerialPort(os.ttyname(slave), Link(handshake=handshake))  # type: ignore[arg-type]
    ends = [master, slave]

    def pull() -> None:
        while ends:
            os.close(ends.pop())

    yield Cable(port, lambda data: os.write(master, data), lambda count: os.read(master, count), pull)
    port.close()
    pull()


@contextlib.contextmanager
def over_socket() -> Iterator[Cable]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = UrlPort(f"socket://127.0.0.1:{server.getsockname()[1]}", Link())
        control, _ = server.accept()
        control.settimeout(10)
        yield Cable(port, control.sendall, control.recv, control.close)
        port.close()
        control.close()


class DeviceServer(threading.Thread):
    """An RFC 2217 server in front of a pty, as a device server stands in front of a control."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        self._serial = serial.Serial(os.ttyname(slave), timeout=0)
        os.close(slave)
        self._server = socket.create_server(("127.0.0.1", 0))
        self.number = self._server.getsockname()[1]
        self.connection: socket.socket | None = None
        self.start()

    def write(self, data: bytes) -> None:
        """The manager's way to the host."""
        assert self.connection is not None
        self.connection.sendall(data)

    def run(self) -> None:
        self.connection, _ = self._server.accept()
        manager = serial.rfc2217.PortManager(_Steady(self._serial), self)
        with contextlib.suppress(OSError, serial.SerialException, ValueError):
            while True:
                ready, _, _ = select.select([self.connection, self._serial.fileno()], [], [], 10)
                if self.connection in ready:
                    data = self.connection.recv(4096)
                    if not data:
                        return
                    self._serial.write(b"".join(manager.filter(data)))
                if self._serial.fileno() in ready:
                    self.write(b"".join(manager.escape(self._serial.read(4096))))

    def pull(self) -> None:
        if self.connection is not None:
            with contextlib.suppress(OSError):
                self.connection.shutdown(socket.SHUT_RDWR)
            self.connection.close()

    def close(self) -> None:
        self.pull()
        self.join(5)
        self._server.close()
        self._serial.close()
        os.close(self.master)


class _Steady:
    """A pty without modem lines or parity, so that the manager can set and ask what it likes."""

    def __init__(self, port: serial.Serial) -> None:
        self._port = port
        self.cts = self.dsr = self.cd = True
        self.ri = False
        self.rts = self.dtr = True
        self.break_condition = False
        self.baudrate, self.bytesize, self.parity, self.stopbits = 9600, 8, "N", 1
        self.xonxoff = self.rtscts = False

    def reset_input_buffer(self) -> None:
        self._port.reset_input_buffer()

    def reset_output_buffer(self) -> None:
        self._port.reset_output_buffer()


@contextlib.contextmanager
def over_rfc2217() -> Iterator[Cable]:
    server = DeviceServer()
    port = UrlPort(f"rfc2217://127.0.0.1:{server.number}", Link())
    yield Cable(
        port, lambda data: os.write(server.master, data), lambda count: os.read(server.master, count), server.pull
    )
    port.close()
    server.close()


@pytest.fixture(params=[over_pty, over_socket, over_rfc2217], ids=["pty", "socket", "rfc2217"])
def cable(request: pytest.FixtureRequest) -> Iterator[Cable]:
    with request.param() as made:
        yield made


def wait_readable(port: Port) -> None:
    assert select.select([port.fileno()], [], [], 10)[0]


def test_bytes_go_out_unchanged(cable: Cable) -> None:
    data = bytes(range(32, 127)) * 3 + b"\xff\x00\x11\x13"
    sent = b""
    while sent != data:
        count = cable.port.write(data[len(sent) :])
        assert 0 <= count <= len(data) - len(sent)
        sent += data[len(sent) : len(sent) + count]
    heard = b""
    while len(heard) < len(data):
        heard += cable.hear(4096)
    assert heard == data


def test_what_the_control_says_can_be_selected_and_read(cable: Cable) -> None:
    cable.say(b"\x13")
    wait_readable(cable.port)
    assert cable.port.read() == b"\x13"


def test_reading_never_waits(cable: Cable) -> None:
    assert not select.select([cable.port.fileno()], [], [], 0)[0]
    begun_s = time.monotonic()
    assert cable.port.read() == b""
    assert time.monotonic() - begun_s < 1.0


def read_until_it_fails(port: Port) -> None:
    for _ in range(5):
        port.read()


def test_a_pulled_plug_is_port_lost(cable: Cable) -> None:
    cable.pull()
    wait_readable(cable.port)
    with pytest.raises(PortLost):
        read_until_it_fails(cable.port)


def test_what_a_port_says_of_itself(cable: Cable) -> None:
    port = cable.port
    assert port.queued_bytes() == 0
    assert port.may_send() is True
    assert port.changed_settings() == ""
    assert port.is_bound_assured == isinstance(port, SerialPort)
    port.purge()
    assert port.close()


@pytest.mark.parametrize(
    "address", ["socket://host", "socket://:4001", "rfc2217://host:x", "socket://host:99999", "loop://"]
)
def test_what_is_no_address_is_refused_in_one_sentence(address: str) -> None:
    """(2.7, 5.3)"""
    with pytest.raises(PortUnavailable, match=r"is no address; write socket://host:port or rfc2217://host:port$"):
        UrlPort(address, Link())


def test_closing_a_socket_drops_nothing_though_the_control_was_not_heard_out() -> None:
    """(1.3, 5.5) An XON that nobody reads any more must not cost the end of the program."""
    with socket.socket() as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        server.bind(("127.0.0.1", 0))
        server.listen()
        port = UrlPort(f"socket://127.0.0.1:{server.getsockname()[1]}", Link())
        control, _ = server.accept()
        sent = 0
        while count := port.write(bytes(8192)):
            sent += count
        control.sendall(b"\x13\x11")
        wait_readable(port)
        closing = threading.Thread(target=port.close)
        closing.start()
        heard = 0
        while data := control.recv(65536):
            heard += len(data)
        control.close()
        closing.join(10)
    assert heard == sent
