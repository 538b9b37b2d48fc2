"""Where a killed job is resumed: what lay in the queues below the sender never reached the control (5.7)."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path
from typing import Literal

import msgspec
import pytest

from dnc.events import JobState
from dnc.journal import Journal
from dnc.line_pace import pace_of
from dnc.pacing import ByteClock
from dnc.profile import Control, Link, framing_of, load_profile
from dnc.record import doubt_of, in_doubt
from dnc.resuming import plan_restart
from dnc.rules import Rules
from dnc.sender import Sender
from dnc.shipped import shipped_path
from dnc.spool import load_tape
from tests.helpers.line import drain, tape_of
from tests.system.test_send_restart import planned


@pytest.mark.parametrize(("inflight_bytes", "fifo_bytes"), [(2, 0), (2000, 0), (2, 2000)])
def test_a_killed_job_is_resumed_before_what_its_driver_still_held(
    tmp_path: Path, inflight_bytes: int, fifo_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """(5.7) Driver or adapter lose 2000 bytes with the computer's power; blocks among them were called executed."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    shipped = load_profile(shipped_path("machines", "sinumerik-840d"))
    link = msgspec.structs.replace(shipped.link, handshake="driver", inflight_max_bytes=inflight_bytes)
    link = msgspec.structs.replace(link, adapter_fifo_bytes=fifo_bytes)
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
        about |= {"framing": framing_of(profile.tape), "receive_buffer_bytes": 0, "lookahead_blocks": 0}
        about |= {"beyond_recall_bytes": 0}
        (folder / "job.json").write_text(json.dumps(about))
        plan = plan_restart(program, tape, ("mill", profile), None, None, port=None, is_forced=False)
        wanted = in_doubt(tape, sent_bytes, inflight_bytes + fifo_bytes, control)
    assert wanted is not None
    assert plan.doubt is not None
    assert plan.doubt[0] == wanted.first
    assert wanted.first - 13 <= plan.point.line <= wanted.first


@pytest.mark.parametrize(("handshake", "lost_bytes"), [("driver", 4096), ("xonxoff", 0)])
def test_what_an_adapter_that_obeys_xoff_holds_back_is_in_doubt(
    handshake: Literal["driver", "xonxoff"], lost_bytes: int, tmp_path: Path
) -> None:
    """(5.3, 5.7; fault A7) Stopped, it took 4 kB more, and was unplugged: two hundred lines were called executed."""
    link = Link(handshake=handshake)
    control = Control(receive_buffer_bytes=300, xoff_free_bytes=100, xon_fill_bytes=100, lookahead_blocks=5)
    shipped = load_profile(shipped_path("machines", "sinumerik-840d"))
    profile = msgspec.structs.replace(shipped, link=link, control=control)
    rules = Rules(hears_xoff=handshake == "xonxoff", is_driver_asked=handshake == "driver")
    with closing(tape_of(tmp_path, b"".join(b"N%04d G1 X%04d.5\n" % (n, n) for n in range(1, 1001)))) as tape:
        sender = Sender(tape, ByteClock(pace_of(profile)), rules)
        sender.start(0.0)
        _, now_s = drain(sender, 0.0, until_s=10.0)
        sender.pause(now_s)
        _, now_s = drain(sender, now_s)
        assert not sender.is_cut
        read_bytes = sender.offset_bytes - lost_bytes
        sender.lost(now_s + 60.0, "unplugged")
        sender.thrown_away(0, now_s + 60.0)
        doubt = doubt_of(sender, control)
        assert doubt is not None
        assert doubt.first <= tape.lines.line_at(tape, read_bytes - control.receive_buffer_bytes) - 5
        assert sender.may_be_cut == (lost_bytes > 0)
