"""A job whose end could not be put on record is not resumed on a guess (5.7; faults C2, L3)."""

from __future__ import annotations

from pathlib import Path

import pytest

from dnc.joblist import past_jobs
from tests.helpers.line import SendProcess
from tests.helpers.mill import MillProcess, small_machine
from tests.system.test_send_restart import planned

pytestmark = pytest.mark.system


def test_a_job_that_the_control_ended_is_not_counted_from_its_journal(tmp_path: Path) -> None:
    """(5.7) With a full disk an alarm left the journal alone: blocks that no XON had proved were called executed."""
    program = planned(tmp_path)
    machine = small_machine(
        tmp_path, receive_buffer_bytes=300, xoff_free_bytes=100, xon_fill_bytes=100, lookahead_blocks=5
    )
    records = tmp_path / "state/dnc/records.jsonl"
    records.mkdir(parents=True)  # cannot be written, like the file of a full disk
    with (
        MillProcess(tmp_path, "--machine", machine, "--speed", "20", "--fault", "alarm=2500b") as mill,
        SendProcess(
            tmp_path, program, mill.ready["pty"], "--machine", str(machine), "--baud", str(mill.ready["line_baud"])
        ) as sending,
    ):
        code, words = sending.finish()
    assert (code, "could not be put on record" in words) == (6, True)
    (past,) = past_jobs(tmp_path / "state/dnc")
    assert (past.outcome, past.values["state"]) == ("INTERRUPTED", "FAULTED")
    records.rmdir()  # there is room again
    with (
        MillProcess(tmp_path, "--machine", machine) as mill,
        SendProcess(
            tmp_path, program, mill.ready["pty"], "--machine", str(machine), "--resume", "--yes", "--force",
            "--control-was-reset",
        ) as sending,
    ):  # fmt: skip
        code, words = sending.finish()
    assert code == 9, words
    assert "record could not be written" in words
    assert "executed" not in words
