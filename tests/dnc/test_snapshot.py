"""What a watcher is told of a running job is what its record will say (5.7, 5.10)."""

from __future__ import annotations

import os
from contextlib import closing
from pathlib import Path

import msgspec
import pytest

from dnc.eventlog import EventLog
from dnc.names import JobNames
from dnc.port import SerialPort
from dnc.profile import Control, load_profile
from dnc.record import doubt_of
from dnc.service.snapshot import JobView
from dnc.shipped import shipped_path
from tests.helpers.line import drain, sender_of, tape_of

PROGRAM = b"".join(b"N%d G1 X%d Y2 F250\n" % (number, number) for number in range(1, 200)) + b"M30\n"
XOFF, XON, ALARM, RESET = b"\x13", b"\x11", b"\x13\x15", b"\x13\x16"


@pytest.mark.parametrize("last_word", [ALARM, RESET])
def test_the_screen_calls_nothing_executed_that_the_record_doubts(tmp_path: Path, last_word: bytes) -> None:
    """(5.7; faults L3, C1, C2) After an overrun the console showed blocks as done that the control had never kept."""
    control = Control(receive_buffer_bytes=200, xoff_free_bytes=50, xon_fill_bytes=60, lookahead_blocks=2)
    profile = msgspec.structs.replace(load_profile(shipped_path("machines", "sinumerik-840d")), control=control)
    master, slave = os.openpty()
    port = SerialPort(os.ttyname(slave), profile.link)
    with closing(tape_of(tmp_path, PROGRAM)) as tape:
        sender = sender_of(tape)
        view = JobView(sender, port, profile, JobNames("1", "part.mpf", "sinumerik-840d"), EventLog([]))
        sender.start(0.0)
        for heard, at_s in ((XOFF, 0.3), (XON, 0.4), (last_word, 1.4)):
            drain(sender, at_s - 0.3, until_s=at_s)
            sender.hear(heard, at_s)
        doubt, told = doubt_of(sender, control), view.snapshot()
        assert doubt is not None
        assert told["in_doubt"] == [doubt.first, doubt.last]
        assert doubt.last - doubt.first > 20
        assert [row["zone"] for row in told["window"] if row["line"] <= doubt.last].count("executed") == 0
    port.close()
    os.close(master)
    os.close(slave)
