"""Where a killed job is resumed: what lay in the queues below the sender never reached the control (5.7)."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path

import msgspec
import pytest

from dnc.events import JobState
from dnc.journal import Journal
from dnc.profile import Control, load_profile
from dnc.record import in_doubt
from dnc.resuming import plan_restart
from dnc.shipped import shipped_path
from dnc.spool import load_tape
from tests.system.test_send_restart import planned


@pytest.mark.parametrize("inflight_bytes", [2, 2000])
def test_a_killed_job_is_resumed_before_what_its_driver_still_held(
    tmp_path: Path, inflight_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """(5.7) A driver that holds 2000 bytes loses them with the computer; blocks among them were called executed."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    shipped = load_profile(shipped_path("machines", "sinumerik-840d"))
    link = msgspec.structs.replace(shipped.link, handshake="driver", inflight_max_bytes=inflight_bytes)
    control = Control(receive_buffer_bytes=300, xoff_free_bytes=100, xon_fill_bytes=100, lookahead_blocks=5)
    profile = msgspec.structs.replace(shipped, link=link, control=control)
    program = planned(tmp_path, passes=60)
    with closing(load_tape(program, profile.tape, tmp_path / "spool")) as tape:
        sent_bytes = tape.size_bytes - 1000
        folder = tmp_path / "state/dnc/jobs/20260101T000000.000000-99999999"
        journal = Journal(folder / "journal", tape.sha256, 10, lambda: None)
        journal.open()
        journal.close(sent_bytes, JobState.HELD)
        about = {"program_sha256": tape.program_sha256, "machine": "mill", "bytes_total": tape.size_bytes}
        (folder / "job.json").write_text(json.dumps(about))
        plan = plan_restart(program, tape, ("mill", profile), None, None, port=None, is_forced=False)
        wanted = in_doubt(tape, sent_bytes, inflight_bytes, control)
    assert wanted is not None
    assert plan.doubt is not None
    assert plan.doubt[0] == wanted.first
    assert wanted.first - 13 <= plan.point.line <= wanted.first
