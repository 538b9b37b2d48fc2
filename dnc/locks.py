"""Who may use a port: the UUCP lock file that older programs look for, and the names of holders for the message."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

LOCK_FOLDER = Path("/var/lock")
_COMMAND_LETTERS = 160


def lock_name(device: Path) -> str:
    """The UUCP name of a device: LCK..ttyUSB0, LCK..pts-3.

    >>> lock_name(Path("/dev/pts/3"))
    'LCK..pts-3'
    """
    return "LCK.." + "-".join(device.parts[2:] if device.parts[:2] == ("/", "dev") else device.parts[1:])


class UucpLock:
    """A lock file with our process id; a dead owner's file is taken over."""

    def __init__(self, device: Path, folder: Path | None = None) -> None:
        self._path = (folder or LOCK_FOLDER) / lock_name(device)
        self._is_ours = False

    def acquire(self) -> str | None:
        """Take the lock. Returns None, or the words that name the living holder; where the folder is not ours, None."""
        for _ in range(2):
            try:
                fd = os.open(self._path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_CLOEXEC, 0o644)
            except FileExistsError:
                holder = lock_holder(self._path)
                if holder is not None:
                    return holder
                with contextlib.suppress(OSError):
                    self._path.unlink()
                continue
            except OSError:
                return None
            with os.fdopen(fd, "w") as file:
                file.write(f"{os.getpid():10d}\n")
            self._is_ours = True
            return None
        return None

    def release(self) -> None:
        """Give the lock back if it is ours."""
        if self._is_ours:
            self._is_ours = False
            with contextlib.suppress(OSError):
                self._path.unlink()


def lock_holder(lock: Path) -> str | None:
    """Words for the living program that a lock file names, or None; 0 and below are no process, but groups of them.

    What another user's program keeps to itself is taken for alive: two programs on one line mix their bytes.
    """
    try:
        pid = int(lock.read_text(encoding="latin-1").split()[0])
    except PermissionError:
        return f"a program of another user (its lock {lock} cannot be read)"
    except (OSError, ValueError, IndexError):
        return None
    try:
        if pid > 0:
            os.kill(pid, 0)
    except PermissionError:
        return process_words(pid)
    except (OSError, OverflowError):
        return None
    return process_words(pid) if pid > 0 else None


def flock_holder(device: Path) -> str:
    """Words for the process that holds an flock on this device, from /proc/locks; 'another program' if unknown."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        about = device.stat()
        wanted = f"{os.major(about.st_dev):02x}:{os.minor(about.st_dev):02x}:{about.st_ino}"
        for row in Path("/proc/locks").read_text(encoding="ascii").splitlines():
            fields = row.split()
            if fields[1] == "FLOCK" and fields[5] == wanted:
                return process_words(int(fields[4]))
    return "another program"


def process_words(pid: int) -> str:
    """A process for a message: its id and its command.

    >>> process_words(-1)
    'process -1'
    """
    with contextlib.suppress(OSError):
        command = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode("latin-1").strip()
        if command:
            shown = command if len(command) <= _COMMAND_LETTERS else f"{command[: _COMMAND_LETTERS - 3]}..."
            return f"process {pid} ({''.join(char if char.isprintable() else '?' for char in shown)})"
    return f"process {pid}"
