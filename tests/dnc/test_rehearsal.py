"""How a rehearsal ends in words, from what the mill's report says."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from dnc.errors import ExitCode
from dnc.rehearsal import Rehearsal

DONE = {
    "alarms": [],
    "is_completed": True,
    "execution": "PROGRAM_COMPLETED",
    "machining_time_s": 65.2,
    "starved_s": 0.0,
}
ALARM = {"number": 12550, "text": "XYZ is no word", "line": 20}


@pytest.mark.parametrize(
    ("report", "code", "words"),
    [
        (DONE, ExitCode.OK, "came to the end of the program after 1:05 min"),
        ({**DONE, "starved_s": 2.5}, ExitCode.OK, "1:05 min, 2.5 s of it waiting for blocks"),
        ({**DONE, "scallop_mm": 0.08, "gouge_mm": 0.001}, ExitCode.OK, "scallop 80.00 um, gouge 1.00 um"),
        ({**DONE, "alarms": [ALARM]}, ExitCode.CONTROL, "the mill alarmed in line 20: 12550 XYZ is no word"),
        (
            {**DONE, "is_completed": False, "execution": "ACTIVE"},
            ExitCode.LINE,
            "it stands ACTIVE; is there an M30, and an end of line",
        ),
        (None, ExitCode.INTERNAL, "ended without a report"),
    ],
)
def test_the_mills_report_in_words(report: dict[str, Any] | None, code: ExitCode, words: str, tmp_path: Path) -> None:
    """(1.3)"""
    path, said = tmp_path / "mill.json", list[str]()
    if report is not None:
        path.write_text(json.dumps(report))
    ready = json.dumps({"pty": "/dev/pts/9", "effective_baud": 96000.0, "modbus": "127.0.0.1:5020"})
    with subprocess.Popen([sys.executable, "-c", f"print({ready!r})"], stdout=subprocess.PIPE) as child:
        rehearsal = Rehearsal(child, path, 10.0)
        assert (rehearsal.pty, rehearsal.baud, rehearsal.modbus) == ("/dev/pts/9", 96000, "127.0.0.1:5020")
        found = rehearsal.ending(600.0, said.append)
    assert found[0] is code
    assert words in found[1]
    assert said == ["all bytes sent; the virtual mill needs about 60 s for them, Ctrl-C ends the rehearsal"]
