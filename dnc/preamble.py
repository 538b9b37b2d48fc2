"""The preamble of a restart: blocks that bring a control into the state which the blocks left out would have left.

They restore it before anything moves towards the part: modes and frames, tool and edge, then Z up, spindle with its
dwell, X and Y, coolant, rapid down to the clearance, feed down into the cut.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from planner.gcode import decimal_text, rounded_units, units_above
from sim.interpreter.mapping import mapping_of
from sim.interpreter.settings import Settings
from sim.interpreter.state import INCH_MM, State

FINEST_DECIMALS = 6
SPLINES = frozenset({"ASPLINE", "BSPLINE", "CSPLINE"})


@dataclass(frozen=True, slots=True)
class Heights:
    """How a restart comes down: heights in the program's own frame, `retract_z_mm` in machine coordinates or None.

    Heights that differ by less than `touch_mm` are one: sums of offsets leave a last digit. `decimals` is the most that
    the control reads.
    """

    safe_z_mm: float
    clearance_z_mm: float
    plunge_mm_min: float
    dwell_s: float
    retract_z_mm: float | None = None
    touch_mm: float = 1e-6
    decimals: int = FINEST_DECIMALS

    def is_clear(self, z_mm: float) -> bool:
        """Whether this height is at or above the clearance."""
        return z_mm >= self.clearance_z_mm - self.touch_mm

    def above(self, lift_mm: float) -> Heights:
        """The same heights, so much higher."""
        return replace(self, safe_z_mm=self.safe_z_mm + lift_mm, clearance_z_mm=self.clearance_z_mm + lift_mm)


@dataclass(frozen=True, slots=True)
class Spelling:
    """Numbers as the control reads them: lengths in units of `unit_mm`, with so many decimals at most."""

    unit_mm: float
    decimals: int

    def number(self, value: float) -> str:
        """A number that is no length."""
        return decimal_text(rounded_units(value, self.decimals), self.decimals)

    def length(self, value_mm: float) -> str:
        """A length or a feed."""
        return self.number(value_mm / self.unit_mm)

    def height(self, value_mm: float) -> str:
        """A height to stay clear of the part: never below the value, whatever the unit."""
        return decimal_text(units_above(value_mm, self.unit_mm, self.decimals), self.decimals)

    def axes(self, values_mm: Sequence[float | None]) -> list[str]:
        """Words for X, Y and Z, but for what is None or 0."""
        return [f"{name}{self.length(value)}" for name, value in zip("XYZ", values_mm, strict=True) if value]


def lift_of(state: State) -> float:
    """How much higher than the job's, mm, heights must be in a frame that lowers Z: the part does not sink with it."""
    return max(0.0, -state.frame.shift[2])


def preamble_blocks(
    state: State, heights: Heights, settings: Settings, untold: frozenset[int] = frozenset()
) -> Iterator[str]:
    """The blocks in their order of safety, in the unit of the program; the frame must be a shift.

    Axes that are `untold` stay where they stand; the block behind the preamble moves them.
    """
    heights = heights.above(lift_of(state))
    spelling = Spelling(INCH_MM if state.is_inch else 1.0, heights.decimals)
    x, y, z = mapping_of(state, settings, is_suppressed=False).inverse_point(state.position_mm)
    yield f"G17 G40 G60 {unit_code(is_inch=state.is_inch)} G90 G94"
    yield from retract_blocks(heights, spelling)
    yield from _tool_blocks(state, settings)
    yield state.work_offset
    yield from _frame_blocks(state, spelling)
    yield f"D{state.edge}"
    yield f"G0 Z{spelling.height(heights.safe_z_mm)}"
    yield from _spindle_blocks(state, spelling)
    if state.spindle_direction and heights.dwell_s > 0.0:
        yield f"G4 F{spelling.number(heights.dwell_s)}"
    aside = [
        f"{name}{spelling.length(at)}" for axis, (name, at) in enumerate((("X", x), ("Y", y))) if axis not in untold
    ]
    if aside:
        yield " ".join(["G0", *aside])
    yield from (code for code, is_on in (("M8", state.is_flood), ("M7", state.is_mist)) if is_on)
    if not heights.is_clear(z):
        yield f"G0 Z{spelling.height(heights.clearance_z_mm)}"
        yield f"G1 G9 Z{spelling.length(z)} F{spelling.length(heights.plunge_mm_min)}"
    else:
        yield f"G0 Z{spelling.length(z)}"
    yield from _mode_blocks(state, spelling)
    feed = f" F{spelling.number(state.feed)}" if state.feed is not None else ""
    yield f"{state.motion}{feed}"


def retract_blocks(heights: Heights, spelling: Spelling) -> list[str]:
    """Up to the machine height of a safe tool change, where there is one."""
    return [] if heights.retract_z_mm is None else [f"G0 SUPA Z{spelling.length(heights.retract_z_mm)} D0"]


def unit_code(*, is_inch: bool) -> str:
    """The code under which dimensions and feeds are read in this unit."""
    return "G700" if is_inch else "G710"


def _mode_blocks(state: State, spelling: Spelling) -> Iterator[str]:
    """What stays in force and moves nothing: codes, tolerances, axes of F, limits, words for the control alone."""
    codes = [state.plane, state.compensation, state.units, state.dimension, state.feed_type, state.path_mode]
    codes += [state.acceleration, state.feed_correction, state.corner]
    codes += [code for code in (state.spline_start, state.spline_end) if code not in ("BTAN", "ETAN")]
    yield " ".join([*codes, *([] if state.is_area_limited else ["WALIMOF"])])
    if state.rounding_distance_mm:
        yield f"ADIS={spelling.length(state.rounding_distance_mm)}"
    if state.contour_tolerance_mm is not None:
        yield f"CTOL={spelling.length(state.contour_tolerance_mm)}"
    if state.feed_axes is not None:
        yield f"FGROUP({','.join('XYZ'[axis] for axis in state.feed_axes)})"
    for code, limits in (("G25", state.area_min_mm), ("G26", state.area_max_mm)):
        words = [f"{name}{spelling.length(at)}" for name, at in zip("XYZ", limits, strict=True) if at is not None]
        if words:
            yield " ".join([code, *words])
    yield from state.unmodelled.values()


def _frame_blocks(state: State, spelling: Spelling) -> Iterator[str]:
    yield " ".join(["TRANS", *spelling.axes(state.frame.coarse)])
    fine = spelling.axes(state.frame.fine)
    if fine:
        yield " ".join(["G59", *fine])


def _tool_blocks(state: State, settings: Settings) -> Iterator[str]:
    """The tool by the changer, or by the operator's hand while the program waits; then the one chosen for later."""
    tool, later = (_called(state.tool, state.tool_name), _called(state.tool_selected, state.tool_selected_name))
    if not settings.has_tool_changer:
        said = f'MSG("TOOL {state.tool_name or state.tool}")'
        yield from [said, tool, "M0", "MSG()"] if tool != "T0" else []
        return
    if tool != "T0":
        yield f"{tool} M6"
    if later != tool:
        yield later


def _called(number: int, name: str) -> str:
    """The word that calls a tool; what has a name is never called by a number, which may be another tool's."""
    return f'T="{name}"' if name else f"T{number}"


def _spindle_blocks(state: State, spelling: Spelling) -> Iterator[str]:
    """Limits first, so that the speed is never above them."""
    for code, rpm in (("G25", state.spindle_min_rpm), ("G26", state.spindle_max_rpm)):
        if rpm:
            yield f"{code} S{spelling.number(rpm)}"
    if state.spindle_rpm:
        turn = {1: " M3", -1: " M4", 0: ""}[state.spindle_direction]
        yield f"S{spelling.number(state.spindle_rpm)}{turn}"
