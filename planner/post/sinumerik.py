"""The SINUMERIK 840D post: head, one numbered start a pass, cutting blocks, tail.

Z moves alone or X and Y move alone; the machine height comes before every tool change and at the end, by its own
block with the tool offset off. The plunge and the pass end in an exact stop (G9), so that no rounding can cut their
corners; along a pass G64 keeps to the written path. Blanks stand only where two names would run together.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from planner.errors import InputRejected
from planner.gcode.words import decimal_text, units_above
from planner.job import Job, Operation
from planner.path.model import ToolPath
from planner.post.cutting import most_decimals, pass_texts
from planner.post.numbers import plain
from planner.post.passtext import PassText
from planner.post.sidecar import RestartRow, restart_row, sidecar
from planner.post.stamp import Stamp
from planner.post.units import INCH_MM
from planner.post.written import ControlLimits, Written

_HEAD_DECIMALS = 4
_HEAD_DECIMALS_INCH = 5
_LONGEST_NAME = 24


@dataclass(slots=True)
class _Page:
    """The program as it grows: lines, the restart points, the counts."""

    numbers: str
    unit_mm: float
    decimals: int
    lines: list[str] = field(default_factory=list)
    restart_points: list[RestartRow] = field(default_factory=list)
    blocks: int = 0
    number: int = 0
    cutting_blocks: int = 0
    cutting_bytes: int = 0
    length_bytes: int = 0

    def comment(self, text: str) -> None:
        self._line(text)

    def length(self, value_mm: float) -> str:
        """A length of head and tail in the program's unit."""
        return plain(value_mm / self.unit_mm, self.decimals)

    def feed(self, value_mm_min: float, key: str) -> str:
        """The F word of this key of the job in the program's unit; raises InputRejected where it would be F0."""
        text = plain(value_mm_min / self.unit_mm, self.decimals)
        if text == "0":
            what = f"{key} {value_mm_min:g} is F0 in the {self.decimals} decimals that the control reads"
            raise InputRejected(what, remedy="give a higher feed", key=("operation", 0, key))
        return f"F{text}"

    def height(self, value_mm: float) -> str:
        """A height to stay clear of the part: never below the value, whatever the unit."""
        return decimal_text(units_above(value_mm, self.unit_mm, self.decimals), self.decimals)

    def block(self, text: str, *, starts_pass: bool = False) -> None:
        if self.numbers == "all" or (starts_pass and self.numbers == "pass"):
            self.number += 1
            text = f"N{self.number}{text}" if text[0] in "GXYZP" else f"N{self.number} {text}"
        self.blocks += 1
        self._line(text)

    def cut(self, blocks: Sequence[str]) -> None:
        before = self.length_bytes
        for text in blocks:
            self.block(text)
        self.cutting_blocks += len(blocks)
        self.cutting_bytes += self.length_bytes - before

    def _line(self, text: str) -> None:
        self.lines.append(text)
        self.length_bytes += len(text) + 1


def write_sinumerik(
    job: Job, operation: Operation, tool_path: ToolPath, control: ControlLimits, *, lift_mm: float
) -> Written:
    """The program for a SINUMERIK 840D; raises InputRejected where its language has no words for it."""
    texts = pass_texts(job, operation, tool_path, control)
    decimals = _HEAD_DECIMALS_INCH if control.is_inch else _HEAD_DECIMALS
    page = _Page(job.post.numbers, INCH_MM if control.is_inch else 1.0, min(decimals, most_decimals(control)))
    _head(page, job, operation, control, lift_mm)
    for number, text in enumerate(texts, 1):
        if text.blocks:
            _pass(page, job, operation, number, text)
    _tail(page, job, control)
    data = "".join(f"{line}\n" for line in page.lines).encode("ascii")
    return Written(
        data=data,
        blocks=page.blocks,
        cutting_blocks=page.cutting_blocks,
        cutting_bytes=page.cutting_bytes,
        rounding_mm=_rounding_mm(tool_path, texts),
        sidecar=sidecar(
            job,
            operation,
            program_name(job.post.name),
            data,
            [*_modes(control).split(), job.setup.work_offset],
            page.restart_points,
            lift_mm,
        ),
        warnings=_warnings(operation, tool_path, texts, control),
    )


def _rounding_mm(tool_path: ToolPath, texts: Sequence[PassText]) -> float:
    """What rounding adds to the worst pass."""
    as_written = [one.deviation_mm + text.rounding_mm for one, text in zip(tool_path.passes, texts, strict=True)]
    return max(as_written) - max(one.deviation_mm for one in tool_path.passes)


def work_offset(code: str) -> str:
    """The settable offset as the control knows it, G54 to G57 or G505 to G599; raises InputRejected."""
    if not re.fullmatch(r"G(5[4-7]|50[5-9]|5[1-9]\d)", code):
        raise InputRejected(
            f"setup.work_offset {code!r} is no offset of a SINUMERIK",
            remedy="use G54 to G57 or G505 to G599",
            key=("setup", "work_offset"),
        )
    return code


def program_name(name: str) -> str:
    """The name as the control files it: letters, digits, underscore, 24 at most with _N_; raises InputRejected."""
    upper = name.upper()
    if not re.fullmatch(r"[A-Z0-9_]+", upper) or len(upper) + len("_N_") > _LONGEST_NAME:
        raise InputRejected(
            f"post.name {name!r} is no SINUMERIK program name",
            remedy=f"use at most {_LONGEST_NAME - len('_N_')} letters, digits and underscores",
            key=("post", "name"),
        )
    return upper


def _modes(control: ControlLimits) -> str:
    """The modes of a program; G700 and G710 set the unit of feeds too, whatever the machine's basic system is."""
    return f"G17 G40 G64 {'G700' if control.is_inch else 'G710'} G90 G94"


def _head(page: _Page, job: Job, operation: Operation, control: ControlLimits, lift_mm: float) -> None:
    tool = job.tool_of(operation)
    name = program_name(job.post.name)
    page.comment(f"%_N_{name}_MPF")
    page.comment(";$PATH=/_N_MPF_DIR")
    page.comment(f";{_stamp(job, operation, lift_mm).text()}")
    page.block(_modes(control))
    page.block(f"TRANS Z{page.length(lift_mm)}" if lift_mm else "TRANS")
    page.block(work_offset(job.setup.work_offset))
    _retract(page, control)
    if control.has_tool_changer:
        page.block(f"T{tool.number} M6")
    else:
        page.block(f'MSG("TOOL {tool.number}: {tool.kind.upper()} D{tool.diameter_mm:g}")')
        page.block(f"T{tool.number}")
        page.block("M0")
        page.block("MSG()")
    page.block(f"D{tool.edge}")
    page.block(f"G0 Z{page.height(job.setup.safe_z_mm)}")
    page.block(f"S{plain(operation.spindle_rpm)} M3")
    if operation.spindle_dwell_s:
        page.block(f"G4 F{plain(operation.spindle_dwell_s)}")
    if operation.coolant != "off":
        page.block({"flood": "M8", "mist": "M7"}[operation.coolant])


def _pass(page: _Page, job: Job, operation: Operation, number: int, text: PassText) -> None:
    clearance = f"Z{page.height(job.setup.clearance_z_mm)}"
    is_first = not page.restart_points
    page.restart_points.append(
        restart_row(
            number=number,
            block=page.number + 1 if page.numbers != "none" else None,
            line=len(page.lines) + 1,
            offset_bytes=page.length_bytes,
            position_mm=[value * page.unit_mm for value in text.start.mm],
            feed_mm_min=operation.cut_mm_min,
        )
    )
    page.block(f"G0{text.start.word(0)}{text.start.word(1)}", starts_pass=True)
    if is_first and job.setup.clearance_z_mm != job.setup.safe_z_mm:
        page.block(clearance)
    page.block(f"G1G9{text.start.word(2)}{page.feed(operation.plunge_mm_min, 'plunge_mm_min')}")
    is_same = operation.cut_mm_min == operation.plunge_mm_min
    feed = "" if is_same else page.feed(operation.cut_mm_min, "cut_mm_min")
    cuts = [text.blocks[0] + feed, *text.blocks[1:]]
    page.cut([*cuts[:-1], cuts[-1] + "G9"])
    page.block(f"G0{clearance}")


def _tail(page: _Page, job: Job, control: ControlLimits) -> None:
    if job.setup.safe_z_mm != job.setup.clearance_z_mm:
        page.block(f"Z{page.height(job.setup.safe_z_mm)}")
    page.block("M9")
    page.block("M5")
    _retract(page, control)
    page.block("M30")


def _retract(page: _Page, control: ControlLimits) -> None:
    if control.retract_z_mm is not None:
        page.block(f"G0 SUPA Z{page.length(control.retract_z_mm)} D0")


def _stamp(job: Job, operation: Operation, lift_mm: float) -> Stamp:
    tool = job.tool_of(operation)
    return Stamp(
        job.post.control, job.post.reference, tool.radius_mm, tool.number, tool.edge, operation.path_mm, lift_mm
    )


def _warnings(
    operation: Operation, tool_path: ToolPath, texts: Sequence[PassText], control: ControlLimits
) -> tuple[str, ...]:
    found = []
    reads = "" if control.decimals is None else f": the control reads {control.decimals} decimals"
    totals_mm = [one.deviation_mm + text.rounding_mm for one, text in zip(tool_path.passes, texts, strict=True)]
    if max(totals_mm) > operation.path_mm:
        worst = max(range(len(totals_mm)), key=totals_mm.__getitem__)
        found.append(
            f"pass {worst + 1} as written may lie {totals_mm[worst] * 1000:.3g} um from the exact path, "
            f"path_mm allows {operation.path_mm * 1000:g}{reads}"
        )
    if control.retract_z_mm is None:
        found.append(
            "the profile has no retract_z_mm, so the tool is changed and the program ends where Z stands; "
            "put the machine height of a safe tool change into its [control]"
        )
    if operation.path_mm < 1.5 * control.resolution_mm:
        found.append(
            f"the control rounds positions to {control.resolution_mm * 1000:g} um, "
            f"so path_mm = {operation.path_mm:g} holds for the program, not for the machine"
        )
    return tuple(found)
