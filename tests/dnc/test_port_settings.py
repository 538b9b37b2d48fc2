"""The settings of a port by values: what a driver dropped, what another program changed, software parity (5.4)."""

from __future__ import annotations

import termios

import pytest

from dnc.errors import PortUnavailable
from dnc.port_settings import difference, parity_table, refused_settings
from dnc.profile import Link


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
    before = [0, 0, termios.CS8, 0, 13, 13, [b"\0"]]
    assert difference(before, list(before)) == ""
    assert (
        difference(before, [termios.IXON, 0, termios.CS8, 0, 15, 15, [b"\0"]])
        == "input flags, input baud rate, baud rate"
    )


def test_software_parity() -> None:
    """(5.4) Even parity makes every byte's ones even; DC3 leaves as 0x93."""
    even, odd = parity_table("7E1"), parity_table("7O1")
    assert (even[0x13], even[0x11], odd[0x13]) == (0x93, 0x11, 0x13)
    assert all(code.bit_count() % 2 == 0 for code in even)
    assert all(code.bit_count() % 2 == 1 for code in odd)
    with pytest.raises(PortUnavailable, match="software parity"):
        parity_table("8E1")
