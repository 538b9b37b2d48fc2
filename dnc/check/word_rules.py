"""Rules over single blocks as the reader gives them: codes, words of other dialects, empty moves, jumps."""

from __future__ import annotations

import re
from collections.abc import Iterator

from dnc.check.finding import Finding, Severity
from dnc.check.number_rules import NUMBER_RULES, BlockRule
from dnc.check.track import NAMED_TOOL, Track, is_inch, motion_code_of
from planner.gcode import GROUP_OF, Block, ModalGroup, Word, code_of
from planner.gcode.statement import Case, For, Jump, Mark, Marker, RepeatSection, Until, While

_ISO_CODES = {
    "G28": "return to the reference point", "G29": "return from the reference point", "G30": "second reference point",
    "G05": "high-speed mode", "G43": "tool length offset", "G44": "tool length offset", "G49": "tool length offset off",
    "G92": "setting of the origin", "G98": "return level of cycles", "G99": "return level of cycles",
    "G6.2": "NURBS", "G5.1": "AI contour control", "G5.2": "NURBS", "G5.3": "end of NURBS", "G20": "inches",
    "G21": "millimetres",
    "G80": "end of drilling cycles", **{f"G{number}": "a drilling cycle" for number in (73, 76, *range(81, 90))},
}  # fmt: skip
_AXES = frozenset("XYZ")
IDLE_CODES = frozenset({"G1", "G2", "G3"})
_LOOPS = (Jump, While, For, Until, Case, RepeatSection)


def other_dialect(block: Block, track: Track) -> Iterator[Finding]:
    """Codes and spellings of ISO controls in a SINUMERIK program."""
    if track.limits.profile.control.dialect != "sinumerik":
        return
    for word in block.words:
        code = _spelled(word)
        if code in _ISO_CODES:
            yield Finding(
                "wrong-dialect",
                Severity.ERROR,
                block.line,
                word.column,
                f"{code} ({_ISO_CODES[code]}) is a code of the ISO dialect",
                "a SINUMERIK stops with an alarm, or does it only in ISO mode",
                _INSTEAD.get(code, "write it in SINUMERIK's words"),
            )
        elif word.address == "O" and word.number is not None:
            yield Finding(
                "wrong-dialect",
                Severity.ERROR,
                block.line,
                word.column,
                f"O{word.text} is a program number of the ISO dialect",
                "a SINUMERIK does not know the address",
                "name the program in a header %_N_NAME_MPF",
            )


_INSTEAD = {
    "G20": "write G70", "G21": "write G71", "G28": "write it in SINUMERIK's words, such as G0 SUPA Z.. D0 or G75",
    "G43": "leave it out: D1 behind M6 takes the length", "G49": "leave it out: D0 takes the length off",
    "G80": "leave it out",
}  # fmt: skip
_ISO_COMMENT = re.compile(r"(?:^|[\s\d.])\((?=[^()]*\))")


def iso_comment(text: str, line: int) -> Iterator[Finding]:
    """A comment in round brackets, in a block that the reader could not read."""
    code = text.partition(";")[0]
    comment = None if "=" in code else _ISO_COMMENT.search(code)
    if comment is not None:
        yield Finding(
            "wrong-dialect",
            Severity.ERROR,
            line,
            comment.end(),
            "a comment in brackets is of the ISO dialect",
            "a SINUMERIK stops with an alarm",
            "begin comments with ;",
        )


def idle_words(block: Block, track: Track) -> Iterator[Finding]:
    """For a block with coordinates that moved nothing: the end is where the tool stands already."""
    if track.end_line is not None:
        return
    axes = [word for word in block.words if word.address in _AXES and word.value is not None]
    groups = {GROUP_OF.get(code_of(word) or "") for word in block.words}
    if axes and track.motion_code in IDLE_CODES and not groups & {ModalGroup.FRAME, ModalGroup.ONE_SHOT}:
        yield Finding(
            "zero-length",
            Severity.WARNING,
            block.line,
            axes[0].column,
            "the move has no length",
            "the tool stands there already; a coordinate may be wrong",
            "delete the block, or mend it",
        )


def feed_in_rapid(block: Block, track: Track) -> Iterator[Finding]:
    """F beside coordinates while rapids are in force and the block does not say so: a G1 may have been lost."""
    words = {word.address: word for word in block.words}
    is_rapid = track.motion_code == "G0" and motion_code_of(block) is None and not track.is_passed_over
    if is_rapid and "F" in words and _AXES & words.keys():
        yield Finding(
            "feed-in-rapid",
            Severity.WARNING,
            block.line,
            words["F"].column,
            "the block gives a feed and moves in rapid",
            "G0 is in force from before; a G1 may have been lost",
            "write G1, or leave F out",
        )


def empty_motion(block: Block, track: Track) -> Iterator[Finding]:
    """A motion code alone: a block without a command."""
    del track
    if len(block.words) == 1:
        code = code_of(block.words[0])
        if code is not None and GROUP_OF.get(code) is ModalGroup.MOTION and code not in ("POLY", "BSPLINE"):
            yield Finding(
                "empty-motion",
                Severity.WARNING,
                block.line,
                block.words[0].column,
                f"{code} moves nothing",
                "the block has no coordinate; one may have been lost",
                "complete it or delete the block",
            )


def unknown_radius(block: Block, track: Track) -> Iterator[Finding]:
    """G41 or G42 with a tool whose radius is not known here: once for a program."""
    for word in block.words:
        is_on = code_of(word) in ("G41", "G42")
        if is_on and not track.is_radius_told and track.tool not in track.limits.tool_radii_mm:
            track.is_radius_told = True
            tool = "the tool" if track.tool == NAMED_TOOL else f"tool T{track.tool or 0}"
            yield Finding(
                "radius-unknown",
                Severity.NOTE,
                block.line,
                word.column,
                f"the radius of {tool} is not known here",
                "the contour is checked as it is programmed, not as the tool's centre runs beside it",
                "name the job with --job",
            )


def unit_switch(block: Block, track: Track) -> Iterator[Finding]:
    """From inch to metric or back, after the first move."""
    for word in block.words:
        code = code_of(word)
        if code and GROUP_OF.get(code) is ModalGroup.UNITS and track.has_moved and is_inch(code) != track.is_inch:
            yield Finding(
                "unit-switch",
                Severity.WARNING,
                block.line,
                word.column,
                f"{code} switches the unit after the first move",
                "every coordinate after it has another size",
                "give the unit once, in the head",
            )


def jump_while_fed(block: Block, track: Track) -> Iterator[Finding]:
    """Jumps and loops: a drip-fed control no longer has, or does not yet have, the target."""
    del track
    statement = block.statement
    is_loop = isinstance(statement, _LOOPS) or (
        isinstance(statement, Mark) and statement.marker in (Marker.LOOP, Marker.REPEAT)
    )
    if is_loop:
        yield Finding(
            "jump",
            Severity.ERROR,
            block.line,
            1,
            f"{_keyword(block)} cannot be run while the program is fed",
            "the blocks it goes to are not in the control's memory",
            "write the blocks out, or load the program whole",
        )


def _keyword(block: Block) -> str:
    """The word of a jump or loop as the block spells it."""
    statement = block.statement
    match statement:
        case Jump(keyword):
            return keyword
        case Mark(marker):
            return marker.value
        case RepeatSection(is_single_block=is_single_block):
            return "REPEATB" if is_single_block else "REPEAT"
        case _:
            return type(statement).__name__.upper()


def spline_run(block: Block, track: Track) -> Iterator[Finding]:
    """At the end of a run of BSPLINE blocks: too few of them, or knot intervals in some only."""
    run, least = track.spline, track.limits.profile.control.min_spline_blocks
    ends = motion_code_of(block) not in (None, "BSPLINE")
    if run.blocks == 0 or not ends:
        return
    if run.blocks < least:
        yield Finding(
            "spline-blocks",
            Severity.WARNING,
            run.line,
            1,
            f"the spline has {run.blocks} blocks, fewer than {least}",
            "of any ten blocks the control wants at least six with spline points",
            "insert knots, or write POLY",
        )
    if run.with_length not in (0, run.blocks):
        yield Finding(
            "spline-blocks",
            Severity.ERROR,
            run.line,
            1,
            f"PL stands in {run.with_length} of {run.blocks} spline blocks",
            "what the control does with the others is not documented",
            "write PL in every block, 0 in first and last",
        )


def _spelled(word: Word) -> str | None:
    if word.address != "G":
        return None
    return "G05" if word.text in ("05", "5") else code_of(word)


BLOCK_RULES: tuple[BlockRule, ...] = (
    *NUMBER_RULES,
    other_dialect,
    empty_motion,
    feed_in_rapid,
    unknown_radius,
    unit_switch,
    jump_while_fed,
    spline_run,
)
