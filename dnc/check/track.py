"""What the rules may know of everything before the block they look at: one small record, never the program."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from dnc.check.limits import Limits
from dnc.check.moves import end_direction, heights_mm, is_air, is_plunge, is_retract, length, turns_back
from dnc.check.numbering import NumberSet, starts_over
from planner.gcode import GROUP_OF, Block, ModalGroup, Text, code_of, header_name
from sim.interpreter import canon

_AXES = frozenset("XYZ")
_ENDS = frozenset({"M2", "M17", "M30"})
NAMED_TOOL = -1
"""Stands for a tool that is called by a name without a digit, whose number only the control knows."""


@dataclass(frozen=True, slots=True)
class SplineRun:
    """BSPLINE blocks so far without another code between: first line, blocks, how many carry PL."""

    line: int
    blocks: int
    with_length: int


@dataclass(slots=True)
class Track:
    """State before the current block or command.

    `is_height_known`: the program has said where Z is, in work coordinates; a step under G91 (`is_incremental`) does
    not. `is_readiness_lost`: a block was refused that would have set tool or spindle. `is_passed_over`: the block is in
    a branch that is not taken, or before the target of a jump. `clear_z_mm` is the lowest height that a rapid reached:
    taken to be above the part. `cut_top_mm` is the highest point cut below it, `hole` the bottom of the last plunge
    straight down.
    `offsets` are the work offsets that the program has called so far, each once.
    `told_feed_mm_min` is the last feed that was found odd; `is_stop_told` and `is_edge_told` hold until the spindle
    starts and an edge is called. `length_mm` is that of the last feed move, `direction` the unit direction at its end,
    None after a rapid or a stop. `air_mm` and `cut_mm` add up feed moves.
    """

    limits: Limits
    numbers: NumberSet = field(default_factory=NumberSet)
    last_number: int | None = None
    lines: int = 0
    blocks: int = 0
    header_kind: str = ""
    stray_percent_line: int | None = None
    end_line: int | None = None
    has_end_word: bool = False
    after_end_line: int | None = None
    has_moved: bool = False
    is_inch: bool = False
    is_height_known: bool = False
    is_incremental: bool = False
    is_readiness_lost: bool = False
    is_subprogram: bool = False
    is_passed_over: bool = False
    offsets: list[str] = field(default_factory=list)
    is_zero_shifted: bool = False
    is_radius_told: bool = False
    spindle_rpm: float = 0.0
    spindle_line: int | None = None
    is_stop_told: bool = False
    tool: int | None = None
    is_tool_named: bool = False
    edge: int = 1
    is_edge_told: bool = False
    clear_z_mm: float = math.inf
    cut_top_mm: float = -math.inf
    hole: canon.Vector | None = None
    told_feed_mm_min: float | None = None
    length_mm: float = 0.0
    direction: canon.Vector | None = None
    is_backward: bool = False
    plunge: canon.Line | None = None
    air_mm: float = 0.0
    air_moves: int = 0
    idle_moves: int = 0
    air_line: int | None = None
    cut_mm: float = 0.0
    motion_code: str = ""
    spline: SplineRun = field(default_factory=lambda: SplineRun(0, 0, 0))

    def see_block(self, block: Block) -> None:
        """Take a block into account after the rules have looked at it."""
        if block.number is not None:
            self._see_number(block.number)
        if block.header is not None or header_name(block) is not None:
            self._see_header(block)
        if block.is_empty:
            return
        self.blocks += 1
        if self.end_line is not None and self.after_end_line is None:
            self.after_end_line = block.line
        self.has_end_word |= any(code_of(word) in _ENDS for word in block.words)
        self._see_splines(block)

    def see_plain(self, number: int | None, line: int, code: str | None, *, has_length: bool) -> None:
        """Take a block of plain coordinates into account: its motion code, or None, and whether it has PL."""
        if number is not None:
            self._see_number(number)
        self.blocks += 1
        if self.end_line is not None and self.after_end_line is None:
            self.after_end_line = line
        if code is not None:
            self.motion_code = code
        if self.motion_code == "BSPLINE":
            self._see_spline_point(line, has_length=has_length)

    def _see_number(self, number: int) -> None:
        if self.last_number is not None and starts_over(self.last_number, number):
            self.numbers = NumberSet()
        self.numbers.add(number)
        self.last_number = number

    def _see_header(self, block: Block) -> None:
        if block.header == "" and self.blocks:
            self.stray_percent_line = self.stray_percent_line or block.line
        elif not self.header_kind:
            self.header_kind = "header" if block.header is not None else "comment"
            self.is_subprogram |= (header_name(block) or "").upper().endswith("_SPF")

    def _see_modes(self, block: Block) -> None:
        for word in block.words:
            code = code_of(word)
            group = GROUP_OF.get(code) if code is not None else None
            if code is not None and group is ModalGroup.UNITS:
                self.is_inch = is_inch(code)
            if word.address == "T":
                self.is_tool_named = isinstance(word.value, Text)
            if code is not None and group is ModalGroup.WORK_OFFSET:
                self.is_zero_shifted = code != "G500"
                self.offsets += [] if code in self.offsets else [code]

    def _see_splines(self, block: Block) -> None:
        self.motion_code = motion_code_of(block) or self.motion_code
        self._see_modes(block)
        if self.motion_code != "BSPLINE":
            self.spline = SplineRun(0, 0, 0)
        elif any(word.address in _AXES for word in block.words):
            self._see_spline_point(block.line, has_length=any(word.address == "PL" for word in block.words))

    def _see_spline_point(self, line: int, *, has_length: bool) -> None:
        run = self.spline
        self.spline = SplineRun(run.line or line, run.blocks + 1, run.with_length + has_length)

    def see_command(self, command: canon.Command) -> None:
        """Take a canonical command into account after the rules have looked at it."""
        match command:
            case canon.Rapid():
                self._see_rapid(command)
            case canon.Line() | canon.Arc() | canon.Polynomial():
                self._see_feed(command)
            case canon.Spindle(speed_rpm=speed_rpm):
                self.spindle_line = command.line if speed_rpm and not self.spindle_rpm else None
                self.spindle_rpm = speed_rpm
                self.is_stop_told &= speed_rpm == 0.0
            case canon.Dwell():
                self.spindle_line = None
            case canon.ChangeTool(number=number):
                self.tool = NAMED_TOOL if self.is_tool_named else number
                self._see_edge(1)
            case canon.SelectEdge(number=number):
                self._see_edge(number)
            case canon.End():
                self.end_line = command.line
            case _:
                pass

    def _see_edge(self, number: int) -> None:
        self.edge = number
        self.is_edge_told &= number == 0

    @property
    def is_lacking(self) -> bool:
        """Whether the next cut comes with the spindle stopped or without an edge, and nothing has said so yet."""
        is_stopped = self.spindle_rpm == 0.0 and not self.is_stop_told and not self.is_subprogram
        return (is_stopped and not self.is_readiness_lost) or (self.edge == 0 and not self.is_edge_told)

    def forget(self, *, is_readiness_lost: bool) -> None:
        """A block was refused: where the tool would stand is not known, nor perhaps its tool and spindle."""
        self.is_readiness_lost |= is_readiness_lost
        self.is_height_known = False
        self.direction, self.is_backward, self.plunge = None, False, None

    def _see_rapid(self, move: canon.Rapid) -> None:
        self.has_moved = True
        if move.end[2] != move.start[2]:
            self.is_height_known = not move.is_machine
        if self.is_height_known:
            self.clear_z_mm = min(self.clear_z_mm, move.end[2])
        self.direction, self.is_backward, self.plunge = None, False, None

    def _see_feed(self, move: canon.Line | canon.Arc | canon.Polynomial) -> None:
        self.has_moved = True
        is_start_known = self.is_height_known
        self.is_height_known |= move.end[2] != move.start[2] and not self.is_incremental
        self.length_mm = length_mm = length(move)
        if is_air(move, self.clear_z_mm):
            self.air_mm += length_mm
            self.air_moves += 1
            self.idle_moves += not is_plunge(move)
            self.air_line = self.air_line or move.line
        else:
            self.cut_mm += length_mm
            if self.is_height_known:
                self.cut_top_mm = max(self.cut_top_mm, _top_mm(move, is_start_known=is_start_known))
        self.is_backward = not self.is_backward and turns_back(self.direction, move)
        self.plunge = move if isinstance(move, canon.Line) and is_plunge(move) and is_start_known else None
        if self.plunge is not None and move.end[2] < self.clear_z_mm:
            self.hole = move.end
            self.cut_top_mm = max(self.cut_top_mm, move.end[2])
        if length_mm > 0.0:
            self.direction = end_direction(move)
        self.spindle_line = None


def _top_mm(move: canon.Motion, *, is_start_known: bool) -> float:
    if not is_start_known:
        return move.end[2]
    return move.start[2] if is_retract(move) else heights_mm(move)[1]


def is_inch(code: str) -> bool:
    """Whether a code of the unit group means inches.

    >>> is_inch("G70"), is_inch("G710")
    (True, False)
    """
    return code in ("G70", "G700")


def motion_code_of(block: Block) -> str | None:
    """The code of group 1 in a block, or None."""
    for word in block.words:
        code = code_of(word)
        if code is not None and GROUP_OF.get(code) is ModalGroup.MOTION:
            return code
    return None
