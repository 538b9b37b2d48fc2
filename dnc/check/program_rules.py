"""Rules over the program as a whole: header, end, stamp, air moves, runs of spline blocks."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from dnc.check.finding import Finding, Severity
from dnc.check.limits import Limits
from dnc.check.track import Track
from planner.post.stamp import Stamp

EndRule = Callable[[Track], Iterator[Finding]]


def missing_end(track: Track) -> Iterator[Finding]:
    """No M30, M2 or M17; one that a jump or an alarm kept from being reached counts."""
    if track.end_line is None and not track.has_end_word:
        yield Finding(
            "no-end",
            Severity.ERROR,
            track.lines,
            1,
            "the program has no end",
            "the control waits for more blocks with the tool where it is",
            "write M30 as the last block",
        )


def last_block_end(track: Track, last_byte: bytes) -> Iterator[Finding]:
    """No end of line behind the last block, which ends with this byte; a closing % needs none."""
    if last_byte in (b"", b"\n", b"\r", b"%"):
        return
    yield Finding(
        "no-last-end",
        Severity.WARNING,
        track.lines,
        1,
        "the last block has no end of line",
        "a control that is fed waits for it and never runs this block",
        "add an end of line",
    )


def after_end(track: Track) -> Iterator[Finding]:
    """Blocks after the end."""
    if track.end_line is not None and track.after_end_line is not None:
        yield Finding(
            "after-end",
            Severity.WARNING,
            track.after_end_line,
            1,
            f"a block stands after the end in line {track.end_line}",
            "the control does not run it, or takes it for the next program",
            "delete it, or move the end",
        )


def header(track: Track) -> Iterator[Finding]:
    """No name in tape format."""
    if track.limits.profile.control.dialect != "sinumerik" or track.header_kind == "header":
        return
    what = "the header is a comment" if track.header_kind == "comment" else "the program has no header"
    yield Finding(
        "no-header",
        Severity.NOTE,
        1,
        1,
        what,
        "in tape format the control files the program under the name after %",
        "write %_N_NAME_MPF as the first line",
    )


def stray_percent(track: Track) -> Iterator[Finding]:
    """A lone % after the first line."""
    if track.stray_percent_line is not None:
        yield Finding(
            "stray-percent",
            Severity.NOTE,
            track.stray_percent_line,
            1,
            "a lone % stands in the program",
            "a SINUMERIK takes % for the start of the next file",
            "delete it",
        )


def feed_in_air(track: Track) -> Iterator[Finding]:
    """Feed moves at or above the height that rapids use."""
    if track.air_line is not None and track.idle_moves and 0.0 < 0.05 * track.cut_mm < track.air_mm:
        yield Finding(
            "feed-in-air",
            Severity.NOTE,
            track.air_line,
            1,
            f"{track.air_moves} feed moves run {track.air_mm:.0f} mm in air, beside {track.cut_mm:.0f} mm of cutting",
            "the tool goes there as slowly as in the material",
            "write retracts and traverses with G0",
        )


def not_checked(line: int) -> Iterator[Finding]:
    """The check of motions ends here: too much was refused."""
    yield Finding(
        "not-checked",
        Severity.WARNING,
        line,
        1,
        "motions after this alarm were not checked",
        "too many blocks were refused before",
        "mend it and check again",
    )


def wrong_stamp(stamp: Stamp, line: int, limits: Limits) -> Iterator[Finding]:
    """A program made for another control, or for the other reference point of the ball."""
    control = limits.profile.control
    family = stamp.control.partition("-")[0]
    if family != control.dialect:
        yield Finding(
            "stamp-control",
            Severity.ERROR,
            line,
            1,
            f"the program was written for {stamp.control}",
            f"the profile's control reads {control.dialect}",
            "plan it again for this control, or name its profile",
        )
    if stamp.reference != control.tool_length_reference:
        yield Finding(
            "stamp-reference",
            Severity.ERROR,
            line,
            1,
            f"the program drives the ball's {stamp.reference}, "
            f"tools here are measured to the {control.tool_length_reference}",
            f"every point would be wrong by the radius, {stamp.radius_mm:g} mm",
            "plan it again with the other reference",
        )


END_RULES: tuple[EndRule, ...] = (missing_end, after_end, header, stray_percent, feed_in_air)
