"""R parameters at a restart: which only count, and which the run before may have left otherwise than they were."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from functools import cached_property

from dnc.branches import Branches
from dnc.called import TEXTS, named_programs
from sim.interpreter.run import Interpreter
from sim.interpreter.settings import Settings

_COUNTING = re.compile(
    rb"(?<![A-Z_$])R(\d+)[ \t]*=[ \t]*R(\d+)[ \t]*[-+][ \t]*(?:\d+\.?\d*|\.\d+)"
    rb"(?=[ \t\r]*(?:$|;)|[ \t]*(?!DIV|MOD|AND|OR|XOR|B_|EX)[A-Z])",
    re.MULTILINE | re.IGNORECASE,
)
"""One step of a counter, with nothing behind the number that goes on with the sum: a word of its own, or the end."""
_LOOP = re.compile(rb"(?<![A-Z_])FOR(?![A-Z_]).*", re.IGNORECASE)
_PARAMETER = re.compile(rb"(?<![A-Z_])R[ \t]*(\[|\d+)", re.IGNORECASE)

_ASSIGNED = re.compile(rb"(?<![A-Z_$])R(\d+)[ \t]*=(?!=)", re.IGNORECASE)
_READ = re.compile(rb"(?<![A-Z_$])R[ \t]*(\[|\d+)(?![\d]|[ \t]*=(?!=))", re.IGNORECASE)


def counters_of(data: bytes, settings: Settings | None = None) -> frozenset[int]:
    r"""R parameters that a program only counts up or down, in blocks of their own or beside other words.

    What else uses one is looked for in it and in the subprograms that it names.

    >>> sorted(counters_of(b"R5=R5+1\nN7 R99=R99+1 M5 ; R99 parts\nX=R5\nR3=R3+1*2"))
    [99]
    """
    if _COUNTING.search(data) is None:
        return frozenset()
    counted, used = _counted_and_used(data)
    try:
        for text in named_programs(data, settings):
            used |= _counted_and_used(text)[1]
    except OSError:
        return frozenset()  # what cannot be read may use any of them
    return frozenset() if b"[" in used else frozenset(counted - {int(number) for number in used})


class FirstRun:
    """A program that has run before, from its start; by which R parameters it may have left otherwise than they were.

    A run tells which; where it branches, the control's own values may lead another way: there what stands in the text.
    """

    def __init__(self, data: bytes, settings: Settings | None) -> None:
        self._data, self._settings = data, settings

    def changed(self, offset_bytes: int, restored: Collection[int]) -> str | None:
        """An R parameter that was the control's own up to here, is read behind and set behind that, or None."""
        if _PARAMETER.search(self._data, offset_bytes) is None:
            return None
        perhaps = _perhaps_changed(self._data[offset_bytes:]).difference(restored)
        lost = (self._read_and_set | perhaps) - self._counters
        return f"R{min(lost)}" if lost else None

    @cached_property
    def _counters(self) -> frozenset[int]:
        return counters_of(self._data, self._settings)

    @cached_property
    def _read_and_set(self) -> set[int]:
        """What the run reads before it sets it."""
        interpreter = Interpreter(self._settings)
        for line, raw in enumerate(lines_of(self._data), 1):
            interpreter.block(raw.rstrip(b"\r\n"), line)
        variables = interpreter.variables
        return {int(name[1:]) for name in variables.unset_read} & variables.r.keys()


def _perhaps_changed(data: bytes) -> set[int]:
    """What a text that branches may read before it sets it; nothing where all of its blocks run as they stand."""
    branches = Branches(b"\n", 0)
    branches.feed(data)
    branches.close()
    if branches.first_at is None:
        return set()
    surely_set: set[int] = set()
    read: set[int] = set()
    changed: set[int] = set()
    at, is_computed = 0, False
    for raw in lines_of(data):
        text = TEXTS.sub(b"", raw)
        if b"R" in text.upper():
            assigned = {int(number) for number in _ASSIGNED.findall(text)}
            read |= {int(number) for number in _READ.findall(text) if number != b"["} - surely_set
            changed |= assigned
            is_computed = is_computed or b"[" in _READ.findall(text)
            if at < branches.first_at:
                surely_set |= assigned - read
        at += len(raw)
    return read | changed if is_computed else read & changed


def lines_of(data: bytes, start: int = 0) -> Iterator[bytes]:
    """Lines with their ends from this offset on, as the control takes them: LF ends a block."""
    while start < len(data):
        stop = data.find(b"\n", start) + 1 or len(data)
        yield data[start:stop]
        start = stop


def _counted_and_used(data: bytes) -> tuple[set[int], set[bytes]]:
    """The parameters that a text counts, and those that it writes or reads otherwise (`[`: by a number computed)."""
    counted: set[int] = set()

    def without(step: re.Match[bytes]) -> bytes:
        if int(step[1]) != int(step[2]):
            return step[0]
        counted.add(int(step[1]))
        return b" "

    text = TEXTS.sub(b"", data)
    loops = set(_PARAMETER.findall(b"\n".join(_LOOP.findall(text))))
    return counted, loops | set(_PARAMETER.findall(_COUNTING.sub(without, text)))
