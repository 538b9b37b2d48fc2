"""Rules over canonical commands: what the tool would really do, freed of modality.

Without a job the part is known only from the program itself: the lowest height that a rapid reached counts as clear of
it, and what was cut below counts as part.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from dnc.check import moves
from dnc.check.finding import Finding, Severity
from dnc.check.track import Track
from sim.interpreter import canon
from sim.interpreter.tangents import bounds, extent
from sim.interpreter.vocabulary import NOT_MODELLED

CommandRule = Callable[[canon.Command, Track], Iterator[Finding]]

_FEEDS = (canon.Line, canon.Arc, canon.Polynomial)
_AXES = ("X", "Y", "Z")
_PLUNGE_SHARE = 0.5  # of the feed of the cut


def alarm(command: canon.Command, track: Track) -> Iterator[Finding]:
    """What the control refuses."""
    if isinstance(command, canon.Alarm):
        is_jump = command.number == track.limits.profile.control.backward_jump_alarm
        name = "jump" if is_jump else ALARM_IDS.get(command.number, "alarm")
        text, _, remedy = command.text.partition("; ")
        reason = f"the control stops here with alarm {command.number}"
        if text.endswith(NOT_MODELLED):
            reason = f"what it does is not checked; the virtual mill stops here with alarm {command.number}"
        yield Finding(
            name,
            Severity.ERROR,
            command.line,
            command.column or 1,
            text,
            reason,
            remedy or "mend the block",
        )


ALARM_IDS = {
    12080: "syntax", 12060: "group-twice", 12470: "unknown-word", 12550: "unknown-word",
    12110: "unknown-word", 14011: "missing-subprogram", 14040: "arc-open", 10860: "no-feed",
    10810: "no-spindle", 14290: "spline", 14750: "unknown-word", 10730: "axis-limit",
}  # fmt: skip


def rapid_z_and_xy(command: canon.Command, track: Track) -> Iterator[Finding]:
    """A rapid that moves Z together with X or Y."""
    if not isinstance(command, canon.Rapid) or command.is_machine or not track.is_height_known:
        return
    if moves.moves_xy(command) and command.start[2] != command.end[2]:
        yield Finding(
            "rapid-z-and-xy",
            Severity.WARNING,
            command.line,
            1,
            "the rapid moves Z together with X or Y",
            "axes arrive one after the other, the way between is not defined",
            "move Z alone, then X and Y",
        )


def rapid_below(command: canon.Command, track: Track) -> Iterator[Finding]:
    """A rapid that ends below the clearance, or no higher than the program cuts, but for a hole just made."""
    if not isinstance(command, canon.Rapid) or command.is_machine or not track.is_height_known:
        return
    low_mm = min(command.start[2], command.end[2]) if moves.moves_xy(command) else command.end[2]
    given = track.limits.clearance_z_mm
    if given is not None:
        is_low, where = low_mm < given - track.limits.touch_mm, f"below the clearance at Z {given:g}"
    else:
        is_low = low_mm <= track.cut_top_mm + track.limits.touch_mm and not moves.is_into_hole(command, track.hole)
        where = f"no higher than the highest cut at Z {track.cut_top_mm:g}"
    if is_low and not moves.is_retract(command):
        yield Finding(
            "rapid-below-clearance",
            Severity.ERROR,
            command.line,
            1,
            f"the rapid runs at Z {low_mm:g}, {where}",
            "at rapid speed nothing stops in time",
            "retract first; go down with G1 and a plunge feed",
        )


def rapid_through_stock(command: canon.Command, track: Track) -> Iterator[Finding]:
    """A rapid whose axis box meets the stock: the way between its ends is not a straight line."""
    box = track.limits.stock_box_mm
    if box is None or not isinstance(command, canon.Rapid) or command.is_machine or not track.is_height_known:
        return
    if moves.is_retract(command):
        return
    low = [min(pair) for pair in zip(command.start, command.end, strict=True)]
    high = [max(pair) for pair in zip(command.start, command.end, strict=True)]
    if all(high[axis] > box[0][axis] and low[axis] < box[1][axis] for axis in range(3)):
        yield Finding(
            "rapid-through-stock",
            Severity.ERROR,
            command.line,
            1,
            "the rapid can pass through the stock",
            "the box of its ends meets the stock of the job, and rapids do not run straight",
            "retract above the stock first",
        )


def unready(command: canon.Command, track: Track) -> Iterator[Finding]:
    """Cutting with no tool called, or in the machine's own coordinates."""
    if not isinstance(command, _FEEDS) or track.cut_mm + track.air_mm > 0.0:
        return
    if track.is_readiness_lost or track.is_subprogram:
        return
    if not track.tool:
        what = "before any tool was called" if track.tool is None else "after M6 with T0, an empty spindle"
        yield Finding(
            "no-tool",
            Severity.WARNING,
            command.line,
            1,
            f"the first feed move comes {what}",
            "what is in the spindle cuts, with whatever length is active",
            "write T, M6 and D before it",
        )
    if not track.offsets:
        yield Finding(
            "no-offset",
            Severity.WARNING,
            command.line,
            1,
            "the first feed move comes before any work offset was named",
            "the control takes the one it has after reset, perhaps the machine's zero",
            "write G54 or the offset of the setup before it",
        )


def stopped_spindle(command: canon.Command, track: Track) -> Iterator[Finding]:
    """The first feed move, or a later cut, with the spindle stopped: once for a stop."""
    if track.spindle_rpm or track.is_stop_told or track.is_readiness_lost or track.is_subprogram:
        return
    is_first = track.cut_mm + track.air_mm == 0.0
    if isinstance(command, _FEEDS) and (is_first or _is_cut(command, track)):
        track.is_stop_told = True
        yield Finding(
            "no-spindle",
            Severity.ERROR,
            command.line,
            1,
            "the first feed move comes with the spindle stopped"
            if is_first
            else "a cut comes with the spindle stopped",
            "the tool breaks in the material",
            "write S and M3 before it",
        )


def no_edge(command: canon.Command, track: Track) -> Iterator[Finding]:
    """A cut while D0, meant for the way to a tool change, is still in force: once."""
    if track.edge or track.is_edge_told or not isinstance(command, _FEEDS) or not _is_cut(command, track):
        return
    track.is_edge_told = True
    yield Finding(
        "no-edge",
        Severity.WARNING,
        command.line,
        1,
        "a cut comes while D0 is in force",
        "without the tool's length the spindle goes deeper by all of it",
        "write D1, or the edge of the tool, before it goes down",
    )


def _is_cut(command: canon.Motion, track: Track) -> bool:
    return not moves.is_retract(command) and not moves.is_air(command, track.clear_z_mm)


def odd_feed(command: canon.Command, track: Track) -> Iterator[Finding]:
    """A feed that no cut has: slower than a millimetre a minute, or faster than every axis; once for each value."""
    if not isinstance(command, _FEEDS) or command.feed_mm_min == track.told_feed_mm_min:
        return
    track.told_feed_mm_min = None
    slowest, fastest = track.limits.usual_feeds_mm_min
    if slowest <= command.feed_mm_min <= fastest:
        return
    track.told_feed_mm_min = command.feed_mm_min
    is_slow = command.feed_mm_min < slowest
    yield Finding(
        "odd-feed",
        Severity.WARNING,
        command.line,
        1,
        f"the feed is {command.feed_mm_min:g} mm/min",
        "it may be meant for each turn" if is_slow else f"no axis is faster than {fastest:g} mm/min",
        "write G95 before a feed for each turn, or mend F" if is_slow else "look for a point that was lost in F",
    )


def no_dwell(command: canon.Command, track: Track) -> Iterator[Finding]:
    """The first feed move after a spindle start without a dwell between."""
    if isinstance(command, _FEEDS) and track.spindle_line is not None and track.spindle_rpm:
        yield Finding(
            "no-spindle-dwell",
            Severity.NOTE,
            track.spindle_line,
            1,
            f"no dwell between the spindle start and the first feed move in line {command.line}",
            "a control that does not wait for the speed by itself meets the material with a slow spindle",
            "write G4 F2 after M3",
        )


def reversal(command: canon.Command, track: Track) -> Iterator[Finding]:
    """A feed move in the material that runs back where the tool came from."""
    if not isinstance(command, _FEEDS) or track.is_backward or moves.is_air(command, track.clear_z_mm):
        return
    if moves.turns_back(track.direction, command):
        yield Finding(
            "reversal",
            Severity.ERROR,
            command.line,
            1,
            f"the tool runs {moves.length(command):.2f} mm backwards inside a pass",
            "a coordinate may have lost a digit; the material behind is cut again, perhaps too deep",
            "compare the block with its neighbours",
        )


def axis_limit(command: canon.Command, track: Track) -> Iterator[Finding]:
    """A move beyond the travel of an axis; with a work offset, beyond it wherever the zero point lies."""
    if not isinstance(command, (canon.Rapid, *_FEEDS)):
        return
    is_shifted = track.is_zero_shifted and not (isinstance(command, canon.Rapid) and command.is_machine)
    low, high = bounds(command)
    reaches = [track.limits.reach_mm(name, is_shifted) for name in _AXES]
    if all(least <= low[axis] and high[axis] <= most for axis, (least, most) in enumerate(reaches)):
        return
    low, high = extent(command)
    for axis, name in enumerate(_AXES):
        least_mm, most_mm = reaches[axis]
        start_mm, end_mm = command.start[axis], command.end[axis]
        outside = [at for at in (low[axis], high[axis]) if at != start_mm and not least_mm <= at <= most_mm]
        at_mm = outside[0] if outside else end_mm
        if at_mm == start_mm or least_mm <= at_mm <= most_mm:
            continue
        if is_shifted:
            what = f"{name} {at_mm:g} is farther from the zero point than the axis travels, {most_mm:g} mm"
            why, remedy = "no zero point within the travel reaches it", "look for a point or a sign that was lost"
        else:
            what = f"{name} {at_mm:g} is outside its travel {least_mm:g} to {most_mm:g}"
            why, remedy = "no work offset is at work here", "check position, work offset and profile"
        yield Finding("axis-limit", Severity.ERROR, command.line, 1, what, why, remedy)


def steep_plunge(command: canon.Command, track: Track) -> Iterator[Finding]:
    """A plunge as fast as the cut after it."""
    if not isinstance(command, _FEEDS) or track.plunge is None or not moves.moves_xy(command):
        return
    plunge = track.plunge
    if plunge.feed_mm_min > _PLUNGE_SHARE * command.feed_mm_min:
        yield Finding(
            "steep-plunge",
            Severity.WARNING,
            plunge.line,
            1,
            f"the tool plunges {plunge.start[2] - plunge.end[2]:g} mm straight down at {plunge.feed_mm_min:g} mm/min",
            f"that is more than half the feed of the cut, {command.feed_mm_min:g} mm/min; a ball's tip does not cut",
            "plunge slower, or down a ramp",
            plunge.block,
        )


_FEED_RULES: tuple[CommandRule, ...] = (
    stopped_spindle,
    unready,
    no_edge,
    no_dwell,
    odd_feed,
    reversal,
    axis_limit,
    steep_plunge,
)
COMMAND_RULES: dict[type[canon.Command], tuple[CommandRule, ...]] = {
    canon.Alarm: (alarm,),
    canon.Rapid: (rapid_z_and_xy, rapid_below, rapid_through_stock, axis_limit),
    **dict.fromkeys(_FEEDS, _FEED_RULES),
}
