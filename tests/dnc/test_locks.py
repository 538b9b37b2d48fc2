"""The lock files that older programs look for (5.5)."""

from __future__ import annotations

import os
from pathlib import Path

from dnc.locks import UucpLock, lock_name


def test_lock_files(tmp_path: Path) -> None:
    """(5.5) UUCP locks: a living holder is named, a dead one's file is taken over, ours is removed."""
    device = Path("/dev/ttyUSB7")
    lock = UucpLock(device, tmp_path)
    path = tmp_path / lock_name(device)
    assert lock.acquire() is None
    assert int(path.read_text()) == os.getpid()
    other = UucpLock(device, tmp_path).acquire()
    assert other is not None
    assert str(os.getpid()) in other
    lock.release()
    assert not path.exists()
    path.write_text("  99999999\n")
    assert lock.acquire() is None
    lock.release()
    path.write_text("not a pid")
    assert lock.acquire() is None
    lock.release()
