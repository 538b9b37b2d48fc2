"""Jobs on several ports end when they end: the record keeps every one of them (5.7)."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from dnc.joblist import first_broken_link, past_jobs

_JOBS, _EACH = 4, 100
_WRITER = """
import sys
from pathlib import Path
from dnc.record import append_record

print(flush=True)
sys.stdin.readline()
for number in range(int(sys.argv[3])):
    append_record(Path(sys.argv[1]), {"job": f"{sys.argv[2]}-{number}", "outcome": "SENT"})
"""


def test_jobs_that_end_at_the_same_moment_are_all_on_record(tmp_path: Path) -> None:
    """(5.7) One took away the line of the other; its job was then INTERRUPTED, or the record called tampered with."""
    words = [sys.executable, "-c", _WRITER, str(tmp_path)]
    pipe = subprocess.PIPE
    writers = [
        subprocess.Popen([*words, str(number), str(_EACH)], stdin=pipe, stdout=pipe, text=True)
        for number in range(_JOBS)
    ]
    for writer in writers:
        assert writer.stdout is not None
        writer.stdout.readline()
    for writer in writers:
        assert writer.stdin is not None
        writer.stdin.write("\n")
        writer.stdin.flush()
    for writer in writers:
        writer.communicate()
        assert writer.returncode == 0
    lines = (tmp_path / "records.jsonl").read_text().splitlines()
    assert len({json.loads(line)["job"] for line in lines}) == len(past_jobs(tmp_path)) == _JOBS * _EACH
    assert first_broken_link(tmp_path) is None
