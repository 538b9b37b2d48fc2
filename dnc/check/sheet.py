"""The setup sheet of a bare program: what its canonical commands tell, gathered while the check runs."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dnc.check.finding import Collection, Finding, Severity
from dnc.check.limits import Limits
from dnc.check.moves import is_air, length, point_at
from dnc.check.rate import line_bytes_s, move_time_s
from planner.job import Job
from planner.post.stamp import read_stamp
from planner.sheet import SheetFacts, SheetTool, render_sheet, sheet_tool
from sim.interpreter import canon
from sim.interpreter.tangents import extent, point_on_arc

_MOST_POINTS = 8000
_MOST_WARNINGS = 12
_ARC_STEP_RAD = math.radians(6.0)
_MOST_SWEEP_RAD = 12.0 * math.pi


class SheetWatch:
    """Hears every command; keeps extents, times, tools and a picture of bounded size."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.low, self.high = [math.inf] * 3, [-math.inf] * 3
        self.cutting_s, self.air_s, self.cut_mm = 0.0, 0.0, 0.0
        self.tools: list[int] = []
        self.spindle_rpm, self.feed_mm_min = 0.0, 0.0
        self._clear_z_mm = math.inf
        self._lines: list[list[canon.Vector]] = []
        self._count, self._stride, self._seen = 0, 1, 0

    def __call__(self, command: canon.Command) -> None:
        """Take one command into account."""
        match command:
            case canon.Line() | canon.Arc() | canon.Polynomial():
                self._feed(command)
            case canon.Rapid():
                self._clear_z_mm = min(self._clear_z_mm, command.end[2])
                self.air_s += move_time_s(command, self.limits, 0.0)
                self._lines.append([])
            case canon.Dwell(time_s=time_s):
                self.air_s += time_s
            case canon.ChangeTool(number=number) if number not in self.tools:
                self.tools.append(number)
            case canon.Spindle(speed_rpm=speed_rpm):
                self.spindle_rpm = max(self.spindle_rpm, abs(speed_rpm))
            case _:
                pass

    def _feed(self, move: canon.Line | canon.Arc | canon.Polynomial) -> None:
        length_mm = length(move)
        time_s = move_time_s(move, self.limits, length_mm)
        if is_air(move, self._clear_z_mm):
            self.air_s += time_s
            self._lines.append([])
            return
        self.cutting_s += time_s
        self.cut_mm += length_mm
        self.feed_mm_min = max(self.feed_mm_min, move.feed_mm_min)
        points = [move.start, move.end]
        if isinstance(move, canon.Polynomial):
            points = [point_at(move, move.length * step / 8) for step in range(9)]
        corners = points
        if isinstance(move, canon.Arc):
            steps = math.ceil(min(move.sweep_rad, _MOST_SWEEP_RAD) / _ARC_STEP_RAD)
            points = [*(point_on_arc(move, move.sweep_rad * step / steps) for step in range(steps)), move.end]
            corners = list(extent(move))
        for point in corners:
            self.low = [min(pair) for pair in zip(self.low, point, strict=True)]
            self.high = [max(pair) for pair in zip(self.high, point, strict=True)]
        self._draw(points)

    def _draw(self, points: list[canon.Vector]) -> None:
        self._seen += 1
        if not self._lines:
            self._lines.append([])
        line = self._lines[-1]
        if self._seen % self._stride and line:
            line[-1] = points[-1]
            return
        line.extend(points if not line else points[1:])
        self._count += len(points)
        if self._count > _MOST_POINTS:
            self._stride *= 2
            kept = [line[::2] if len(line) < 3 else [*line[:-1:2], line[-1]] for line in self._lines if len(line) > 1]
            self._lines = [line for line in kept if len(line) > 1]
            self._count = sum(map(len, self._lines))

    @property
    def lines(self) -> list[np.ndarray]:
        """The picture: runs of cutting moves as rows of points."""
        return [np.array(line) for line in self._lines if len(line) > 1]


def _sentences(found: Collection) -> list[str]:
    """Errors first, the first finding of every kind with the count of the others."""
    firsts: dict[str, Finding] = {}
    for finding in sorted(found.findings, key=lambda one: (one.severity is not Severity.ERROR, one.line)):
        if finding.severity is not Severity.NOTE:
            firsts.setdefault(finding.id, finding)
    return [
        f"line {one.line}: {one.text}"
        + (f" (and {more} more of this kind)" if (more := found.counts[name] - 1) else "")
        for name, one in firsts.items()
    ]


def _rows(watch: SheetWatch, blocks: int, size_bytes: int, need_bytes_s: float) -> tuple[tuple[str, str], ...]:
    """Spindle, feed, size, and what the program asks of the line, each with its name."""
    link = watch.limits.profile.link
    rate = line_bytes_s(link)
    return (
        ("Spindle", f"{watch.spindle_rpm:g} rpm"),
        ("Feed", f"up to {watch.feed_mm_min:g} mm/min over {watch.cut_mm:.0f} mm"),
        ("Program", f"{blocks} blocks, {size_bytes} bytes"),
        ("Time on the line", f"at least {size_bytes / rate:.0f} s at {link.baud} baud"),
        ("Load of the line", f"worst 2 s at 120 % override: {need_bytes_s:.0f} of {rate:.0f} bytes/s"),
    )


def program_sheet(
    path: Path,
    watch: SheetWatch,
    found: Collection,
    blocks: int,
    *,
    need_bytes_s: float,
    machining_s: float | None,
    offsets: Sequence[str] = (),
    job: Job | None = None,
) -> str | None:
    """The sheet as HTML, or None where the program cuts nothing; `need_bytes_s` is the worst 2 s at 120 % override.

    Without `machining_s`, the machine's own time for the program, programmed speeds alone are counted. The job tells
    zero point and tools; `offsets` are the work offsets that the program calls.
    """
    lines = watch.lines
    if not lines:
        return None
    with path.open("rb") as file:
        stamp = read_stamp(file.read(4096))
        file.seek(0)
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    box = watch.limits.stock_box_mm
    words = f"ball, R {stamp.radius_mm:g}" if stamp else "not said in the program"
    known = {} if job is None else {tool.number: sheet_tool(tool) for tool in job.tool}
    facts = SheetFacts(
        title=path.name,
        sha256=digest,
        reference=f"{stamp.reference} of the ball" if stamp else "not said in the program",
        work_offset=", ".join(offsets) or "none is called in the program",
        origin="" if job is None else job.setup.origin,
        tools=tuple(known.get(number, SheetTool(number, words, "not given")) for number in watch.tools),
        stock_box_mm=None if box is None else (np.array(box[0]), np.array(box[1])),
        low_mm=np.array(watch.low),
        high_mm=np.array(watch.high),
        cutting_s=watch.cutting_s,
        air_s=watch.air_s if machining_s is None else max(machining_s - watch.cutting_s, 0.0),
        rows=_rows(watch, blocks, path.stat().st_size, need_bytes_s),
        warnings=tuple(_sentences(found)[:_MOST_WARNINGS]),
        lines=lines,
    )
    return render_sheet(facts)
