"""The words that set modes and feed: they change the state for this block and those after it."""

from __future__ import annotations

from planner.gcode import ModalGroup, write_word
from sim.interpreter import canon
from sim.interpreter.alarms import AlarmNumber, ControlAlarm
from sim.interpreter.outlet import Outlet
from sim.interpreter.request import Request
from sim.interpreter.state import INCH_MM, State
from sim.interpreter.vocabulary import IGNORED_CODES

_MODES = {"G60": canon.PathMode.EXACT_STOP, "G64": canon.PathMode.CONTINUOUS, "G641": canon.PathMode.ROUNDING_DISTANCE}
_PLAIN_MODALS = (
    (ModalGroup.PLANE, "plane"),
    (ModalGroup.DIMENSION, "dimension"),
    (ModalGroup.UNITS, "units"),
    (ModalGroup.WORK_OFFSET, "work_offset"),
    (ModalGroup.COMPENSATION, "compensation"),
    (ModalGroup.CORNER, "corner"),
    (ModalGroup.FEED_CORRECTION, "feed_correction"),
    (ModalGroup.SPLINE_START, "spline_start"),
    (ModalGroup.SPLINE_END, "spline_end"),
)


_PASSING_GROUPS = frozenset({ModalGroup.FIFO, ModalGroup.LANGUAGE})
_LASTING_WORDS = frozenset({"ADISPOS", "OTOL", "ATOL", "CYCLE832", "SPLINEPATH", "POLYPATH"})
_GEARS = frozenset(range(40, 46))
_TURNING, _PLACING = frozenset({3, 4, 5}), frozenset({19, 70})


def remember(request: Request, state: State) -> None:
    """Words without effect here that last on the control itself: whoever restores the state must write them again."""
    lasting = {
        group.name: code
        for group, (code, _) in request.codes.items()
        if code in IGNORED_CODES and group not in _PASSING_GROUPS
    }
    for number in _GEARS.intersection(request.m_codes):
        lasting["gear"] = f"M{number}"
    for word in request.accepted:
        if word.address in _LASTING_WORDS:
            lasting[word.address] = write_word(word)
    if _PLACING.intersection(request.m_codes) or any(word.address == "SPOS" for word in request.accepted):
        state.is_spindle_placed = True
    elif _TURNING.intersection(request.m_codes):
        state.is_spindle_placed = False
    if lasting:
        state.unmodelled = {**state.unmodelled, **lasting}


def set_modes(request: Request, state: State, outlet: Outlet) -> None:
    """The modal codes of a block, and the path mode with its distance and tolerance."""
    for group, attribute in _PLAIN_MODALS:
        code = request.code(group)
        if code is not None:
            setattr(state, attribute, code)
    area = request.code(ModalGroup.WORKING_AREA)
    if area is not None:
        state.is_area_limited = area == "WALIMON"
    acceleration = request.code(ModalGroup.ACCELERATION)
    if acceleration is not None and acceleration != state.acceleration:
        state.acceleration = acceleration
        outlet.put(canon.SetJerkLimit(request.block.line, request.block.number, acceleration == "SOFT"))
    _path_mode(request, state, outlet)


def _path_mode(request: Request, state: State, outlet: Outlet) -> None:
    factor = INCH_MM if state.is_inch else 1.0
    distance, tolerance = request.take("ADIS"), request.take("CTOL")
    if distance is not None and distance < 0.0:
        raise ControlAlarm(AlarmNumber.VALUE_OUT_OF_RANGE, f"ADIS={distance:g} is no distance; 0 or more is expected")
    if distance is not None:
        state.rounding_distance_mm = distance * factor
    if tolerance is not None:
        state.contour_tolerance_mm = tolerance * factor if tolerance >= 0 else None
    code = request.code(ModalGroup.PATH_MODE)
    changes = (distance is not None and state.path_mode == "G641") or (
        tolerance is not None and state.path_mode not in ("G60", "G64", "G641")
    )
    if code is None and not changes:
        return
    state.path_mode = code or state.path_mode
    mode = _MODES.get(state.path_mode, canon.PathMode.ROUNDING_TOLERANCE)
    by_mode = {
        canon.PathMode.ROUNDING_DISTANCE: state.rounding_distance_mm,
        canon.PathMode.ROUNDING_TOLERANCE: state.contour_tolerance_mm,
    }
    outlet.put(canon.SetPathMode(request.block.line, request.block.number, mode, by_mode.get(mode)))


def set_feed(request: Request, state: State) -> None:
    """Feed type and F; a new type forgets the feed. Raises ControlAlarm for an F that is none."""
    feed_type = request.code(ModalGroup.FEED_TYPE)
    if feed_type is not None and feed_type != state.feed_type:
        state.feed_type, state.feed = feed_type, None
    if request.code(ModalGroup.ONE_SHOT) == "G4":
        return
    feed = request.take("F")
    if feed is None:
        if state.feed_type == "G93":
            state.feed = None
        return
    if feed <= 0:
        raise ControlAlarm(AlarmNumber.NO_FEED, f"F{feed:g} is no feed; a value above 0 is expected")
    state.feed = feed
