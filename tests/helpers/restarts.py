"""What the tests of restart and resume share: a program with its sidecar, a control that holds little."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

HEAD = ["%_N_PART_MPF", ";CONTROL=sinumerik-840d REFERENCE=tip", "G17 G40 G64 G71 G90 G94", "G54", "T2 M6", "D1"]
HEAD += ["G0 Z50", "S1000 M3", "G4 F2", "M8"]


def planned(folder: Path, passes: int = 20, long_from: int = 99, head: Sequence[str] = HEAD) -> Path:
    """A program as the planner writes them, with its sidecar; block N of pass k is N k.

    From pass `long_from` on blocks carry a comment.
    """
    lines, points = list(head), []
    for number in range(1, passes + 1):
        points.append({"pass": number, "block": number, "line": len(lines) + 1})
        lines += [f"N{number} G0 X0 Y{number}", "G0 Z10", "G1 G9 Z-1 F100"]
        comment = " ;" + "as long as a block of a spline" * (number >= long_from)
        lines += [f"G1 X{x}.5 F250{comment}" for x in range(10)] + ["G0 Z10"]
    data = ("\n".join([*lines, "G0 Z50", "M9", "M5", "M30"]) + "\n").encode()
    path = folder / "part.mpf"
    path.write_bytes(data)
    state: dict[str, float] = {
        "safe_z_mm": 50.0,
        "clearance_z_mm": 10.0,
        "plunge_mm_min": 100.0,
        "spindle_dwell_s": 2.0,
    }
    state["tool"] = 2
    sha256 = hashlib.sha256(data).hexdigest()
    sidecar = {"sha256": sha256, "radius_mm": 4.0, "state": state, "restart_points": points}
    (folder / "part.mpf.json").write_text(json.dumps(sidecar))
    return path


def small_buffer(folder: Path) -> Path:
    """The machine with a control that holds next to nothing, so that little is in doubt."""
    machine = folder / "small.toml"
    text = (Path(__file__).parents[2] / "configs/machines/sinumerik-840d.toml").read_text()
    for key, value in [("receive_buffer_bytes", 500), ("xon_fill_bytes", 200), ("lookahead_blocks", 5)]:
        old = next(line for line in text.splitlines() if line.startswith(key))
        text = text.replace(old, f"{key} = {value}")
    machine.write_text(text)
    return machine
