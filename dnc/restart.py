"""A safe restart of an interrupted program, computed from its blocks alone: where to begin, and the preamble before it.

Where no preamble restores what earlier blocks left behind (inside a spline, under G41 or G42) the restart is refused,
naming the nearest block before it that can be restored.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from dnc.errors import InputRejected
from dnc.preamble import SPLINES, Heights, Spelling, preamble_blocks, unit_code
from planner.gcode import GROUP_OF, Block, ModalGroup, SyntaxProblem, code_of, read_block, value_text
from sim.interpreter import canon
from sim.interpreter.mapping import mapping_of
from sim.interpreter.run import Interpreter, interpret
from sim.interpreter.settings import Settings
from sim.interpreter.state import INCH_MM, State

_OPTIONAL = re.compile(rb"^[ \t\r]*(?:[N:][ \t]*\d+[ \t]*)?/", re.MULTILINE | re.IGNORECASE)
_NO_DIMENSIONS = frozenset({ModalGroup.FRAME, ModalGroup.SUPPRESSION, ModalGroup.ONE_SHOT})
"""Codes in whose blocks X, Y and Z are no places in the program's own coordinates."""
_GEOMETRY = frozenset({"X", "Y", "Z", "PO"})


@dataclass(frozen=True, slots=True)
class RestartPoint:
    """The block to go on with and what must run before it.

    `line` counts from 1, `offset_bytes` is where the block begins in the program, `position_mm` where the tool must
    stand when it begins (canonical work coordinates). `preamble` are blocks without line ends. `is_inch` is the unit of
    the program at this place.
    """

    line: int
    block: int | None
    offset_bytes: int
    position_mm: canon.Vector
    preamble: tuple[str, ...]
    is_inch: bool

    def spelling(self, heights: Heights) -> Spelling:
        """How numbers are written here."""
        return Spelling(INCH_MM if self.is_inch else 1.0, heights.decimals)

    @property
    def unit_code(self) -> str:
        """The code under which dimensions and feeds are read in that unit."""
        return unit_code(is_inch=self.is_inch)


@dataclass(frozen=True, slots=True)
class _Place:
    """A block and what stands before it: the state, R parameters by number, and why no restart can begin here."""

    line: int
    number: int | None
    offset_bytes: int
    state: State
    parameters: dict[int, float]
    obstacle: str | None


def restart_at_number(data: bytes, number: int, heights: Heights, settings: Settings | None = None) -> RestartPoint:
    """The restart before block N`number`; raises InputRejected if it is missing, stands twice or cannot be restored."""
    found = [place for place in _places(data, settings) if place.number == number]
    if not found:
        raise _unreachable(f"block N{number}", data, settings)
    if len(found) > 1:
        what = f"N{number} stands {len(found)} times"
        raise InputRejected(what, remedy="name a line instead, or the number of a pass start")
    return _restart(data, found[0], heights, settings)


def restart_at_line(data: bytes, line: int, heights: Heights, settings: Settings | None = None) -> RestartPoint:
    """The restart before physical line `line`; raises InputRejected if it is not there or cannot be restored."""
    for place in _places(data, settings):
        if place.line == line:
            return _restart(data, place, heights, settings)
    raise _unreachable(f"line {line}", data, settings)


def clear_points(data: bytes, heights: Heights, settings: Settings | None = None) -> Iterator[RestartPoint]:
    """Where passes end: every block before which the tool, called, has come to stand at or above the clearance."""
    used = settings or Settings()
    was_clear = False
    for place in _places(data, settings):
        is_clear = _is_clear(place, heights, used) and _obstacle_at(data, place) is None
        if is_clear and not was_clear:
            yield _restart(data, place, heights, settings)
        was_clear = is_clear


def _is_clear(place: _Place, heights: Heights, settings: Settings) -> bool:
    state = place.state
    if not (state.tool or state.tool_name) or state.motion != "G0":
        return False
    height_mm = mapping_of(state, settings, is_suppressed=False).inverse_point(state.position_mm)[2]
    return heights.is_clear(height_mm)


def last_safe_line(data: bytes, line: int, settings: Settings | None = None) -> int | None:
    """The last line up to `line` at which a restart can be computed and the tool is not in a spline, or None."""
    safe: int | None = None
    for place in _places(data, settings):
        if place.line > line:
            break
        is_armed = place.state.tool or place.state.tool_name
        if is_armed and _obstacle_at(data, place) is None:
            safe = place.line
    return safe


def first_optional_line(data: bytes, before_bytes: int) -> int | None:
    r"""The first line with a / before this offset: the panel says whether it runs, a preamble takes it as run.

    >>> first_optional_line(b"N1 G54\nN2 /TRANS Z5\nN3 X1/2\n", 99), first_optional_line(b"X1\n/X2\n", 3)
    (2, None)
    """
    found = _OPTIONAL.search(data, 0, before_bytes)
    return None if found is None else data.count(b"\n", 0, found.start()) + 1


def _unreachable(what: str, data: bytes, settings: Settings | None) -> InputRejected:
    """There is no such place, or the control stops before it."""
    for command in interpret(data, settings):
        if isinstance(command, canon.Alarm):
            where = f"the control would stop in line {command.line} with alarm {command.number}: {command.text}"
            return InputRejected(f"{what} is not reached; {where}", remedy="mend it, or restart at an earlier line")
    return InputRejected(f"the program has no {what}", remedy="name a line instead, or the number of a pass start")


def _restart(data: bytes, place: _Place, heights: Heights, settings: Settings | None) -> RestartPoint:
    state, obstacle = place.state, _obstacle_at(data, place)
    if obstacle is not None:
        safe = last_safe_line(data, place.line, settings)
        remedy = f"restart at line {safe}" if safe is not None else "run the program from its start"
        raise InputRejected(f"line {place.line}: {obstacle}", remedy=remedy)
    parameters = [f"R{number}={value_text(value)}" for number, value in sorted(place.parameters.items())]
    preamble = (*parameters, *preamble_blocks(state, heights, settings or Settings()))
    return RestartPoint(place.line, place.number, place.offset_bytes, state.position_mm, preamble, state.is_inch)


def _obstacle_at(data: bytes, place: _Place) -> str | None:
    """Why no restart can begin at this place: what stands before it, or a first move that takes up a direction."""
    if place.obstacle is not None:
        return place.obstacle
    motion, start = place.state.motion, place.state.spline_start
    offset = place.offset_bytes
    while offset < len(data):
        stop = data.find(b"\n", offset) + 1 or len(data)
        block = _read(data[offset:stop])
        offset = stop
        codes = {GROUP_OF.get(code): code for code in map(code_of, block.words if block else ()) if code}
        motion = codes.get(ModalGroup.MOTION, motion)
        start = codes.get(ModalGroup.SPLINE_START, start)
        if block and ModalGroup.FRAME not in codes and any(word.address in _GEOMETRY for word in block.words):
            break
    if motion == "CT" or (motion in ("ASPLINE", "CSPLINE") and start == "BTAN"):
        return f"{motion} takes its direction from the move before"
    return None


def _obstacle(interpreter: Interpreter) -> str | None:
    """Why a restart cannot begin before the next block, or None."""
    state = interpreter.modal
    if interpreter.is_in_structure:
        return "IF, a loop or a jump is open, which does not end well without its beginning"
    if interpreter.variables.globals:
        return "variables are defined by DEF, which the preamble does not restore"
    if state.motion in SPLINES:
        return f"{state.motion} is running, and the curve depends on blocks before"
    if state.compensation != "G40":
        return f"{state.compensation} is active, and its contour depends on blocks before"
    if interpreter.is_waiting:
        return "the spline, or the contour of G41 or G42, is ended by the next move only"
    if not state.edge:
        return "D0 is in force: heights count from the spindle, and the preamble would lower the tool by its length"
    if not (state.tool_name.isascii() and state.tool_selected_name.isascii()):
        return "a tool's name has letters that the preamble cannot write"
    if not state.frame.is_identity_matrix:
        return "a frame turns, scales or mirrors, which the preamble cannot restore"
    return None


class _Whereabouts:
    """Which axes stand where only the control can tell: it alone knows its work offsets.

    Those are axes that were moved in machine coordinates (SUPA, G53, reference points) or before the work offset
    changed, until a dimension in the program's own coordinates moves them again.
    """

    def __init__(self) -> None:
        self._moved: set[int] = set()
        self._unsure: set[int] = set()

    @property
    def obstacle(self) -> str | None:
        """Why no restart can begin here, or None."""
        if not self._unsure:
            return None
        axes = ", ".join("XYZ"[axis] for axis in sorted(self._unsure))
        return f"where {axes} stands depends on work offsets that only the control knows (SUPA, G53, another offset)"

    def note(self, block: Block | None, commands: Iterable[canon.Command], offset_before: str, after: State) -> None:
        """A block, None where it was not surely run; what it commanded; the work offset before, the state behind it."""
        if after.work_offset != offset_before:
            self._unsure |= self._moved
        for one in commands:
            if isinstance(one, canon.Motion):
                axes = {axis for axis in range(3) if one.start[axis] != one.end[axis]}
                self._moved |= axes
                self._unsure |= axes if isinstance(one, canon.Rapid) and one.is_machine else set()
        groups = {GROUP_OF.get(code) for code in map(code_of, block.words if block else ()) if code}
        if block is None or not groups.isdisjoint(_NO_DIMENSIONS):
            return
        named = {word.address: word.value for word in block.words}
        self._moved |= {axis for axis, name in enumerate("XYZ") if name in named}
        if after.dimension == "G90":  # an expression may be IC()
            self._unsure -= {axis for axis, name in enumerate("XYZ") if isinstance(named.get(name), float)}


def _places(data: bytes, settings: Settings | None) -> Iterator[_Place]:
    """Every line with the state before it, until the control would stop."""
    interpreter, whereabouts = Interpreter(settings), _Whereabouts()
    are_offsets_known = settings is not None and bool(settings.work_offsets_mm)
    offset = 0
    for line, raw in enumerate(_lines(data), 1):
        state = interpreter.state
        if state.is_ended:
            return
        parameters = dict(interpreter.variables.r)
        obstacle = _obstacle(interpreter) or (None if are_offsets_known else whereabouts.obstacle)
        block = _read(raw)
        yield _Place(line, block.number if block else None, offset, state, parameters, obstacle)
        commands = interpreter.block(raw.rstrip(b"\r\n"), line)
        is_run = not interpreter.is_in_structure
        whereabouts.note(block if is_run else None, commands, state.work_offset, interpreter.modal)
        offset += len(raw)


def _lines(data: bytes) -> Iterator[bytes]:
    """Lines with their ends, as the control takes them: LF ends a block."""
    start = 0
    while start < len(data):
        stop = data.find(b"\n", start) + 1 or len(data)
        yield data[start:stop]
        start = stop


def _read(raw: bytes) -> Block | None:
    try:
        return read_block(raw.decode("latin-1"))
    except SyntaxProblem:
        return None
