"""The settings of a port by values: what a driver dropped, what another program changed, software parity (5.4)."""

from __future__ import annotations

import termios

import pytest

from dnc.errors import PortUnavailable, SettingsRejected
from dnc.port_settings import difference, parity_table, refused_settings
from dnc.profile import Link
from dnc.sending import link_with


def test_settings_that_the_driver_dropped_are_found() -> None:
    """(5.4; fault A8) By values: size, parity, stop bits."""
    seven_even_two = termios.CS7 | termios.PARENB | termios.CSTOPB
    link = Link(format="7E2")
    assert refused_settings([0, 0, seven_even_two, 0, 13, 13, []], link) == ""
    assert refused_settings([0, 0, termios.CS8, 0, 13, 13, []], link) == "7 data bits"
    assert refused_settings([0, 0, termios.CS7 | termios.CSTOPB, 0, 13, 13, []], link) == "parity E"
    assert refused_settings([0, 0, termios.CS7 | termios.PARENB, 0, 13, 13, []], link) == "2 stop bits"
    assert (
        refused_settings([0, 0, termios.CS8 | termios.CSTOPB, 0, 13, 13, []], Link(format="7E2", software_parity=True))
        == ""
    )


def test_foreign_changes_are_named() -> None:
    """(5.4; fault A5)"""
    characters = [b"\0"] * 32
    before = [0, 0, termios.CS8, 0, 13, 13, characters]
    assert difference(before, list(before)) == ""
    changed = [termios.IXON, 0, termios.CS8, 0, 15, 15, characters]
    assert difference(before, changed) == "input flags, input baud rate, baud rate"
    stops_at = [*characters]
    stops_at[termios.VSTOP] = b"\x13"
    assert difference(before, [*before[:6], stops_at]) == "XOFF character"


@pytest.mark.parametrize("form", ["7M1", "7S1"])
def test_mark_and_space_parity_are_more_than_odd_and_even(form: str) -> None:
    """(5.4; fault A8) A driver that drops the third bit of parity makes 7O1 of 7M1 and 7E1 of 7S1."""
    flags = termios.CS7 | termios.PARENB | (termios.PARODD if form[1] == "M" else 0)
    assert refused_settings([0, 0, flags, 0, 13, 13, []], Link(format=form)) == f"parity {form[1]}"
    assert refused_settings([0, 0, flags | 0o10000000000, 0, 13, 13, []], Link(format=form)) == ""
    other = Link(format="7O1" if form == "7M1" else "7E1")
    assert refused_settings([0, 0, flags | 0o10000000000, 0, 13, 13, []], other) != ""


def test_a_handshake_that_the_driver_does_not_keep_is_found() -> None:
    """(5.3; fault A8) Drivers without it clear the flag in silence, and 128 bytes of a chip run on behind CTS."""
    plain, by_lines = termios.CS8, termios.CS8 | termios.CRTSCTS
    assert refused_settings([0, 0, plain, 0, 13, 13, []], Link(handshake="rtscts")) == "handshake rtscts"
    assert refused_settings([0, 0, by_lines, 0, 13, 13, []], Link(handshake="rtscts")) == ""
    assert refused_settings([0, 0, plain, 0, 13, 13, []], Link(handshake="driver")) == "handshake driver"
    assert refused_settings([termios.IXON, 0, plain, 0, 13, 13, []], Link(handshake="driver")) == ""
    for handshake in ("xonxoff", "dtrdsr", "none"):
        assert refused_settings([0, 0, plain, 0, 13, 13, []], Link(handshake=handshake)) == ""  # type: ignore[arg-type]


def test_a_rate_that_the_driver_did_not_take_is_found() -> None:
    """(5.4; fault A8) 115200 asked, 9600 got; a rate without a constant of its own is not read back."""
    fast = termios.B115200
    assert refused_settings([0, 0, termios.CS8, 0, 13, 13, []], Link(baud=115200)) == "115200 baud"
    assert refused_settings([0, 0, termios.CS8, 0, fast, fast, []], Link(baud=115200)) == ""
    assert refused_settings([0, 0, termios.CS8, 0, 4096, 4096, []], Link(baud=14400)) == ""


def test_software_parity() -> None:
    """(5.4) Even parity makes every byte's ones even; DC3 leaves as 0x93."""
    even, odd = parity_table("7E1"), parity_table("7O1")
    assert (even[0x13], even[0x11], odd[0x13]) == (0x93, 0x11, 0x13)
    assert all(code.bit_count() % 2 == 0 for code in even)
    assert all(code.bit_count() % 2 == 1 for code in odd)
    with pytest.raises(PortUnavailable, match="software parity"):
        parity_table("8E1")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"format": "8N1"}, "cannot make format 8N1; write 7E or 7O"),
        ({"format": "7M1"}, "cannot make format 7M1"),
        ({"format": "7E1", "handshake": "driver"}, "the driver does not know; use --handshake xonxoff"),
    ],
)
def test_software_parity_that_cannot_work_is_refused(given: dict[str, object], words: str) -> None:
    """(5.3, 5.4) Before the port opens; a driver never saw the XOFF, and the control was run over."""
    with pytest.raises(SettingsRejected, match=words):
        link_with(Link(software_parity=True), given)
