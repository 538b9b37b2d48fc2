"""The lock files that older programs look for (5.5)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from dnc.locks import UucpLock, lock_name, process_words


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


def test_a_long_command_is_cut_visibly() -> None:
    """(5.5) "--port /dev/pts/" was told of a holder, as if that were its port."""
    words = [sys.executable, "-c", "print(flush=True); input()", "x" * 300]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()  # from here on it bears its own words
        told = process_words(process.pid)
        process.kill()
    assert told.startswith(f"process {process.pid} (")
    assert told.endswith("x...)")
