"""Files that commands leave: refused before the work, whole or not at all, never in place of anything else."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from planner.errors import InputRejected
from planner.files import check_outputs, made_folder, write_file, write_with
from sim import motion_log
from sim.motion.values import Samples


def test_outputs_that_cannot_be_are_refused_before_the_work(tmp_path: Path) -> None:
    """(2.7)"""
    program = tmp_path / "part.mpf"
    program.write_text("M30")
    os.mkfifo(tmp_path / "fifo")
    wrong = {
        program: "is read by this command and would be lost",
        tmp_path / "." / "part.mpf": "is read by this command and would be lost",
        tmp_path / "nosuch/report.json": "its folder does not exist",
        tmp_path: "is a directory",
        tmp_path / "fifo": "is not a regular file",
        Path("/dev/null"): "is not a regular file",
    }
    for path, sentence in wrong.items():
        with pytest.raises(InputRejected, match=sentence):
            check_outputs([None, path], [None, program])
    with pytest.raises(InputRejected, match="would be written twice"):
        check_outputs([tmp_path / "a", tmp_path / "a"])
    check_outputs([tmp_path / "new.json", Path("report.json"), None], [program])


def test_a_file_that_is_there_is_kept_when_writing_fails(tmp_path: Path) -> None:
    """(2.7) Full disk, or interrupted by the user: the old file stays, and nothing half-written beside it."""
    path = tmp_path / "part.mpf"
    path.write_bytes(b"old")

    def full(part: Path) -> None:
        part.write_bytes(b"ne")
        raise OSError(28, "No space left on device")

    def interrupted(part: Path) -> None:
        part.write_bytes(b"ne")
        raise KeyboardInterrupt

    with pytest.raises(InputRejected, match=r"part.mpf: cannot be written: No space left on device; check folder"):
        write_with(path, full)
    with pytest.raises(KeyboardInterrupt):
        write_with(path, interrupted)
    assert [found.name for found in tmp_path.iterdir()] == ["part.mpf"]
    assert path.read_bytes() == b"old"
    write_file(path, b"new")
    assert path.read_bytes() == b"new"


def test_no_device_gives_way_to_a_file(tmp_path: Path) -> None:
    """(2.7) `--report /dev/null` of a user who is root would take the device away from everybody."""
    device = tmp_path / "null"
    os.mkfifo(device)
    with pytest.raises(InputRejected, match="is not a regular file"):
        write_file(device, b"{}")
    assert device.is_fifo()


def test_a_folder_is_made_once_and_no_deeper(tmp_path: Path) -> None:
    """(2.7)"""
    assert made_folder(made_folder(tmp_path / "parts")) == tmp_path / "parts"
    (tmp_path / "file").touch()
    with pytest.raises(InputRejected, match="file: is no folder"):
        made_folder(tmp_path / "file")
    with pytest.raises(InputRejected, match="c: cannot be made: No such file or directory"):
        made_folder(tmp_path / "a/b/c")


def test_a_motion_log_that_cannot_be_written_says_so_at_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """(2.7) A full disk must not stop the mill: it is told when the log is closed, and nothing stays behind."""
    (tmp_path / "full").symlink_to("/dev/full")
    monkeypatch.setattr(motion_log, "part_of", lambda _path: tmp_path / "full")
    log = motion_log.MotionLog(tmp_path / "motion.csv", 0.0)
    many, none = np.zeros(10_000), np.zeros(10_000, dtype=np.int64)
    for _ in range(2):
        log.add(Samples(many, np.zeros((10_000, 3)), many, none, none))
    with pytest.raises(InputRejected, match=r"motion.csv: cannot be written: No space left on device"):
        log.close()
    assert list(tmp_path.iterdir()) == []
