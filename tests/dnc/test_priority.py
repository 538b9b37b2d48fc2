"""What the sending loop asks of the system, and what it says when that is refused (5.2; fault H4)."""

from __future__ import annotations

import gc
import os
import struct
from pathlib import Path

import pytest

from dnc.forewarning import haste_warnings
from dnc.port import SerialPort
from dnc.priority import WAKES_WITHIN_US, in_front, light_sleep, on_time
from dnc.profile import Link


def refuse(*_: object) -> None:
    raise PermissionError(1, "Operation not permitted")


def test_no_collection_inside_and_all_as_before_behind() -> None:
    before = os.sched_getscheduler(0)
    with on_time() as granted:
        assert not gc.isenabled()
        assert (os.sched_getscheduler(0) & 0xF == os.SCHED_FIFO) == granted.is_realtime
    assert gc.isenabled()
    assert os.sched_getscheduler(0) == before


def test_priority_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with in_front() as is_realtime:
        assert not is_realtime


def test_refused_priority_is_said_where_bytes_stop_us(monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.2) It was said in the report only, which nobody reads before the first byte."""
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    master, slave = os.openpty()
    try:
        port = SerialPort(os.ttyname(slave), Link())
        (warning,) = haste_warnings(port)
        port.close()
        driven = SerialPort(os.ttyname(slave), Link(handshake="driver"))
        assert haste_warnings(driven) == []
        driven.close()
    finally:
        os.close(slave)
        os.close(master)
    assert "dnc doctor" in warning


def test_wish_for_light_sleep_is_held_open(tmp_path: Path) -> None:
    """The kernel forgets the wish as soon as the file is closed: it must be open throughout."""
    wish = tmp_path / "cpu_dma_latency"
    os.mkfifo(wish)
    with light_sleep(wish) as is_granted:
        assert is_granted
        reader = os.open(wish, os.O_RDONLY | os.O_NONBLOCK)
        assert struct.unpack("=i", os.read(reader, 4)) == (WAKES_WITHIN_US,)
        with pytest.raises(BlockingIOError):
            os.read(reader, 1)  # a closed writer would give an end of file
    assert os.read(reader, 1) == b""
    os.close(reader)


def test_no_wish_without_the_device(tmp_path: Path) -> None:
    with light_sleep(tmp_path / "cpu_dma_latency") as is_granted:
        assert not is_granted
    assert not (tmp_path / "cpu_dma_latency").exists()
