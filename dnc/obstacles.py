"""What earlier blocks may leave behind that no preamble restores."""

from __future__ import annotations

from dnc.preamble import SPLINES
from sim.interpreter.run import Interpreter


def obstacle_of(interpreter: Interpreter) -> str | None:
    """Why a restart cannot begin before the next block, or None."""
    state = interpreter.modal
    if not (state.tool or state.tool_name):
        return "no tool is called before, and another than the first run's may be in the spindle"
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
    if state.is_spindle_placed:
        return "the spindle stands at an angle (SPOS, M19), and the preamble would have it turn"
    if state.spindle_direction and not state.spindle_rpm:
        return "the spindle turns at a speed that the program does not name (S)"
    return None
