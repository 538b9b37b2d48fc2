"""A safe restart of an interrupted program, computed from its blocks alone: where to begin, and the preamble before it.

The preamble restores what earlier blocks left behind before anything moves towards the part: modes and frames, tool and
edge, then Z up, spindle with its dwell, X and Y, coolant, rapid down to the clearance, feed down into the cut. Where
that cannot be restored exactly (inside a spline, under G41 or G42) the restart is refused with the nearest block before
it that can.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from dnc.errors import InputRejected
from planner.gcode import SyntaxProblem, decimal_text, read_block, rounded_units, value_text
from sim.interpreter import canon
from sim.interpreter.frames import IDENTITY
from sim.interpreter.mapping import mapping_of
from sim.interpreter.run import Interpreter, interpret
from sim.interpreter.settings import Settings
from sim.interpreter.state import INCH_MM, State

_SPLINES = frozenset({"ASPLINE", "BSPLINE", "CSPLINE"})
_DECIMALS = 6
_TOUCH_MM = 1e-6


@dataclass(frozen=True, slots=True)
class Heights:
    """How a restart comes down: heights in the program's own frame, `retract_z_mm` in machine coordinates or None."""

    safe_z_mm: float
    clearance_z_mm: float
    plunge_mm_min: float
    dwell_s: float
    retract_z_mm: float | None = None


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

    @property
    def unit_mm(self) -> float:
        """The unit of the program here, mm."""
        return INCH_MM if self.is_inch else 1.0

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
        is_clear = _is_clear(place, heights, used)
        if is_clear and not was_clear:
            yield _restart(data, place, heights, settings)
        was_clear = is_clear


def _is_clear(place: _Place, heights: Heights, settings: Settings) -> bool:
    state = place.state
    if not state.tool or state.motion != "G0" or place.obstacle is not None:
        return False
    height_mm = mapping_of(state, settings, is_suppressed=False).inverse_point(state.position_mm)[2]
    return height_mm >= heights.clearance_z_mm - _TOUCH_MM


def last_safe_line(data: bytes, line: int, settings: Settings | None = None) -> int | None:
    """The last line up to `line` at which a restart can be computed and the tool is not in a spline, or None."""
    safe: int | None = None
    for place in _places(data, settings):
        if place.line > line:
            break
        if place.obstacle is None and place.state.tool:
            safe = place.line
    return safe


def modal_blocks(state: State) -> list[str] | None:
    """Blocks that set the modes, the offset and the frame of this state; nothing moves.

    The last two are work offset and frame. None where the frame is more than a shift.
    """
    if state.frame.matrix != IDENTITY:
        return None
    unit_mm = _unit_mm(state)
    codes = [state.plane, state.compensation, state.units, state.dimension, state.feed_type, state.path_mode]
    blocks = [" ".join([*codes, state.acceleration, state.feed_correction, state.corner])]
    if state.path_mode == "G641":
        blocks.append(f"ADIS={_text(state.rounding_distance_mm / unit_mm)}")
    if state.contour_tolerance_mm is not None:
        blocks.append(f"CTOL={_text(state.contour_tolerance_mm / unit_mm)}")
    if state.feed_axes is not None:
        blocks.append(f"FGROUP({','.join('XYZ'[axis] for axis in state.feed_axes)})")
    shift = state.frame.shift
    words = [_word("XYZ"[axis], shift[axis] / unit_mm) for axis in range(3) if shift[axis]]
    return [*blocks, state.work_offset, " ".join(["TRANS", *words])]


def resumed_interpreter(stopped: Interpreter, settings: Settings) -> Interpreter | None:
    """A fresh interpreter in the same state and place, variables included, or None where `modal_blocks` is."""
    state = stopped.state
    blocks = modal_blocks(state)
    if blocks is None:
        return None
    fresh = Interpreter(replace(settings, start_mm=state.position_mm))
    words = [*(_tool_blocks(state.tool, settings) if state.tool else ()), f"D{state.edge}", *_spindle(state)]
    words += [f"F{_text(state.feed)}" if state.feed is not None else "", *_coolant(state)]
    motion = [] if state.motion in _SPLINES else [state.motion]
    for block in [*blocks, *words, *motion]:
        if block:
            fresh.block(block.encode("ascii"), 0)
    fresh.go_on_from(stopped)
    return fresh


def _unreachable(what: str, data: bytes, settings: Settings | None) -> InputRejected:
    """There is no such place, or the control stops before it."""
    for command in interpret(data, settings):
        if isinstance(command, canon.Alarm):
            where = f"the control would stop in line {command.line} with alarm {command.number}: {command.text}"
            return InputRejected(f"{what} is not reached; {where}", remedy="mend it, or restart at an earlier line")
    return InputRejected(f"the program has no {what}", remedy="name a line instead, or the number of a pass start")


def _restart(data: bytes, place: _Place, heights: Heights, settings: Settings | None) -> RestartPoint:
    state = place.state
    if place.obstacle is not None:
        safe = last_safe_line(data, place.line, settings)
        remedy = f"restart at line {safe}" if safe is not None else "run the program from its start"
        raise InputRejected(f"line {place.line}: {place.obstacle}", remedy=remedy)
    parameters = [f"R{number}={value_text(value)}" for number, value in sorted(place.parameters.items())]
    preamble = (*parameters, *_preamble(state, heights, settings or Settings()))
    return RestartPoint(place.line, place.number, place.offset_bytes, state.position_mm, preamble, state.is_inch)


def _obstacle(interpreter: Interpreter) -> str | None:
    """Why a restart cannot begin before the next block, or None."""
    state = interpreter.modal
    if interpreter.is_in_structure:
        return "IF, a loop or a jump is open, which does not end well without its beginning"
    if interpreter.variables.globals:
        return "variables are defined by DEF, which the preamble does not restore"
    if state.motion in _SPLINES:
        return f"{state.motion} is running, and the curve depends on blocks before"
    if state.motion == "CT":
        return "CT takes its direction from the block before"
    if state.compensation != "G40":
        return f"{state.compensation} is active, and its contour depends on blocks before"
    if modal_blocks(state) is None:
        return "a frame turns, scales or mirrors, which the preamble cannot restore"
    return None


def _preamble(state: State, heights: Heights, settings: Settings) -> Iterator[str]:
    """The blocks in their order of safety, in the unit of the program."""
    modes = modal_blocks(state)
    assert modes is not None
    unit_mm = _unit_mm(state)
    here_mm = mapping_of(state, settings, is_suppressed=False).inverse_point(state.position_mm)
    x, y, z = (value_mm / unit_mm for value_mm in here_mm)
    yield f"G17 G40 G60 {unit_code(is_inch=state.is_inch)} G90 G94"
    yield from retract_blocks(heights, unit_mm)
    if state.tool:
        yield from _tool_blocks(state.tool, settings)
    yield from modes[-2:]
    yield f"D{state.edge}"
    yield f"G0 Z{height_text(heights.safe_z_mm, unit_mm)}"
    yield from _spindle(state)
    if state.spindle_direction and heights.dwell_s > 0.0:
        yield f"G4 F{_text(heights.dwell_s)}"
    yield f"G0 {_word('X', x)} {_word('Y', y)}"
    yield from _coolant(state)
    if here_mm[2] < heights.clearance_z_mm - _TOUCH_MM:
        yield f"G0 Z{height_text(heights.clearance_z_mm, unit_mm)}"
        yield f"G1 G9 {_word('Z', z)} F{_text(heights.plunge_mm_min / unit_mm)}"
    else:
        yield f"G0 {_word('Z', z)}"
    yield from modes[:-2]
    feed = f" F{_text(state.feed)}" if state.feed is not None else ""
    yield f"{state.motion}{feed}"


def unit_code(*, is_inch: bool) -> str:
    """The code under which dimensions and feeds are read in this unit."""
    return "G700" if is_inch else "G710"


def retract_blocks(heights: Heights, unit_mm: float) -> list[str]:
    """Up to the machine height of a safe tool change, where there is one."""
    return [] if heights.retract_z_mm is None else [f"G0 SUPA Z{_text(heights.retract_z_mm / unit_mm)} D0"]


def height_text(value_mm: float, unit_mm: float) -> str:
    """A height to stay clear of the part: never below the value, whatever the unit."""
    scale = 10.0**_DECIMALS
    return decimal_text(math.ceil(value_mm / unit_mm * scale - _TOUCH_MM), _DECIMALS)


def _unit_mm(state: State) -> float:
    return INCH_MM if state.is_inch else 1.0


def _tool_blocks(number: int, settings: Settings) -> list[str]:
    """The tool by the changer, or by the operator's hand while the program waits."""
    if settings.has_tool_changer:
        return [f"T{number} M6"]
    return [f'MSG("TOOL {number}")', f"T{number}", "M0", "MSG()"]


def _spindle(state: State) -> list[str]:
    if not state.spindle_rpm:
        return []
    turn = {1: " M3", -1: " M4", 0: ""}[state.spindle_direction]
    return [f"S{_text(state.spindle_rpm)}{turn}"]


def _coolant(state: State) -> list[str]:
    return [code for code, is_on in (("M8", state.is_flood), ("M7", state.is_mist)) if is_on]


def _word(address: str, value_mm: float) -> str:
    return f"{address}{_text(value_mm)}"


def _text(value: float) -> str:
    return decimal_text(rounded_units(value, _DECIMALS), _DECIMALS)


def _places(data: bytes, settings: Settings | None) -> Iterator[_Place]:
    """Every line with the state before it, until the control would stop."""
    interpreter = Interpreter(settings)
    offset = 0
    for line, raw in enumerate(_lines(data), 1):
        state = interpreter.state
        if state.is_ended:
            return
        parameters = dict(interpreter.variables.r)
        yield _Place(line, _number(raw, line), offset, state, parameters, _obstacle(interpreter))
        interpreter.block(raw.rstrip(b"\r\n"), line)
        offset += len(raw)


def _lines(data: bytes) -> Iterable[bytes]:
    return data.splitlines(keepends=True)


def _number(raw: bytes, line: int) -> int | None:
    try:
        return read_block(raw.decode("latin-1"), line).number
    except SyntaxProblem:
        return None
