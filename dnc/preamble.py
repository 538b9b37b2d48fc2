"""The preamble of a restart: blocks that bring a control into the state which the blocks left out would have left.

They restore it before anything moves towards the part: modes and frames, tool and edge, then Z up, spindle with its
dwell, X and Y, coolant, rapid down to the clearance, feed down into the cut.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from planner.gcode import decimal_text, rounded_units, units_above
from sim.interpreter.frames import IDENTITY
from sim.interpreter.mapping import mapping_of
from sim.interpreter.run import Interpreter
from sim.interpreter.settings import Settings
from sim.interpreter.state import INCH_MM, State

SPLINES = frozenset({"ASPLINE", "BSPLINE", "CSPLINE"})
_DECIMALS = 6


@dataclass(frozen=True, slots=True)
class Heights:
    """How a restart comes down: heights in the program's own frame, `retract_z_mm` in machine coordinates or None.

    Heights that differ by less than `touch_mm` are one: sums of offsets leave a last digit.
    """

    safe_z_mm: float
    clearance_z_mm: float
    plunge_mm_min: float
    dwell_s: float
    retract_z_mm: float | None = None
    touch_mm: float = 1e-6

    def is_clear(self, z_mm: float) -> bool:
        """Whether this height is at or above the clearance."""
        return z_mm >= self.clearance_z_mm - self.touch_mm


def preamble_blocks(state: State, heights: Heights, settings: Settings) -> Iterator[str]:
    """The blocks in their order of safety, in the unit of the program; only for states with `modal_blocks`."""
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
    if not heights.is_clear(here_mm[2]):
        yield f"G0 Z{height_text(heights.clearance_z_mm, unit_mm)}"
        yield f"G1 G9 {_word('Z', z)} F{_text(heights.plunge_mm_min / unit_mm)}"
    else:
        yield f"G0 {_word('Z', z)}"
    yield from modes[:-2]
    feed = f" F{_text(state.feed)}" if state.feed is not None else ""
    yield f"{state.motion}{feed}"


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
    motion = [] if state.motion in SPLINES else [state.motion]
    for block in [*blocks, *words, *motion]:
        if block:
            fresh.block(block.encode("ascii"), 0)
    fresh.go_on_from(stopped)
    return fresh


def unit_code(*, is_inch: bool) -> str:
    """The code under which dimensions and feeds are read in this unit."""
    return "G700" if is_inch else "G710"


def retract_blocks(heights: Heights, unit_mm: float) -> list[str]:
    """Up to the machine height of a safe tool change, where there is one."""
    return [] if heights.retract_z_mm is None else [f"G0 SUPA Z{_text(heights.retract_z_mm / unit_mm)} D0"]


def height_text(value_mm: float, unit_mm: float) -> str:
    """A height to stay clear of the part: never below the value, whatever the unit."""
    return decimal_text(units_above(value_mm, unit_mm, _DECIMALS), _DECIMALS)


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
