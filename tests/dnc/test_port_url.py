"""A port behind a network, where the device server is slow, silent or no such server (5.3, 5.5)."""

from __future__ import annotations

import socket
import threading

import pytest
import serial

from dnc import port_url
from dnc.errors import PortUnavailable
from dnc.port_url import UrlPort
from dnc.profile import Link

pytestmark = pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")
"""pyserial's rfc2217 still calls them."""


class SlowServer:
    """A device server's end that takes its time for every write."""

    def __init__(self) -> None:
        self.heard, self.is_closed = b"", threading.Event()
        self.is_asked, self.may_go_on = threading.Event(), threading.Event()

    def read(self, _count: int) -> bytes:
        if self.is_closed.wait(0.05):
            raise serial.SerialException("closed")
        return b""

    def write(self, data: bytes) -> None:
        self.is_asked.set()
        self.may_go_on.wait(10)
        if self.is_closed.is_set():
            raise serial.SerialException("closed")
        self.heard += data

    def close(self) -> None:
        self.is_closed.set()


@pytest.mark.parametrize("is_purged", [False, True])
def test_a_close_waits_for_what_is_under_way(monkeypatch: pytest.MonkeyPatch, *, is_purged: bool) -> None:
    """(5.4, 5.5) The last block stayed between two threads, and the job was SENT; what is aborted is not waited for."""
    server = SlowServer()
    monkeypatch.setattr(port_url, "_device_server", lambda name, link: server)
    port = UrlPort("rfc2217://127.0.0.1:4001", Link())
    port.write(b"N1 G1 X1\n")
    assert server.is_asked.wait(10)
    port.write(b"M30\n")
    if is_purged:
        port.purge()
    threading.Timer(0.1, server.may_go_on.set).start()
    assert port.close()
    assert server.heard == (b"" if is_purged else b"N1 G1 X1\nM30\n")


def test_a_server_that_does_not_speak_rfc_2217_is_told_in_plain_words() -> None:
    """(2.7, 5.5) The sentence ended in the negotiation of a library."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        name = f"rfc2217://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(PortUnavailable, match="nothing there speaks RFC 2217; use socket://") as caught:
            UrlPort(name, Link())
    assert "[" not in str(caught.value)
