"""The transition table and the ear (5.1)."""

from __future__ import annotations

from pathlib import Path

import pytest

import dnc
from dnc.events import JobState
from dnc.handshake import TABLE, Cause, Heard, Listener, Signal, table_markdown


def test_protocol_page_prints_the_table() -> None:
    """(5.1) PROTOCOL.md is current."""
    page = (Path(dnc.__file__).parent / "PROTOCOL.md").read_text()
    assert table_markdown() in page


def test_only_the_operator_leads_back_to_sending() -> None:
    """(5.1, 5.7) Out of PAUSED only by RESUME; out of ABORTED and FAULTED only by loading anew."""
    back = {cause for (state, cause), new in TABLE.items() if state is JobState.PAUSED and new is JobState.SENDING}
    assert back == {Cause.RESUME}
    for state in (JobState.ABORTED, JobState.FAULTED, JobState.SENT):
        assert {cause for (old, cause) in TABLE if old is state} == {Cause.LOAD}


def test_every_running_state_can_be_aborted_and_lost() -> None:
    running = (JobState.LOADED, JobState.ARMED, JobState.SENDING, JobState.HELD, JobState.PAUSED, JobState.DRAINING)
    for state in running:
        assert TABLE[state, Cause.ABORT] is JobState.ABORTED
        assert TABLE[state, Cause.LOST] is JobState.FAULTED


@pytest.mark.parametrize(
    ("data", "signals"),
    [
        (b"\x11", [Heard(Signal.XON)]),
        (b"\x13", [Heard(Signal.XOFF)]),
        (b"\x93", [Heard(Signal.XOFF, is_masked=True)]),
        (b"ab\x13c", [Heard(Signal.NOISE, data=b"ab"), Heard(Signal.XOFF), Heard(Signal.NOISE, data=b"c")]),
        (b"\x13\x16", [Heard(Signal.XOFF), Heard(Signal.RESET)]),
        (b"\x93\x95", [Heard(Signal.XOFF, is_masked=True), Heard(Signal.ALARM)]),
        (b"\x13 \x15", [Heard(Signal.XOFF), Heard(Signal.NOISE, data=b" \x15")]),
        (b"\x16\x15", [Heard(Signal.NOISE, data=b"\x16\x15")]),
    ],
)
def test_bytes_and_their_meaning(data: bytes, signals: list[Heard]) -> None:
    assert list(Listener(0x11, 0x13).hear(data)) == signals


def test_custom_characters_that_differ_in_bit_7_only_are_compared_whole() -> None:
    """(5.3)"""
    ear = Listener(0x13, 0x93)
    assert [heard.signal for heard in ear.hear(b"\x93\x13")] == [Signal.XOFF, Signal.XON]
