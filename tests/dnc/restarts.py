"""Programs to restart, and a control that runs the preamble and the rest."""

from __future__ import annotations

import msgspec

from dnc.preamble import Heights
from planner.post.base import write_program
from planner.post.written import ControlLimits
from sim.interpreter import canon
from sim.interpreter.run import Interpreter
from sim.interpreter.settings import Settings
from tests.planner.post.paths import job, polyline, spline, tool_path

HEIGHTS = Heights(safe_z_mm=50.0, clearance_z_mm=10.0, plunge_mm_min=100.0, dwell_s=2.0, retract_z_mm=400.0)
HEAD = "G17 G40 G64 G71 G90 G94\nTRANS X1 Y2 Z3\nG55\nG0 Z50\nT2 M6\nD1\nS1000 M3\nG4 F2\nM8\nG0 X0 Y0\nZ10\n"


def program(blocks: str = "poly") -> bytes:
    made = job(blocks=blocks)
    shapes = [polyline(1), polyline(2), polyline(3)] if blocks == "linear" else [spline(1), spline(2), spline(3)]
    return write_program(made, made.operation[0], tool_path(shapes), ControlLimits(retract_z_mm=400.0)).data


def cutting(commands: list[canon.Command]) -> list[canon.Command]:
    return [one for one in commands if isinstance(one, (canon.Line, canon.Polynomial, canon.Arc))]


def run_from(data: bytes, point, settings: Settings | None = None) -> tuple[list[canon.Command], int]:
    """What a control does with the preamble and the rest, and how many commands the preamble gave."""
    interpreter = Interpreter(settings or Settings(start_mm=(7.0, 7.0, 300.0)))
    commands: list[canon.Command] = []
    for number, text in enumerate(point.preamble, 1):
        commands += interpreter.block(text.encode(), number)
    before = len(commands)
    for number, raw in enumerate(data[point.offset_bytes :].splitlines(), len(point.preamble) + 1):
        commands += interpreter.block(raw, number)
    return commands + interpreter.finish(), before


def bare(command: canon.Command) -> canon.Command:
    return msgspec.structs.replace(command, line=0, block=None)
