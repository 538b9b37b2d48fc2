"""What a job that ended left in doubt, reckoned anew: an older dnc, or another profile, doubted fewer lines (5.7)."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path
from typing import Any

import msgspec
import pytest

from dnc.errors import JournalMismatch
from dnc.joblist import PastJob
from dnc.profile import Control, Link, MachineProfile, framing_of
from dnc.profile import Tape as Framing
from dnc.record import in_doubt
from dnc.stopped import lines_in_doubt
from tests.helpers.line import tape_of

PROGRAM = b"".join(b"N%04d G1 X%04d\n" % (number, number) for number in range(1, 1001)) + b"M30\n"
LINE_BYTES = 15
CONTROL = Control(receive_buffer_bytes=100, lookahead_blocks=3)
PROFILE = MachineProfile(link=Link(), control=CONTROL, axes={}, tape=Framing())
SENT_BYTES = 900 * LINE_BYTES


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path / "dnc"


def found(folder: Path, profile: MachineProfile = PROFILE, **more: object) -> tuple[int, int]:
    with closing(tape_of(folder, PROGRAM)) as tape:
        values: dict[str, Any] = {"bytes_sent": SENT_BYTES, "bytes_total": tape.size_bytes, "in_doubt": [890, 900]}
        values |= {"sha256": tape.sha256, "port": "ttyUSB7", "handshake": "xonxoff", **more}
        return lines_in_doubt(PastJob("7", "ABORTED", {key: one for key, one in values.items() if one}), tape, profile)


def test_what_todays_rules_say_too_is_left_as_it_is(tmp_path: Path, state: Path) -> None:
    """(5.7) The record of today's dnc under today's profile is not widened."""
    with closing(tape_of(tmp_path, PROGRAM)) as tape:
        said = in_doubt(tape, SENT_BYTES, 2, CONTROL)
        assert said is not None
    assert found(tmp_path, in_doubt=[said.first, said.last]) == (said.first, said.last)
    assert found(tmp_path) == (min(890, said.first), 900)
    assert found(tmp_path, in_doubt=[700, 900]) == (700, 900)


@pytest.mark.parametrize(
    ("way", "least_bytes"), [({"handshake": "driver"}, 4096), ({"port": "socket://10.0.0.9:4001"}, 1 << 17)]
)
def test_what_an_older_dnc_did_not_count_is_counted(
    tmp_path: Path, state: Path, way: dict[str, str], least_bytes: int
) -> None:
    """(5.7) Bytes that an adapter or a network held back unseen were called executed by its record."""
    first, last = found(tmp_path, **way)
    assert first <= max(1, (SENT_BYTES - least_bytes) // LINE_BYTES)
    assert last == 900
    with pytest.raises(JournalMismatch, match="does not say how much an adapter or a network held back"):
        found(tmp_path, **way, bytes_sent=None)
    assert found(tmp_path, bytes_sent=None) == (890, 900)


def test_whichever_profile_holds_more_counts(tmp_path: Path, state: Path) -> None:
    """(5.7) The one of now, or the one that the job left beside its journal."""
    larger = msgspec.structs.replace(PROFILE, control=Control(receive_buffer_bytes=1500, lookahead_blocks=40))
    expected = (900 - 100 - 40, 900)  # and 2 bytes on the line
    assert found(tmp_path, larger) == expected
    folder = state / "jobs/7"
    folder.mkdir(parents=True)
    about = {"receive_buffer_bytes": 1500, "lookahead_blocks": 40, "framing": framing_of(PROFILE.tape)}
    (folder / "job.json").write_text(json.dumps(about))
    assert found(tmp_path) == expected


def test_a_job_that_was_framed_otherwise_is_not_reckoned(tmp_path: Path, state: Path) -> None:
    """(5.7) Its bytes lie in other lines: told by its digest, or beside its journal."""
    with pytest.raises(JournalMismatch, match="other block ends, leader or trailer"):
        found(tmp_path, sha256="00")
    folder = state / "jobs/7"
    folder.mkdir(parents=True)
    (folder / "job.json").write_text(json.dumps({"framing": ["", "", "crlf"]}))
    with pytest.raises(JournalMismatch, match="other block ends, leader or trailer"):
        found(tmp_path)
