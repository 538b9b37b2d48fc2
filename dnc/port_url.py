"""A port behind a network: socket:// and rfc2217://. XOFF arrives at no bounded time, so no bound is promised."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import time
import urllib.parse

import serial

from dnc.errors import PortLost, PortUnavailable
from dnc.port import FLOWS
from dnc.profile import Link

_CHUNK_BYTES = 4096
_CONNECT_S = 5.0
_LINGER_S = 2.0
_REFUSED = "the device server does not take this baud rate or format; set them as at the control, or use socket://"
_REFUSALS = {
    "support RFC2217": "nothing there speaks RFC 2217; use socket:// where the server passes bytes on as they are",
    "not accept parameter change": _REFUSED,
    "rejected value": _REFUSED,
}
"""What pyserial says of a device server, and what it means."""


class UrlPort:
    """The verbs of Port over a network. pyserial's threads of rfc2217:// sit behind a socket pair, to be selectable."""

    is_simulated = False
    is_bound_assured = False

    def __init__(self, name: str, link: Link) -> None:
        self.name = self.identity = name
        self._is_purged = False
        host, number = _address(name)
        self.flow = FLOWS[link.handshake]
        if link.handshake not in ("xonxoff", "none"):
            raise PortUnavailable(f"{name}: handshake {link.handshake} does not reach across a network; use xonxoff")
        self._connection: socket.socket | None = None
        self._bridge: _Bridge | None = None
        try:
            if name.startswith("socket://"):
                self._connection = socket.create_connection((host, number), _CONNECT_S)
                self._connection.setblocking(False)
                _slim(self._connection)
                self._fd = self._connection.fileno()
            else:
                self._bridge = _Bridge(_device_server(name, link))
                self._fd = self._bridge.fileno()
        except (serial.SerialException, OSError, ValueError) as problem:
            raise PortUnavailable(f"{name} cannot be opened: {_reason(problem)}") from None

    def fileno(self) -> int:
        """The descriptor, for select."""
        return self._fd

    def read(self) -> bytes:
        """What has arrived; an empty answer is the end of the connection."""
        try:
            data = os.read(self._fd, _CHUNK_BYTES)
        except BlockingIOError:
            return b""
        except OSError as problem:
            raise PortLost(f"{self.name} was lost: {problem.strerror}") from None
        if not data:
            raise PortLost(f"{self.name} was closed by its other end")
        return data

    def write(self, data: bytes) -> int:
        """How many bytes the system accepted."""
        try:
            return os.write(self._fd, data)
        except BlockingIOError:
            return 0
        except OSError as problem:
            raise PortLost(f"{self.name} was lost: {problem.strerror}") from None

    def queued_bytes(self) -> int:
        """Nobody can tell."""
        return 0

    def may_send(self) -> bool:
        """No modem line is read across a network."""
        return True

    def changed_settings(self) -> str:
        """The device server's settings are its own affair."""
        return ""

    def purge(self) -> None:
        """What has been given to the network cannot be called back; closing then waits for none of it."""
        self._is_purged = True

    def close(self) -> bool:
        """Let go of the connection, once what is under way has arrived or the other end takes too long."""
        if self._connection is not None:
            if not self._is_purged:
                _hear_out(self._connection)
            self._connection.close()
        if self._bridge is not None:
            if not self._is_purged:
                self._bridge.flush()
            self._bridge.close()
        return True


def _slim(connection: socket.socket) -> None:
    """Let little wait on our side: the system would take 4 MB for a device server that has stopped reading."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _CHUNK_BYTES)


def _hear_out(connection: socket.socket) -> None:
    """Say that nothing follows, then read what still comes: closed with bytes unread, a socket drops those unsent."""
    until_s = time.monotonic() + _LINGER_S
    with contextlib.suppress(OSError):
        connection.shutdown(socket.SHUT_WR)
        while (left_s := until_s - time.monotonic()) > 0:
            if select.select([connection], [], [], left_s)[0] and not connection.recv(_CHUNK_BYTES):
                break


def _address(name: str) -> tuple[str, int]:
    """Host and port of a device server; raises PortUnavailable for what is no address of one."""
    with contextlib.suppress(ValueError):
        parts = urllib.parse.urlsplit(name)
        if parts.scheme in ("socket", "rfc2217") and parts.hostname and parts.port:
            return parts.hostname, parts.port
    raise PortUnavailable(f"{name} is no address; write socket://host:port or rfc2217://host:port")


def _device_server(name: str, link: Link) -> serial.Serial:
    return serial.serial_for_url(
        name,
        baudrate=link.baud,
        bytesize=int(link.format[0]),
        parity=link.format[1],
        stopbits=float(link.format[2:]),
        timeout=0.2,
    )


class _Bridge:
    """Two threads between pyserial's blocking calls and one selectable socket."""

    def __init__(self, port: serial.Serial) -> None:
        self._port = port
        self._ours, self._theirs = socket.socketpair()
        for end in (self._ours, getattr(port, "_socket", None)):  # pyserial's own name: without it only wider
            if end is not None:
                _slim(end)
        self._ours.setblocking(False)
        works = (self._inward, self._outward)
        self._threads = [threading.Thread(target=work, name="rfc2217", daemon=True) for work in works]
        for thread in self._threads:
            thread.start()

    def fileno(self) -> int:
        return self._ours.fileno()

    def flush(self) -> None:
        """Take nothing more, and wait for what is between the threads: closed at once, the last block stayed there."""
        with contextlib.suppress(OSError):
            self._ours.shutdown(socket.SHUT_WR)
        self._threads[-1].join(_LINGER_S)

    def close(self) -> None:
        with contextlib.suppress(OSError, serial.SerialException):
            self._port.close()
        for end in (self._theirs, self._ours):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join(1.0)
        self._theirs.close()
        self._ours.close()

    def _inward(self) -> None:
        """From the port to us, until either end dies."""
        try:
            while True:
                data = self._port.read(1)
                if data:
                    self._theirs.sendall(data)
        except (OSError, TypeError, serial.SerialException):
            self._hang_up()

    def _outward(self) -> None:
        """From us to the port, until either end dies."""
        try:
            while data := self._theirs.recv(_CHUNK_BYTES):
                self._port.write(data)
        except (OSError, TypeError, serial.SerialException):
            self._hang_up()

    def _hang_up(self) -> None:
        with contextlib.suppress(OSError):
            self._theirs.shutdown(socket.SHUT_RDWR)


def _reason(problem: Exception) -> str:
    """Why a port cannot be opened, and what to do; pyserial's own words only where nothing better is known."""
    text, network = str(problem), "check address, port number and network"
    for cause in (problem, problem.__context__):
        if isinstance(cause, OSError) and cause.strerror:
            return f"{cause.strerror}; {network}"
    known = next((meant for said, meant in _REFUSALS.items() if said in text), None)
    return known or f"{text.splitlines()[0]}; {network}"
