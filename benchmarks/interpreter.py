"""Blocks per second of the interpreter on CAM output, beside `rs274 -g` (Debian's linuxcnc-uspace) in the same minute.

100,000 G1 lines of about 35 bytes, best of five each. `arrays` is how `dnc check` and `dnc simulate` read straight
cuts; `commands` gives one value a move, as the estimate of the machining time takes them; both read whole programs.
`by block` is the full parser, through which a live control takes every block as it comes (on 10,000 lines).
"""

from __future__ import annotations

import math
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from sim.interpreter import canon
from sim.interpreter.run import Interpreter, interpret, interpret_bulk

BLOCKS = 100_000
ROUNDS = 5


def cam_program(blocks: int) -> bytes:
    """A spiral on a wavy surface as CAM systems write it."""
    lines = ["G17 G90 G40 G54 G64", "G0 X0 Y0 Z10", "G1 Z0 F1000"]
    for step in range(blocks):
        angle = step * 0.002
        x, y, z = 50 * math.cos(angle), 50 * math.sin(angle), math.sin(7 * angle)
        lines.append(f"N{step + 100} G1 X{x:.3f} Y{y:.3f} Z{z:.3f}")
    return ("\n".join([*lines, "G0 Z10", "M30"]) + "\n").encode()


def best(work: Callable[[], object]) -> float:
    """Shortest of the rounds, s."""
    times = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def by_block(data: bytes) -> None:
    """The route of a live control."""
    interpreter = Interpreter()
    for line, raw in enumerate(data.split(b"\n"), start=1):
        interpreter.block(raw, line)


def main() -> None:
    """Print blocks per second and the ratio to the reference."""
    data, short = cam_program(BLOCKS), cam_program(BLOCKS // 10)
    cuts = sum(len(one) for one in interpret_bulk(data) if isinstance(one, canon.LineRun))
    print(f"{BLOCKS} blocks, {len(data) / BLOCKS:.1f} bytes a block, {cuts} cuts in runs")
    rates = {
        "arrays": BLOCKS / best(lambda: list(interpret_bulk(data))),
        "commands": BLOCKS / best(lambda: list(interpret(data))),
        "by block": BLOCKS / 10 / best(lambda: by_block(short)),
    }
    if shutil.which("rs274"):
        with tempfile.TemporaryDirectory() as folder:
            program = Path(folder) / "cam.ngc"
            text = data.decode().replace("M30", "M2")
            program.write_text(text)
            command = ["rs274", "-g", str(program), str(Path(folder) / "out.txt")]
            rates["rs274 -g"] = BLOCKS / best(lambda: subprocess.run(command, check=True, capture_output=True))
    for name, rate in rates.items():
        ratio = f"{rate / rates['rs274 -g']:6.2f} x rs274" if "rs274 -g" in rates else ""
        print(f"{name:10} {rate:12,.0f} blocks/s {ratio}")


if __name__ == "__main__":
    main()
