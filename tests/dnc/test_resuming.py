"""What a job that ended without a word left in doubt, in the lines of the whole program (5.7)."""

from __future__ import annotations

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
from dnc.spool import load_tape
from dnc.stopped import doubt_of_interrupted, lines_in_doubt
from dnc.tape import Tape

CONTROL = Control(receive_buffer_bytes=300, xoff_free_bytes=50, xon_fill_bytes=100, lookahead_blocks=4)
BLOCKS = [b"N%d G1 X%d%s" % (n, n, b" ;" + b"long" * (n // 20)) for n in range(1, 201)]
BEGIN = 61
PREAMBLE = [b"G17 G40", b"T2 M6", b"G0 Z50"]


def tape_of(folder: Path, lines: list[bytes]) -> Tape:
    program = folder / "part.mpf"
    program.write_bytes(b"\n".join(lines) + b"\n")
    return load_tape(program, Framing(leader="%\\LF"), folder / "spool", 8)


def killed(profile: MachineProfile) -> dict[str, Any]:
    """What is on record of a job that was killed 3000 bytes on, under a control that held nothing."""
    sent = {"bytes_sent": 3000, "bound_bytes": 3000, "framing": framing_of(profile.tape)}
    return {**sent, "receive_buffer_bytes": 0, "lookahead_blocks": 0, "beyond_recall_bytes": 0}


@pytest.mark.parametrize("sent_bytes", [0, 1, 40, 500, 2000, 4000, 100_000])
def test_a_restarted_job_is_counted_from_where_it_began(tmp_path: Path, sent_bytes: int) -> None:
    """(5.7) As the window of the restarted tape says, in lines of the whole program; never before its begin."""
    restart = PREAMBLE + BLOCKS[BEGIN - 1 :]
    with closing(tape_of(tmp_path, BLOCKS)) as whole, closing(tape_of(tmp_path, restart)) as restarted:
        values = {"restart": {"line": BEGIN, "lines_before": 3}, "bytes_total": restarted.size_bytes}
        values |= {"bytes_sent": sent_bytes, "bound_bytes": sent_bytes + 60}
        found = doubt_of_interrupted(values, whole, CONTROL)
        low = in_doubt(restarted, sent_bytes, 0, CONTROL)
        high = in_doubt(restarted, sent_bytes + 60, 0, CONTROL)
    shift = BEGIN - 1 - 3
    assert found[1] == max(BEGIN, high.last + shift if high else 1)
    # Where the window of the whole tape would reach into blocks that this job never had, it begins with the job.
    assert found[0] == max(BEGIN, low.first + shift if low else 1)


def test_a_whole_job_is_counted_from_its_head(tmp_path: Path) -> None:
    """(5.7)"""
    with closing(tape_of(tmp_path, BLOCKS)) as whole:
        low, high = in_doubt(whole, 1500, 0, CONTROL), in_doubt(whole, 1900, 0, CONTROL)
        assert low is not None
        assert high is not None
        values = {"bytes_sent": 1500, "bound_bytes": 1900}
        assert doubt_of_interrupted(values, whole, CONTROL) == (low.first, high.last)
        assert doubt_of_interrupted({}, whole, CONTROL) == (1, 1)


def test_a_profile_that_shrank_since_does_not_narrow_the_window(tmp_path: Path) -> None:
    """(5.7) The window of a killed job was reckoned with the buffer and the look-ahead of now."""
    profile = MachineProfile(link=Link(), control=CONTROL, axes={}, tape=Framing(leader="%\\LF"))
    values = killed(profile) | {"receive_buffer_bytes": 1500, "lookahead_blocks": 40}
    with closing(tape_of(tmp_path, BLOCKS)) as whole:
        first, last = lines_in_doubt(PastJob("1", "INTERRUPTED", values), whole, profile)
        then = in_doubt(
            whole, 3000, 2, msgspec.structs.replace(CONTROL, receive_buffer_bytes=1500, lookahead_blocks=40)
        )
        assert then is not None
        assert (first, last) == (then.first, then.last)


@pytest.mark.parametrize("key", ["framing", "receive_buffer_bytes", "lookahead_blocks", "beyond_recall_bytes"])
def test_a_killed_job_that_left_a_bound_unsaid_is_not_resumed(tmp_path: Path, key: str) -> None:
    """(5.7) An older dnc did not record it; the profile of now may hold less."""
    profile = MachineProfile(link=Link(), control=CONTROL, axes={}, tape=Framing(leader="%\\LF"))
    values = killed(profile)
    with closing(tape_of(tmp_path, BLOCKS)) as whole:
        assert lines_in_doubt(PastJob("1", "INTERRUPTED", values), whole, profile)
        del values[key]
        with pytest.raises(JournalMismatch, match="was killed under an older dnc, which did not record"):
            lines_in_doubt(PastJob("1", "INTERRUPTED", values), whole, profile)
