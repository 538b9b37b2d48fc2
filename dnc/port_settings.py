"""What a line's format and handshake mean to the terminal driver, and what the driver made of them."""

from __future__ import annotations

import termios

from dnc.errors import PortUnavailable
from dnc.profile import Link

_CMSPAR = 0o10000000000  # mark and space parity; the library has no name for it
_CHARACTERS = {"XON character": termios.VSTART, "XOFF character": termios.VSTOP}


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
    """Which part of format, rate or handshake the driver dropped in silence; empty when all was kept.

    Where the driver does not stop by itself, what its queue and the chip hold runs on into the control. A rate that
    has no constant of its own cannot be read back so.
    """
    incoming, flags = settings[0], settings[2]
    assert isinstance(incoming, int)
    assert isinstance(flags, int)
    bits, parity, stops = link.format[0], link.format[1], link.format[2:]
    if link.software_parity:
        bits, parity = "8", "N"
    size = {"5": termios.CS5, "6": termios.CS6, "7": termios.CS7, "8": termios.CS8}[bits]
    if flags & termios.CSIZE != size:
        return f"{bits} data bits"
    if bool(flags & termios.PARENB) != (parity != "N") or bool(flags & termios.PARODD) != (parity in "OM"):
        return f"parity {parity}"
    if bool(flags & _CMSPAR) != (parity in "MS"):
        return f"parity {parity}"
    if bool(flags & termios.CSTOPB) != (stops != "1"):
        return f"{stops} stop bits"
    is_obeyed = {"rtscts": flags & termios.CRTSCTS, "driver": incoming & termios.IXON}
    if not is_obeyed.get(link.handshake, True):
        return f"handshake {link.handshake}"
    rate = getattr(termios, f"B{link.baud}", None)
    if rate is not None and settings[4:6] != [rate, rate]:
        return f"{link.baud} baud"
    return ""


def difference(before: list[object], now: list[object]) -> str:
    """Words for what differs between two readings of the settings."""
    names = ("input flags", "output flags", "format", "local flags", "input baud rate", "baud rate")
    changed = [name for name, old, new in zip(names, before, now, strict=False) if old != new]
    changed += [name for name, at in _CHARACTERS.items() if _character(before, at) != _character(now, at)]
    return ", ".join(changed)


def _character(settings: list[object], at: int) -> object:
    characters = settings[6]
    assert isinstance(characters, list)
    return characters[at]
