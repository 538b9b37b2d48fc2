"""`dnc plan` loses no file: not the job it reads, not one output under another, not a device (2.7)."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from dnc.cli.main import run_with
from planner.errors import ExitCode, InputRejected
from planner.files import write_file

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.mark.parametrize(
    ("outputs", "words"),
    [
        (["-o", "jobs/thesis.toml"], "thesis.toml: is read by this command and would be lost"),
        (["-o", "surfaces/thesis.toml"], "thesis.toml: is read by this command and would be lost"),
        (["-o", "a.mpf", "--report", "./a.mpf"], "a.mpf: would be written twice"),
        (["-o", "a.mpf", "--report", "a.mpf.json"], "a.mpf.json: would be written twice"),
    ],
)
def test_an_output_that_would_cost_another_file_is_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    outputs: list[str],
    words: str,
) -> None:
    shutil.copytree(CONFIGS, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert run_with(["plan", "jobs/thesis.toml", *outputs]) == ExitCode.REJECTED
    assert words in capsys.readouterr().err
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_what_is_no_file_is_not_replaced_by_one(tmp_path: Path) -> None:
    """A pipe stands for the devices, which a test that fails must not cost the machine."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(InputRejected, match="pipe: is not a regular file"):
        write_file(pipe, b"M30")
    assert pipe.is_fifo()
