"""Cutting a program to the control's memory: parts that end where the tool stands clear, each complete in itself."""

from __future__ import annotations

import re
from dataclasses import dataclass

from dnc.errors import InputRejected
from dnc.preamble import Heights, retract_blocks
from dnc.restart import RestartPoint, clear_points, why_none_is_clear
from sim.interpreter import canon
from sim.interpreter.alarms import AlarmNumber
from sim.interpreter.run import interpret
from sim.interpreter.settings import Settings

_HEADER = re.compile(rb"^%_N_([A-Za-z0-9_]+)_(MPF|SPF)[ \t]*$")
_KEPT_COMMENTS = (b";$PATH=", b";DRIPMILL ")
_JUMPS = re.compile(rb"GOTO|REPEAT|CALL[ \t]+BLOCK", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Part:
    """One part: its bytes, and the lines of the whole program it holds (first and last, from 1)."""

    data: bytes
    first_line: int
    last_line: int


def split_program(data: bytes, most_bytes: int, heights: Heights, settings: Settings | None = None) -> list[Part]:
    """Parts of at most `most_bytes` bytes; every part but the first begins with a preamble that restores its state.

    Cuts lie before blocks that begin at or above the clearance height. Raises InputRejected where the blocks between
    two such places do not fit, where a jump would need a label that another part holds, and where nothing but CR
    divides them.
    """
    parts = _cut(data, most_bytes, heights, settings)
    if len(parts) > 1 and _JUMPS.search(data):
        _require_jumps(data, parts, settings)
    return parts


def _cut(data: bytes, most_bytes: int, heights: Heights, settings: Settings | None) -> list[Part]:
    last_line = data.count(b"\n") + (not data.endswith(b"\n"))
    if len(data) <= most_bytes:
        return [Part(data, 1, last_line)]
    if b"\n" not in data.rstrip():
        raise InputRejected(
            "the program has no LF between its blocks, so that the control takes all of it for one",
            remedy="end blocks by LF or CR LF",
        )
    places = list(clear_points(data, heights, settings))
    parts: list[Part] = []
    begin: RestartPoint | None = None
    while True:
        opening, body_at = _opening(data, begin, len(parts) + 1)
        first_line = begin.line if begin else 1
        if len(opening) + len(data) - body_at <= most_bytes:
            return [*parts, Part(opening + data[body_at:], first_line, last_line)]
        room = most_bytes - len(opening)
        reachable = [place for place in places if body_at < place.offset_bytes <= body_at + room]
        end = next(
            (
                place
                for place in reversed(reachable)
                if place.offset_bytes - body_at + len(_closing(heights, place)) <= room
            ),
            None,
        )
        if end is None:
            why = why_none_is_clear(data, (body_at, body_at + room), heights, settings)
            raise _too_large(first_line, most_bytes, why)
        body = data[body_at : end.offset_bytes] + _closing(heights, end)
        parts.append(Part(opening + body, first_line, end.line - 1))
        begin = end


def _too_large(first_line: int, most_bytes: int, why: str | None) -> InputRejected:
    """No place to cut within reach; `why` the last one that stands clear is none."""
    what = f"the blocks from line {first_line} on do not fit into {most_bytes} bytes up to the next clear place"
    if why is not None:
        return InputRejected(f"{what}; {why}", remedy="allow larger parts, or mend that")
    return InputRejected(what, remedy="allow larger parts, or plan with a coarser tolerance")


def _require_jumps(data: bytes, parts: list[Part], settings: Settings | None) -> None:
    """Run every part by itself: a jump back over a cut stops the control in the middle of the work, or is not made."""
    cut = 0
    remedy = "allow parts so large that a jump and its label stay together"
    for number, part in enumerate(parts, 1):
        for command in interpret(part.data, settings):
            if isinstance(command, canon.Alarm) and command.number == AlarmNumber.JUMP_TARGET:
                where = f"part {number}, lines {part.first_line} to {part.last_line} of the program"
                raise InputRejected(
                    f"{where}, would stop with alarm {command.number}: {command.text}",
                    remedy=remedy,
                )
            cut += _is_cut(command)
    whole = sum(_is_cut(command) for command in interpret(data, settings))
    if cut != whole:
        raise InputRejected(
            f"the program makes {whole} moves at feed, its parts {cut}: a jump crosses a cut", remedy=remedy
        )


def _is_cut(command: canon.Command) -> bool:
    return isinstance(command, canon.Motion) and not isinstance(command, canon.Rapid)


def _opening(data: bytes, begin: RestartPoint | None, number: int) -> tuple[bytes, int]:
    """What stands before the blocks of a part, and where those begin in the program."""
    head = data[:4096].splitlines()
    found = _HEADER.match(data[:4096].partition(b"\n")[0].rstrip(b"\r"))
    header = [b"%%_N_%s_%d_%s" % (found[1], number, found[2])] if found else []
    if begin is None:
        return b"".join(line + b"\n" for line in header), data.index(b"\n") + 1 if found else 0
    kept = [line for line in head if line.startswith(_KEPT_COMMENTS)]
    preamble = [text.encode("ascii") for text in begin.preamble]
    return b"".join(line + b"\n" for line in [*header, *kept, *preamble]), begin.offset_bytes


def _closing(heights: Heights, end: RestartPoint) -> bytes:
    """How a part ends: up, coolant and spindle off, away, end."""
    spelling = end.spelling(heights)
    up = f"G0 Z{spelling.height(heights.above(end.lift_mm).safe_z_mm)}"
    blocks = [f"G40 {end.unit_code} G90", up, "M9", "M5", *retract_blocks(heights, spelling), "M30"]
    return "".join(f"{block}\n" for block in blocks).encode("ascii")
