"""What a line's format and handshake mean to the terminal driver, and what the driver made of them."""

from __future__ import annotations

import termios

from dnc.errors import PortUnavailable
from dnc.profile import Link


def parity_table(form: str) -> bytes:
    """256 bytes: each 7-bit character with the parity bit of this format in bit 7."""
    wanted = {"E": 0, "O": 1}.get(form[1])
    if wanted is None or form[0] != "7":
        raise PortUnavailable(f"software parity needs a format such as 7E1, not {form}")
    return bytes(code & 0x7F | ((code & 0x7F).bit_count() & 1 ^ wanted) << 7 for code in range(256))


def set_flow_characters(fd: int, link: Link) -> None:
    """Hand our XON and XOFF characters to the driver or chip."""
    settings = termios.tcgetattr(fd)
    settings[6][termios.VSTART] = bytes([link.xon])
    settings[6][termios.VSTOP] = bytes([link.xoff])
    settings[0] &= ~termios.IXANY
    termios.tcsetattr(fd, termios.TCSANOW, settings)


def refused_settings(settings: list[object], link: Link) -> str:
    """Which part of the format the driver dropped in silence; empty when all was kept."""
    flags = settings[2]
    assert isinstance(flags, int)
    bits, parity, stops = link.format[0], link.format[1], link.format[2:]
    if link.software_parity:
        bits, parity = "8", "N"
    size = {"5": termios.CS5, "6": termios.CS6, "7": termios.CS7, "8": termios.CS8}[bits]
    if flags & termios.CSIZE != size:
        return f"{bits} data bits"
    if bool(flags & termios.PARENB) != (parity != "N") or bool(flags & termios.PARODD) != (parity in "OM"):
        return f"parity {parity}"
    if bool(flags & termios.CSTOPB) != (stops != "1"):
        return f"{stops} stop bits"
    return ""


def difference(before: list[object], now: list[object]) -> str:
    """Words for what differs between two readings of the settings."""
    names = ("input flags", "output flags", "format", "local flags", "input baud rate", "baud rate")
    return ", ".join(name for name, old, new in zip(names, before, now, strict=False) if old != new)
