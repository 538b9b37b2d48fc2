"""What the rules may know of everything before the block they look at: one small record, never the program."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dnc.profile import MachineProfile
from planner.gcode import GROUP_OF, Block, ModalGroup, code_of, header_name
from planner.job import Job
from sim.interpreter import canon
from sim.interpreter.moves import curve_point

Box = tuple[canon.Vector, canon.Vector]
_AXES = frozenset("XYZ")
_ENDS = frozenset({"M2", "M17", "M30"})


@dataclass(frozen=True, slots=True)
class Limits:
    """What a program is checked against; heights, stock and tool radii are known only where a job was given."""

    profile: MachineProfile
    clearance_z_mm: float | None = None
    stock_box_mm: Box | None = None
    tool_radii_mm: Mapping[int, float] = field(default_factory=dict)


def limits_of(profile: MachineProfile, job: Job | None) -> Limits:
    """The limits of a machine, with those of the job where there is one."""
    if job is None:
        return Limits(profile)
    return Limits(profile, job.setup.clearance_z_mm, job.setup.stock_box_mm, job.tool_radii_mm)


@dataclass(frozen=True, slots=True)
class SplineRun:
    """BSPLINE blocks so far without another code between: first line, blocks, how many carry PL."""

    line: int
    blocks: int
    with_length: int


TURN_COSINE = 0.866
"""Cosine of 30 degrees: a move that turns by more than 150 degrees runs back."""
TURN_FLAT = 0.1
"""Two moves are compared where their unit directions, seen from above, multiply to more than this."""
LARGEST_NUMBER = 99_999_999
"""The largest block number: eight digits, as the control's own post-processor library writes them."""


_LEAST_ROUND = 900


def starts_over(last: int, number: int) -> bool:
    """Whether block numbers begin a new round: behind N9990 comes N10, because the CAM system has four digits.

    >>> starts_over(9990, 10), starts_over(99999, 1), starts_over(9990, 9980), starts_over(120, 10)
    (True, True, False, False)
    """
    return last >= _LEAST_ROUND and 10 * number <= last


class NumberSet:
    """Block numbers seen, one bit each: 12.5 MB for all that a control allows; larger ones are not remembered."""

    def __init__(self) -> None:
        self._bits = bytearray()

    def __contains__(self, number: int) -> bool:
        place, bit = divmod(number, 8)
        return place < len(self._bits) and bool(self._bits[place] >> bit & 1)

    def add(self, number: int) -> None:
        """Remember a number, if it is one that a control allows."""
        if number > LARGEST_NUMBER:
            return
        place, bit = divmod(number, 8)
        if place >= len(self._bits):
            self._bits.extend(bytes(max(place + 1 - len(self._bits), len(self._bits))))
        self._bits[place] |= 1 << bit

    def holds(self, numbers: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which of these numbers were added, (n,)."""
        bits = np.frombuffer(self._bits, dtype=np.uint8)
        found = np.zeros(len(numbers), dtype=np.bool_)
        inside = numbers < 8 * len(bits)
        asked = numbers[inside]
        found[inside] = bits[asked >> 3] >> (asked & 7).astype(np.uint8) & 1
        return found

    def add_many(self, numbers: NDArray[np.int64]) -> None:
        """Remember numbers, all of which a control allows."""
        self.add(int(numbers.max()))
        bits = np.frombuffer(self._bits, dtype=np.uint8)
        np.bitwise_or.at(bits, numbers >> 3, np.uint8(1) << (numbers & 7).astype(np.uint8))


@dataclass(slots=True)
class Track:
    """State before the current block or command.

    `clear_z_mm` is the lowest height that a rapid reached: taken to be above the part. `cut_top_mm` is the highest
    point cut below it. `length_mm` is that of the last feed move, `direction` the unit direction at its end, None after
    a rapid or a stop. `air_mm` and `cut_mm` add up feed moves.
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
    is_position_known: bool = False
    spindle_rpm: float = 0.0
    spindle_line: int | None = None
    tool: int | None = None
    clear_z_mm: float = math.inf
    cut_top_mm: float = -math.inf
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

    def _see_units(self, block: Block) -> None:
        for word in block.words:
            code = code_of(word)
            if code is not None and GROUP_OF.get(code) is ModalGroup.UNITS:
                self.is_inch = is_inch(code)

    def _see_splines(self, block: Block) -> None:
        self.motion_code = motion_code_of(block) or self.motion_code
        self._see_units(block)
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
            case canon.Dwell():
                self.spindle_line = None
            case canon.ChangeTool(number=number):
                self.tool = number
            case canon.End():
                self.end_line = command.line
            case _:
                pass

    def _see_rapid(self, move: canon.Rapid) -> None:
        self.has_moved = True
        self.clear_z_mm = min(self.clear_z_mm, move.end[2])
        self.is_position_known = True
        self.direction, self.is_backward, self.plunge = None, False, None

    def _see_feed(self, move: canon.Line | canon.Arc | canon.Polynomial) -> None:
        self.has_moved = True
        self.length_mm = length_mm = length(move)
        if is_air(move, self.clear_z_mm):
            self.air_mm += length_mm
            self.air_moves += 1
            self.idle_moves += not is_plunge(move)
            self.air_line = self.air_line or move.line
        else:
            self.cut_mm += length_mm
            self.cut_top_mm = max(self.cut_top_mm, move.start[2], move.end[2])
        self.is_backward = not self.is_backward and turns_back(self.direction, move)
        self.plunge = move if isinstance(move, canon.Line) and is_plunge(move) else None
        if length_mm > 0.0:
            self.direction = end_direction(move)
        self.spindle_line = None


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


def moves_xy(move: canon.Motion) -> bool:
    """Whether X or Y changes."""
    return move.start[:2] != move.end[:2]


def is_plunge(move: canon.Motion) -> bool:
    """Whether the move goes straight down."""
    return not moves_xy(move) and move.end[2] < move.start[2]


def is_retract(move: canon.Motion) -> bool:
    """Whether the move goes straight up."""
    return not moves_xy(move) and move.end[2] > move.start[2]


def is_air(move: canon.Motion, clear_z_mm: float) -> bool:
    """Whether a feed move touches the clear height: above it, down from it or up to it."""
    return max(move.start[2], move.end[2]) >= clear_z_mm and (
        not moves_xy(move) or min(move.start[2], move.end[2]) >= clear_z_mm
    )


def turns_back(before: canon.Vector | None, move: canon.Motion) -> bool:
    """Whether the move sets out against the direction before it, by more than 150 degrees seen from above."""
    if before is None:
        return False
    ahead = start_direction(move)
    flat = math.hypot(*before[:2]) * math.hypot(*ahead[:2])
    return flat > TURN_FLAT and before[0] * ahead[0] + before[1] * ahead[1] < -TURN_COSINE * flat


def length(move: canon.Motion) -> float:
    """Length of a move, mm; curves by eight chords."""
    if isinstance(move, canon.Arc):
        radius = math.dist(move.start, move.centre)
        return math.hypot(radius * move.sweep_rad, _along_axis(move))
    if isinstance(move, canon.Polynomial):
        points = [point_at(move, move.length * step / 8) for step in range(9)]
        return sum(math.dist(a, b) for a, b in pairwise(points))
    return math.dist(move.start, move.end)


def _along_axis(move: canon.Arc) -> float:
    return sum((e - s) * a for s, e, a in zip(move.start, move.end, move.axis, strict=True))


def point_at(move: canon.Polynomial, parameter: float) -> canon.Vector:
    """The point of a polynomial at this parameter."""
    return curve_point(move.coefficients, move.denominator, parameter)


def start_direction(move: canon.Motion) -> canon.Vector:
    """Unit direction at the start; (0, 0, 0) where there is none."""
    if isinstance(move, canon.Polynomial):
        return _unit(move.start, point_at(move, move.length * 1e-3))
    if isinstance(move, canon.Arc):
        return _tangent(move, move.start)
    return _unit(move.start, move.end)


def end_direction(move: canon.Motion) -> canon.Vector:
    """Unit direction at the end; (0, 0, 0) where there is none."""
    if isinstance(move, canon.Polynomial):
        return _unit(point_at(move, move.length * (1.0 - 1e-3)), move.end)
    if isinstance(move, canon.Arc):
        return _tangent(move, move.end)
    return _unit(move.start, move.end)


def _tangent(move: canon.Arc, at: canon.Vector) -> canon.Vector:
    ax, ay, az = move.axis
    x, y, z = (p - c for p, c in zip(at, move.centre, strict=True))
    return _unit((0.0, 0.0, 0.0), (ay * z - az * y, az * x - ax * z, ax * y - ay * x))


def _unit(start: canon.Vector, end: canon.Vector) -> canon.Vector:
    size = math.dist(start, end)
    if size == 0.0:
        return 0.0, 0.0, 0.0
    x, y, z = ((e - s) / size for s, e in zip(start, end, strict=True))
    return x, y, z
