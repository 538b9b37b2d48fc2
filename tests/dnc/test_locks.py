"""The lock files that older programs look for (5.5)."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from dnc.locks import UucpLock, lock_holder, lock_name, process_words


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


@pytest.mark.parametrize("text", ["0\n", "-1\n", "1e99\n", "9" * 30, "\0\0\x07\x12", ""])
def test_what_names_no_process_holds_nothing(text: str, tmp_path: Path) -> None:
    """(5.5) 0 and -1 are groups of processes, and always there."""
    path = tmp_path / "LCK..ttyUSB7"
    path.write_text(text, encoding="latin-1")
    assert lock_holder(path) is None


@pytest.mark.parametrize("at", ["read", "kill"])
def test_another_users_program_holds_its_port(at: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """(5.5) A lock that may not be read was an internal fault."""
    (tmp_path / "LCK..ttyUSB7").write_text(f"{os.getppid()}\n")

    def refuse(*_words: object, **_named: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(*((Path, "read_text") if at == "read" else (os, "kill")), refuse)
    holder = UucpLock(Path("/dev/ttyUSB7"), tmp_path).acquire()
    assert holder is not None
    assert ("another user" if at == "read" else str(os.getppid())) in holder


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
