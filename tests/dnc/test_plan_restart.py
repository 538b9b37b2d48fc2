"""Where --start-at may begin: the planner's points are named before a line that would need --force (fault O4)."""

from __future__ import annotations

import hashlib
import json
from contextlib import closing
from pathlib import Path

import pytest

from dnc.errors import InputRejected
from dnc.profile import load_profile
from dnc.resuming import plan_restart
from dnc.shipped import shipped_path
from dnc.spool import load_tape
from tests.helpers.restarts import planned

SPLINE = b"BSPLINE X1.5 Z-1 PL=0 F250\nX2.5 Z-2 PL=1\nX3.5 Z-1 PL=2\nX4.5 Z-2 PL=0\nG1 X5.5\n"


@pytest.mark.parametrize("is_forced", [False, True])
def test_where_no_restart_can_begin_the_line_named_is_one_that_is_taken(tmp_path: Path, *, is_forced: bool) -> None:
    """(O4) Within a spline "restart at line 27" was refused in its turn: no restart point, or --force."""
    program = planned(tmp_path)
    before, code, rest = program.read_bytes().partition(b"G1 X1.5 F250 ;\n")
    assert code
    program.write_bytes(before + SPLINE + rest)
    sidecar = program.with_name("part.mpf.json")
    said = json.loads(sidecar.read_text()) | {"sha256": hashlib.sha256(program.read_bytes()).hexdigest()}
    sidecar.write_text(json.dumps(said))
    profile = load_profile(shipped_path("machines", "sinumerik-840d"))
    line = before.count(b"\n") + 3
    with closing(load_tape(program, profile.tape, tmp_path / "spool")) as tape:

        def planned_at(start_at: str) -> int:
            plan = plan_restart(program, tape, ("mill", profile), start_at, None, port=None, is_forced=is_forced)
            return plan.point.line

        with pytest.raises(InputRejected) as caught:
            planned_at(str(line))
        named = str(caught.value).rpartition("; ")[2]
        if is_forced:
            assert named == f"restart at line {line - 2}"
            assert planned_at(str(line - 2)) == line - 2
        else:
            assert named == "use N1, or --force"
            assert planned_at("N1") == 11
