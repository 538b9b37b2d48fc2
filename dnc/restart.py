"""A safe restart of an interrupted program, computed from its blocks alone: where to begin, and the preamble before it.

The preamble restores what earlier blocks left behind before anything moves towards the part: modes and frames, tool and
edge, then Z up, spindle with its dwell, X and Y, coolant, rapid down to the clearance, feed down into the cut. Where
that cannot be restored exactly (inside a spline, under G41 or G42) the restart is refused with the nearest block before
it that can.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from dnc.errors import InputRejected
from planner.gcode import SyntaxProblem, decimal_text, read_block, rounded_units
from sim.interpreter import canon
from sim.interpreter.frames import IDENTITY
from sim.interpreter.mapping import mapping_of
from sim.interpreter.run import Interpreter
from sim.interpreter.settings import Settings
from sim.interpreter.state import State

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
    stand when it begins (canonical work coordinates). `preamble` are blocks without line ends.
    """

    line: int
    block: int | None
    offset_bytes: int
    position_mm: canon.Vector
    preamble: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Place:
    """A block and the state before it."""

    line: int
    number: int | None
    offset_bytes: int
    state: State


def restart_at_number(data: bytes, number: int, heights: Heights, settings: Settings | None = None) -> RestartPoint:
    """The restart before block N`number`; raises InputRejected if it is missing, stands twice or cannot be restored."""
    found = [place for place in _places(data, settings) if place.number == number]
    if len(found) != 1:
        what = f"N{number} stands {len(found)} times" if found else f"there is no block N{number}"
        raise InputRejected(what, remedy="name a line instead, or the number of a pass start")
    return _restart(data, found[0], heights, settings)


def restart_at_line(data: bytes, line: int, heights: Heights, settings: Settings | None = None) -> RestartPoint:
    """The restart before physical line `line`; raises InputRejected if it is not there or cannot be restored."""
    for place in _places(data, settings):
        if place.line == line:
            return _restart(data, place, heights, settings)
    raise InputRejected(f"the program has no line {line} that can be reached", remedy="name an earlier line")


def clear_points(data: bytes, heights: Heights, settings: Settings | None = None) -> Iterator[RestartPoint]:
    """Every block that begins with the tool called and standing at or above the clearance, where nothing is cut."""
    used = settings or Settings()
    for place in _places(data, settings):
        state = place.state
        if not state.tool or state.motion != "G0" or _obstacle(state) is not None:
            continue
        height_mm = mapping_of(state, used, is_suppressed=False).inverse_point(state.position_mm)[2]
        if height_mm >= heights.clearance_z_mm - _TOUCH_MM:
            yield _restart(data, place, heights, settings)


def last_safe_line(data: bytes, line: int, settings: Settings | None = None) -> int | None:
    """The last line up to `line` at which a restart can be computed and the tool is not in a spline, or None."""
    safe: int | None = None
    for place in _places(data, settings):
        if place.line > line:
            break
        if _obstacle(place.state) is None and place.state.tool:
            safe = place.line
    return safe


def modal_blocks(state: State) -> list[str] | None:
    """Blocks that set the modes, the offset and the frame of this state at a control in metric units; nothing moves.

    The last two are work offset and frame. None where the frame is more than a shift, or where a unit other than the
    millimetre is active, because the words before it would be read in it.
    """
    if state.frame.matrix != IDENTITY or state.is_inch:
        return None
    codes = [state.plane, state.compensation, state.units, state.dimension, state.feed_type, state.path_mode]
    blocks = [" ".join([*codes, state.acceleration, state.feed_correction, state.corner])]
    if state.path_mode == "G641":
        blocks.append(f"ADIS={_text(state.rounding_distance_mm)}")
    if state.contour_tolerance_mm is not None:
        blocks.append(f"CTOL={_text(state.contour_tolerance_mm)}")
    if state.feed_axes is not None:
        blocks.append(f"FGROUP({','.join('XYZ'[axis] for axis in state.feed_axes)})")
    shift = state.frame.shift
    words = [_word("XYZ"[axis], shift[axis]) for axis in range(3) if shift[axis]]
    return [*blocks, state.work_offset, " ".join(["TRANS", *words])]


def resumed_interpreter(state: State, settings: Settings) -> Interpreter | None:
    """A fresh interpreter in the same modal state and place, or None where `modal_blocks` is."""
    blocks = modal_blocks(state)
    if blocks is None:
        return None
    fresh = Interpreter(replace(settings, start_mm=state.position_mm))
    words = [f"T{state.tool} M6" if state.tool else "", f"D{state.edge}", *_spindle(state)]
    words += [f"F{_text(state.feed)}" if state.feed is not None else "", *_coolant(state)]
    motion = [] if state.motion in _SPLINES else [state.motion]
    for block in [*blocks, *words, *motion]:
        if block:
            fresh.block(block.encode("ascii"), 0)
    return fresh


def _restart(data: bytes, place: _Place, heights: Heights, settings: Settings | None) -> RestartPoint:
    state = place.state
    obstacle = _obstacle(state)
    if obstacle is not None:
        safe = last_safe_line(data, place.line, settings)
        remedy = f"restart at line {safe}" if safe is not None else "run the program from its start"
        raise InputRejected(f"line {place.line}: {obstacle}", remedy=remedy)
    preamble = tuple(_preamble(state, heights, settings or Settings()))
    return RestartPoint(place.line, place.number, place.offset_bytes, state.position_mm, preamble)


def _obstacle(state: State) -> str | None:
    """Why a restart cannot begin in this state, or None."""
    if state.motion in _SPLINES:
        return f"{state.motion} is running, and the curve depends on blocks before"
    if state.motion == "CT":
        return "CT takes its direction from the block before"
    if state.compensation != "G40":
        return f"{state.compensation} is active, and its contour depends on blocks before"
    if modal_blocks(state) is None:
        return "inches are active, or a frame turns, scales or mirrors, which the preamble cannot restore"
    return None


def _preamble(state: State, heights: Heights, settings: Settings) -> Iterator[str]:
    """The blocks in their order of safety."""
    modes = modal_blocks(state)
    assert modes is not None
    x, y, z = mapping_of(state, settings, is_suppressed=False).inverse_point(state.position_mm)
    yield "G17 G40 G60 G710 G90 G94"
    if heights.retract_z_mm is not None:
        yield f"G0 SUPA Z{_text(heights.retract_z_mm)} D0"
    if state.tool:
        yield f"T{state.tool} M6" if settings.has_tool_changer else f"T{state.tool}"
        if not settings.has_tool_changer:
            yield "M0"
    yield from modes[-2:]
    yield f"D{state.edge}"
    yield f"G0 {_word('Z', heights.safe_z_mm)}"
    yield from _spindle(state)
    if state.spindle_direction and heights.dwell_s > 0.0:
        yield f"G4 F{_text(heights.dwell_s)}"
    yield f"G0 {_word('X', x)} {_word('Y', y)}"
    yield from _coolant(state)
    if z < heights.clearance_z_mm - _TOUCH_MM:
        yield f"G0 {_word('Z', heights.clearance_z_mm)}"
        yield f"G1 G9 {_word('Z', z)} F{_text(heights.plunge_mm_min)}"
    else:
        yield f"G0 {_word('Z', z)}"
    yield from modes[:-2]
    feed = f" F{_text(state.feed)}" if state.feed is not None else ""
    yield f"{state.motion}{feed}"


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
        yield _Place(line, _number(raw, line), offset, state)
        interpreter.block(raw.rstrip(b"\r\n"), line)
        offset += len(raw)


def _lines(data: bytes) -> Iterable[bytes]:
    return data.splitlines(keepends=True)


def _number(raw: bytes, line: int) -> int | None:
    try:
        return read_block(raw.decode("latin-1"), line).number
    except SyntaxProblem:
        return None
