"""What a device is called and known by: where its name leads, whether it is a pty, what tells it from another."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from dnc.errors import PortUnavailable


def real_path(path: Path) -> Path:
    """Where a name leads, links followed; links that lead in a circle lead nowhere, and are no fault."""
    return Path(os.path.realpath(path))


def is_pty(device: Path) -> bool:
    """Whether this is the end of a pseudo-terminal, so a simulation and not a machine."""
    return str(device).startswith("/dev/pts/")


def identity_of(device: Path) -> str:
    """What tells this port from another that bears its name later: a pty by its birth, an adapter by its by-id name."""
    if is_pty(device):
        return f"{device} {device.stat().st_ctime_ns}"
    with contextlib.suppress(OSError):
        for link in sorted(Path("/dev/serial/by-id").iterdir()):
            if real_path(link) == device:
                return link.name
    return str(device)


def device_of(name: str) -> Path:
    """The device that this name leads to, links followed; raises PortUnavailable where there is none."""
    if not name:
        raise PortUnavailable("the port's name is empty; see dnc ports")
    try:
        return Path(os.path.realpath(name, strict=True))
    except OSError as problem:
        raise PortUnavailable(f"{name}: {problem.strerror}; see dnc ports") from None
