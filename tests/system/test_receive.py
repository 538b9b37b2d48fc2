"""`dnc receive` on a real pseudo-terminal: what the control punches out is stored whole, or said not to be (5.7)."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.helpers.schemas import validated

WHOLE = b"%\r\nO1234 (PART)\r\nG1 X1\r\nM30\r\n%\r\n"
BEGUN = b"%\r\nO77\r\nG1 X2\r\nM"


class Punch:
    """A control's end of the cable, and `dnc receive` at the other."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.end, slave = os.openpty()
        tty.setraw(slave)
        name = os.ttyname(slave)
        words = [sys.executable, "-m", "dnc", "receive", "--port", name, "-o", str(folder), "--send-xon", *options]
        self.child = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert os.read(self.end, 1) == b"\x11"
        os.close(slave)

    def finish(self) -> tuple[int, list[str]]:
        """Exit code and what was said."""
        self.printed, words = self.child.communicate(timeout=30)
        return self.child.returncode, words.splitlines()

    def heard(self) -> str:
        """The next sentence."""
        assert self.child.stderr is not None
        return self.child.stderr.readline()


@contextmanager
def punching(folder: Path, *options: str) -> Iterator[Punch]:
    punch = Punch(folder, *options)
    try:
        yield punch
    finally:
        punch.child.kill()


def test_whole_programs_are_stored_under_their_names(tmp_path: Path) -> None:
    """(5.7)"""
    with punching(tmp_path, "--count", "1", "--json") as punch:
        os.write(punch.end, WHOLE + BEGUN)
        code, words = punch.finish()
    assert code == 0
    assert validated(punch.printed)["programs"][0]["is_whole"]
    assert [path.name for path in tmp_path.iterdir()] == ["O1234"]
    assert (tmp_path / "O1234").read_bytes() == WHOLE.lstrip()
    assert len(words) == 1


def test_a_program_cut_by_the_operator_is_kept_as_partial(tmp_path: Path) -> None:
    """(2.7, 5.7) Nothing that came is lost, and nothing that is not whole looks whole."""
    with punching(tmp_path) as punch:
        os.write(punch.end, WHOLE + BEGUN)
        assert "O1234 stored" in punch.heard()
        punch.child.send_signal(signal.SIGINT)
        code, words = punch.finish()
    assert code == 7
    assert (tmp_path / "O77.partial").read_bytes() == BEGUN
    assert words[-1].startswith("dnc: SIMULATED: ended by the operator: ")
    assert words[-1].endswith("O77.partial is not whole, ended by a break in the middle; punch it out again")


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 7), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_program_that_said_m30_is_whole_whoever_ends_the_listening(
    number: signal.Signals, code: int, tmp_path: Path
) -> None:
    """(5.7) A Ctrl-C within --silence of the last block made a .partial of it; the codes are those of the table."""
    with punching(tmp_path, "--json") as punch:
        os.write(punch.end, WHOLE + b"O8\nG1 X1\nM30\n")
        assert "O1234 stored" in punch.heard()
        punch.child.send_signal(number)
        ended, words = punch.finish()
    assert ended == code
    assert (tmp_path / "O8").read_bytes() == b"O8\nG1 X1\nM30\n"
    assert "2 programs came" in words[-1]
    assert [one["is_whole"] for one in validated(punch.printed)["programs"]] == [True, True]


def test_a_program_cut_by_the_line_is_kept_as_partial(tmp_path: Path) -> None:
    """(2.7, 5.5, 5.7) The report names what was stored all the same: who reads only that lost both programs."""
    with punching(tmp_path, "--json") as punch:
        os.write(punch.end, WHOLE + BEGUN)
        assert "O1234 stored" in punch.heard()
        os.close(punch.end)
        code, words = punch.finish()
    assert code == 5
    assert (tmp_path / "O77.partial").read_bytes() == BEGUN
    assert [one["is_whole"] for one in validated(punch.printed)["programs"]] == [True, False]
    assert words[-1].startswith("dnc: SIMULATED: /dev/pts/")
    assert not any("Traceback" in word for word in words)


def test_silence_before_any_program_is_exit_5(tmp_path: Path) -> None:
    """(2.7)"""
    with punching(tmp_path, "--count", "1", "--wait", "0.2") as punch:
        code, words = punch.finish()
    assert code == 5
    assert "0 of 1 programs came" in words[-1]
