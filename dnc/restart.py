"""A safe restart of an interrupted program, computed from its blocks alone: where to begin, and the preamble before it.

Where no preamble restores what earlier blocks left behind (inside a spline, under G41 or G42) the restart is refused,
naming the nearest block before it that can be restored.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from dnc.called import leads_away, may_lean
from dnc.errors import InputRejected
from dnc.obstacles import obstacle_of
from dnc.parameters import FirstRun, counters_of, lines_of
from dnc.preamble import Heights, Spelling, lift_of, preamble_blocks, unit_code
from dnc.whereabouts import Whereabouts, dimensions, names
from planner.gcode import GROUP_OF, Block, ModalGroup, SyntaxProblem, code_of, read_block, value_text
from sim.interpreter import canon
from sim.interpreter.frames import ORIGIN
from sim.interpreter.mapping import mapping_of
from sim.interpreter.run import Interpreter, interpret
from sim.interpreter.settings import Settings
from sim.interpreter.state import INCH_MM, State

_OPTIONAL = re.compile(rb"^[ \t\r]*(?:[N:][ \t]*\d+[ \t]*)?/", re.MULTILINE | re.IGNORECASE)
_PLACES_TRIED = 50
_GEOMETRY = frozenset({"X", "Y", "Z", "PO"})
_STAYING = frozenset({"G", "M", "S", "T", "D", "F", "H", "MSG"})
"""Addresses of blocks that surely move nothing where no code of _ELSEWHERE stands beside them."""
_ELSEWHERE = frozenset({ModalGroup.FRAME, ModalGroup.SUPPRESSION, ModalGroup.ONE_SHOT})


@dataclass(frozen=True, slots=True)
class RestartPoint:
    """The block to go on with and what must run before it.

    `line` counts from 1, `offset_bytes` is where the block begins in the program, `position_mm` where the tool must
    stand when it begins (canonical work coordinates). `preamble` are blocks without line ends. `is_inch` is the unit of
    the program at this place, `lift_mm` what heights are above the job's here.
    """

    line: int
    block: int | None
    offset_bytes: int
    position_mm: canon.Vector
    preamble: tuple[str, ...]
    is_inch: bool
    lift_mm: float = 0.0

    def spelling(self, heights: Heights) -> Spelling:
        """How numbers are written here."""
        return Spelling(INCH_MM if self.is_inch else 1.0, heights.decimals)

    @property
    def unit_code(self) -> str:
        """The code under which dimensions and feeds are read in that unit."""
        return unit_code(is_inch=self.is_inch)


@dataclass(frozen=True, slots=True)
class _Place:
    """A block and what stands before it: the state, R parameters by number, and why no restart can begin here.

    `untold` are the axes that stand where the operator left them.
    """

    line: int
    number: int | None
    offset_bytes: int
    state: State
    parameters: dict[int, float]
    obstacle: str | None
    untold: frozenset[int]


def restart_at_number(data: bytes, number: int, heights: Heights, settings: Settings | None = None) -> RestartPoint:
    """The restart before block N`number`; raises InputRejected if it is missing, stands twice or cannot be restored."""
    return restart_at_line(data, line_of_number(data, number, settings), heights, settings)


def line_of_number(data: bytes, number: int, settings: Settings | None = None) -> int:
    """The line of block N`number`; raises InputRejected if it is missing, not reached or stands twice."""
    found = [place.line for place in _places(data, settings) if place.number == number]
    if not found:
        raise _unreachable(f"block N{number}", data, settings)
    if len(found) > 1:
        what = f"N{number} stands {len(found)} times"
        raise InputRejected(what, remedy="name a line instead, or the number of a pass start")
    return found[0]


def restart_at_line(data: bytes, line: int, heights: Heights, settings: Settings | None = None) -> RestartPoint:
    """The restart before physical line `line`; raises InputRejected if it is not there or cannot be restored."""
    for place in _places(data, settings):
        if place.line == line:
            return _restart_after_stop(data, place, heights, settings or Settings())
    raise _unreachable(f"line {line}", data, settings)


def clear_points(data: bytes, heights: Heights, settings: Settings | None = None) -> Iterator[RestartPoint]:
    """Where passes end: every block before which the tool, called, has come to stand at or above the clearance."""
    used = settings or Settings()
    was_clear = False
    for place in _places(data, settings):
        is_clear = _is_pass_end(place, heights, used) and _obstacle_at(data, place, heights, used) is None
        if is_clear and not was_clear:
            yield _restart(data, place, heights, used)
        was_clear = is_clear


def why_none_is_clear(
    data: bytes, between_bytes: tuple[int, int], heights: Heights, settings: Settings | None = None
) -> str | None:
    """Why the last place that stands clear between these two offsets is no clear point; None if there is none."""
    used, why = settings or Settings(), None
    for place in _places(data, settings):
        if between_bytes[0] < place.offset_bytes <= between_bytes[1] and _is_pass_end(place, heights, used):
            obstacle = _obstacle_at(data, place, heights, used)
            why = why if obstacle is None else f"line {place.line}: {obstacle}"
    return why


def _is_pass_end(place: _Place, heights: Heights, settings: Settings) -> bool:
    state = place.state
    return bool(state.tool or state.tool_name) and state.motion == "G0" and _is_clear(state, heights, settings)


def _is_clear(state: State, heights: Heights, settings: Settings) -> bool:
    height_mm = _programmed(state, settings)[2]
    return heights.above(lift_of(state)).is_clear(height_mm)


def _programmed(state: State, settings: Settings) -> canon.Vector:
    """Where the axes stand in the program's coordinates, mm."""
    return mapping_of(state, settings, is_suppressed=False).inverse_point(state.position_mm)


def _last_safe_line(data: bytes, line: int, heights: Heights, settings: Settings) -> int | None:
    """The last line up to `line` at which a restart can be computed and begin; None if the nearest few are none."""
    near: deque[_Place] = deque(maxlen=_PLACES_TRIED)
    for place in _places(data, settings):
        if place.line > line:
            break
        if _obstacle_at(data, place, heights, settings) is None:
            near.append(place)
    run = FirstRun(data, settings)
    return next((one.line for one in reversed(near) if run.changed(one.offset_bytes, one.parameters) is None), None)


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


def _restart(data: bytes, place: _Place, heights: Heights, settings: Settings) -> RestartPoint:
    state, obstacle = place.state, _obstacle_at(data, place, heights, settings)
    if obstacle is not None:
        safe = _last_safe_line(data, place.line, heights, settings)
        remedy = f"restart at line {safe}" if safe is not None else _from_its_start(FirstRun(data, settings))
        raise InputRejected(f"line {place.line}: {obstacle}", remedy=remedy)
    parameters = [f"R{number}={value_text(value)}" for number, value in sorted(place.parameters.items())]
    preamble = (*parameters, *preamble_blocks(state, heights, settings, place.untold))
    return RestartPoint(
        place.line, place.number, place.offset_bytes, state.position_mm, preamble, state.is_inch, lift_of(state)
    )


def _restart_after_stop(data: bytes, place: _Place, heights: Heights, settings: Settings) -> RestartPoint:
    """As `_restart`, where the program has run on from this place before and may have left other R parameters."""
    point = _restart(data, place, heights, settings)
    run = FirstRun(data, settings)
    lost = run.changed(place.offset_bytes, place.parameters)
    if lost is not None:
        what = f"line {place.line}: {lost} is read behind it before the program sets it, and may be changed by now"
        raise InputRejected(what, remedy=_from_its_start(run))
    return point


def _from_its_start(run: FirstRun) -> str:
    """What to do where no restart can begin."""
    lost, again = run.changed(0, ()), "run the program from its start"
    return again if lost is None else f"set {lost} by hand to what it was, and {again}"


def _obstacle_at(data: bytes, place: _Place, heights: Heights, settings: Settings) -> str | None:
    """Why no restart can begin at this place: what stands before it, or a first move that needs what went before."""
    if place.obstacle is not None:
        return place.obstacle
    state = place.state
    motion, start, dimension = state.motion, state.spline_start, state.dimension
    is_told, is_sure = not place.untold, 2 not in place.untold and _is_clear(state, heights, settings)
    standing = _programmed(state, settings)
    for raw in lines_of(data, place.offset_bytes):
        block = _read(raw)
        codes = {GROUP_OF.get(code): code for code in map(code_of, block.words if block else ()) if code}
        motion = codes.get(ModalGroup.MOTION, motion)
        start = codes.get(ModalGroup.SPLINE_START, start)
        dimension = codes.get(ModalGroup.DIMENSION, dimension)
        if block is None or ModalGroup.FRAME in codes or all(word.address not in _GEOMETRY for word in block.words):
            is_sure = is_sure and block is not None and _stays(block, codes)
        else:
            if motion == "CT" or (motion in ("ASPLINE", "CSPLINE") and start == "BTAN"):
                return f"{motion} takes its direction from the move before"
            is_sure = is_sure and block.skip_level is None and _ELSEWHERE.isdisjoint(codes)
            is_aside = (motion, dimension) == ("G0", "G90") and all(word.address != "Z" for word in block.words)
            is_told = is_told or (is_sure and is_aside and place.untold <= dimensions(block))
            is_sure = False
            if motion not in ("G0", "G1") or _moves_surely(block, dimension, standing, is_inch=state.is_inch):
                break
        if block is not None and leads_away(block):
            if motion in ("CT", "ASPLINE", "CSPLINE") or may_lean(data[place.offset_bytes :], settings):
                return (
                    "the first move behind a branch or a call may be one that takes its direction from the one before"
                )
            break
    return None if is_told else f"where {names(place.untold)} stands is not said before, and only the control knows it"


def _moves_surely(block: Block, dimension: str, standing_mm: canon.Vector, *, is_inch: bool) -> bool:
    """Whether a straight block leads elsewhere than where the axes stand, which gives what follows a direction."""
    unit_mm = INCH_MM if is_inch else 1.0
    before_mm = standing_mm if dimension == "G90" else ORIGIN
    named = {word.address: word.value for word in block.words if isinstance(word.value, float)}
    return any(
        abs(named.get(name, at / unit_mm) * unit_mm - at) > 1e-9 for name, at in zip("XYZ", before_mm, strict=True)
    )


def _stays(block: Block, codes: Mapping[ModalGroup | None, str]) -> bool:
    """Whether this block surely moves nothing and is followed by the next."""
    is_known = all(word.address in _STAYING or word.address in GROUP_OF for word in block.words)
    return block.statement is None and is_known and (_ELSEWHERE.isdisjoint(codes) or "G4" in codes.values())


def _places(data: bytes, settings: Settings | None) -> Iterator[_Place]:
    """Every line with the state before it, until the control would stop."""
    interpreter, counters = Interpreter(settings), counters_of(data, settings)
    are_offsets_known = settings is not None and bool(settings.work_offsets_mm)
    whereabouts = Whereabouts(are_offsets_known=are_offsets_known, counters=counters)
    offset = 0
    for line, raw in enumerate(lines_of(data), 1):
        state = interpreter.state
        if state.is_ended:
            return
        parameters = {number: value for number, value in interpreter.variables.r.items() if number not in counters}
        obstacle = obstacle_of(interpreter) or whereabouts.obstacle
        block = _read(raw)
        yield _Place(line, block.number if block else None, offset, state, parameters, obstacle, whereabouts.untold)
        commands = interpreter.block(raw.rstrip(b"\r\n"), line)
        is_run = not interpreter.is_in_structure
        whereabouts.note(block, commands, state.work_offset, interpreter, is_run=is_run)
        offset += len(raw)


def _read(raw: bytes) -> Block | None:
    try:
        return read_block(raw.decode("latin-1"))
    except SyntaxProblem:
        return None
