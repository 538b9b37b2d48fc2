"""The serial ports of this computer: what they are called now, and what they are called tomorrow."""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass
from pathlib import Path

from dnc.device_names import real_path
from dnc.events import LinkState
from dnc.locks import LOCK_FOLDER, flock_holder, lock_holder, lock_name

_PORT_BUS = ("port", "ctrl")
_STABLE = ("by-id", "by-path")


@dataclass(frozen=True, slots=True)
class FoundPort:
    """One port; `by_id` and `by_path` stay the same when the kernel's name changes."""

    device: str
    by_id: str | None
    by_path: str | None
    driver: str | None
    vendor_product: str | None
    is_allowed: bool
    in_use_by: str | None

    @property
    def link(self) -> LinkState:
        """LOCKED while a program has it, otherwise CLOSED: an open one is the business of its own job."""
        return LinkState.CLOSED if self.in_use_by is None else LinkState.LOCKED


def find_ports(root: Path = Path("/")) -> list[FoundPort]:
    """All ports with hardware behind them, below `root` (another one in tests)."""
    found = []
    for entry in sorted((root / "sys/class/tty").glob("*")):
        hardware = entry / "device"
        driver = _driver_of(hardware)
        if driver is None or _is_empty_slot(entry, driver):
            continue
        device = root / "dev" / entry.name
        if device.exists():
            found.append(_port(root, device, hardware, driver))
    return found


def _port(root: Path, device: Path, hardware: Path, driver: str) -> FoundPort:
    stable = {kind: _stable_name(root / "dev/serial" / kind, device) for kind in _STABLE}
    return FoundPort(
        device=str(device),
        by_id=stable["by-id"],
        by_path=stable["by-path"],
        driver=driver,
        vendor_product=_usb_ids(hardware),
        is_allowed=os.access(device, os.R_OK | os.W_OK),
        in_use_by=_user_of(device),
    )


def _stable_name(folder: Path, device: Path) -> str | None:
    with contextlib.suppress(OSError):
        for link in sorted(folder.iterdir()):
            if real_path(link) == real_path(device):
                return str(link)
    return None


def _link_name(link: Path) -> str | None:
    try:
        return Path(link.readlink()).name
    except OSError:
        return None


def _driver_of(hardware: Path) -> str | None:
    """The driver of the chip; since Linux 6.5 the bus of the ports, with drivers of its own, stands before it."""
    driver = _link_name(hardware / "driver")
    with contextlib.suppress(OSError):
        for folder in real_path(hardware).parents:
            if driver not in _PORT_BUS:
                break
            driver = _link_name(folder / "driver") or driver
    return driver


def _said_in(file: Path) -> str:
    """What such a file says, whatever its bytes; raises OSError."""
    return file.read_text(encoding="latin-1").strip()


def _is_empty_slot(entry: Path, driver: str) -> bool:
    """Whether no chip answers at this address: type 0 means that the kernel found none."""
    try:
        return _said_in(entry / "type") == "0"
    except OSError:
        return driver == "serial8250"


def _usb_ids(hardware: Path) -> str | None:
    with contextlib.suppress(OSError):
        real = real_path(hardware)
        for folder in (real, *real.parents):
            if (folder / "idVendor").is_file():
                return f"{_said_in(folder / 'idVendor')}:{_said_in(folder / 'idProduct')}"
    return None


def _user_of(device: Path) -> str | None:
    by_lock = lock_holder(LOCK_FOLDER / lock_name(device))
    if by_lock is not None:
        return by_lock
    holder = flock_holder(device)
    return None if holder == "another program" else holder
