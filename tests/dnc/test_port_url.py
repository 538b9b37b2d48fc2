"""A port behind a network, where the device server is slow, silent or no such server (5.3, 5.5)."""

from __future__ import annotations

import socket
import threading
from contextlib import closing
from pathlib import Path

import msgspec
import pytest
import serial

from dnc import port_url
from dnc.errors import PortUnavailable
from dnc.job import Job
from dnc.names import JobNames
from dnc.port_url import UrlPort
from dnc.profile import Control, Link, load_profile
from dnc.record import doubt_of
from dnc.shipped import shipped_path
from tests.helpers.line import drain, tape_of

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


@pytest.mark.parametrize("kind", ["socket", "rfc2217"])
def test_what_a_network_takes_while_nobody_reads_is_in_doubt(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """(5.3, 5.7) A device server that obeys XOFF itself stopped reading; 4 MB of blocks were called executed."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    silent = SlowServer()
    monkeypatch.setattr(port_url, "_device_server", lambda name, link: silent)
    control = Control(receive_buffer_bytes=300, xoff_free_bytes=100, xon_fill_bytes=100, lookahead_blocks=5)
    shipped = load_profile(shipped_path("machines", "sinumerik-840d"))
    profile = msgspec.structs.replace(shipped, link=Link(inflight_max_bytes=1000), control=control)
    program = b"".join(b"N%06d G1 X%04d.5\n" % (n, n % 9999) for n in range(1, 20_001))
    with socket.create_server(("127.0.0.1", 0)) as server, closing(tape_of(tmp_path, program)) as tape:
        port = UrlPort(f"{kind}://127.0.0.1:{server.getsockname()[1]}", profile.link)
        job = Job(tape, port, profile, JobNames("1", "part.mpf", "mill"), [])
        job.sender.start(0.0)
        _, now_s = drain(job.sender, 0.0, until_s=300.0)
        sent_bytes = job.sender.offset_bytes
        assert sent_bytes > 200_000
        taken_bytes = 0
        while count := port.write(program[taken_bytes : taken_bytes + 20]):
            taken_bytes += count
        assert taken_bytes < sent_bytes
        job.sender.lost(now_s, "unplugged")
        doubt = doubt_of(job.sender, control)
        assert doubt is not None
        assert doubt.first <= tape.lines.line_at(tape, sent_bytes - taken_bytes - control.receive_buffer_bytes) - 5
        port.purge()
        silent.may_go_on.set()
        port.close()
        job.stream.close()
        job.events.close()


def test_sent_into_a_network_claims_no_more_than_that(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.3) A device server that read nothing: the bytes lay in connections, and the job was SENT like on a cable."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(port_url, "_LINGER_S", 0.0)
    profile = load_profile(shipped_path("machines", "sinumerik-840d"))
    with socket.create_server(("127.0.0.1", 0)) as server, closing(tape_of(tmp_path, b"N10 G0 Z50\nM30\n")) as tape:
        port = UrlPort(f"socket://127.0.0.1:{server.getsockname()[1]}", profile.link)
        finished = Job(tape, port, profile, JobNames("1", "part.mpf", "mill"), []).run()
    assert finished.exit_code == 0
    assert "nobody can tell from here whether the device server passed them on" in finished.sentence
