"""Rules over raw lines: marks of other encodings, control bytes, characters outside the set, lines too long."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from dnc.check.finding import Finding, Severity
from dnc.check.limits import Limits
from dnc.framing import CHARACTER_SETS
from planner.gcode import DIALECTS

LineRule = Callable[[bytes, int, Limits], Iterator[Finding]]

UTF8_MARK = b"\xef\xbb\xbf"
UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
_MARKS = {UTF8_MARK: "a UTF-8 byte order mark", **dict.fromkeys(UTF16_MARKS, "UTF-16 text")}
_HEIDENHAIN = re.compile(rb"\s*(?:0\s+)?BEGIN PGM\b", re.IGNORECASE)
_CONTROL = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_CONTROL_NAMES = {
    0x00: "NUL",
    0x04: "EOT",
    0x11: "DC1 (XON)",
    0x12: "DC2",
    0x13: "DC3 (XOFF)",
    0x14: "DC4",
    0x1A: "SUB",
}


def encoding_mark(raw: bytes, line: int, limits: Limits) -> Iterator[Finding]:
    """A byte order mark or UTF-16 at the very start."""
    del limits
    for mark, what in _MARKS.items():
        if line == 1 and raw.startswith(mark):
            yield Finding(
                "encoding",
                Severity.ERROR,
                1,
                1,
                f"the file starts with {what}",
                "the control takes these bytes for characters of the first block",
                "save it as plain ASCII",
            )


def control_byte(raw: bytes, line: int, limits: Limits) -> Iterator[Finding]:
    """Bytes that act on the line, such as DC3 in a comment."""
    del limits
    for found in _CONTROL.finditer(raw.rstrip(b"\r\n")):
        byte = found.group()[0]
        yield Finding(
            "control-byte",
            Severity.ERROR,
            line,
            found.start() + 1,
            f"{_CONTROL_NAMES.get(byte, 'control byte')} 0x{byte:02X} stands in the program",
            "on the line it acts as a signal, not as a character",
            "remove it",
        )
        return


def foreign_character(raw: bytes, line: int, limits: Limits) -> Iterator[Finding]:
    """Characters that the profile's set does not hold."""
    name = limits.profile.tape.character_set
    bad = _CONTROL.sub(b"", raw.removeprefix(UTF8_MARK)).translate(None, CHARACTER_SETS[name])
    if bad:
        yield Finding(
            "character",
            Severity.ERROR,
            line,
            raw.index(bad[:1]) + 1,
            f"{bad[:1].decode('latin-1')!r} is not in the character set {name}",
            "the control may read another character or stop",
            "write it with letters of that set",
        )


def bare_return(raw: bytes, line: int, limits: Limits) -> Iterator[Finding]:
    """CR without LF: the control, which ends blocks by LF, reads on."""
    del limits
    column = raw.rstrip(b"\r\n").find(b"\r") + 1
    if column:
        yield Finding(
            "line-end",
            Severity.ERROR,
            line,
            column,
            "a CR stands without LF",
            "the control ends blocks by LF and takes this one and the next for one",
            "save the program with line ends LF or CR LF",
        )


def other_control(raw: bytes, line: int, limits: Limits) -> Iterator[Finding]:
    """A conversational HEIDENHAIN program, told by its head."""
    if limits.profile.control.dialect == "sinumerik" and _HEIDENHAIN.match(raw):
        yield Finding(
            "wrong-dialect",
            Severity.ERROR,
            line,
            1,
            "the program is written for a HEIDENHAIN",
            "a SINUMERIK reads none of its blocks",
            "write it anew for this control",
        )


def long_line(raw: bytes, line: int, limits: Limits) -> Iterator[Finding]:
    """Blocks longer than the control reads."""
    most = DIALECTS[limits.profile.control.dialect].max_block_characters
    size = len(raw.rstrip(b"\r\n")) + 1
    if size > most:
        yield Finding(
            "long-line",
            Severity.ERROR,
            line,
            most,
            f"the block has {size} characters, the control reads {most}",
            "what stands beyond is lost or stops the program",
            "break the block up",
        )


def is_clean(raw: bytes, line: int, limits: Limits) -> bool:
    """Whether no rule of this file can find anything, told quickly."""
    control, name = limits.profile.control, limits.profile.tape.character_set
    most = DIALECTS[control.dialect].max_block_characters
    is_one_line = raw.find(b"\r", 0, -2) < 0
    return line > 1 and is_one_line and len(raw) < most and not raw.translate(None, CHARACTER_SETS[name])


def allowed_lines(text: bytes, starts: NDArray[np.int64], limits: Limits) -> NDArray[np.bool_]:
    """Which lines hold only characters of the profile's set; `starts` (lines + 1,) are their places in `text`."""
    characters = CHARACTER_SETS[limits.profile.tape.character_set]
    found = np.ones(len(starts) - 1, dtype=np.bool_)
    if text.translate(None, characters):
        is_foreign = np.ones(256, dtype=np.bool_)
        is_foreign[list(characters)] = False
        places = np.flatnonzero(is_foreign[np.frombuffer(text, dtype=np.uint8)])
        found[np.searchsorted(starts, places, side="right") - 1] = False
    return found


LINE_RULES: tuple[LineRule, ...] = (
    encoding_mark,
    control_byte,
    foreign_character,
    bare_return,
    long_line,
    other_control,
)
