"""Codes: the canonical spelling of what a word commands, `G1` for `G01`, `POLY` for `poly`."""

from __future__ import annotations

from planner.gcode.modal import GROUP_OF
from planner.gcode.words import Word

CODE_ADDRESSES = frozenset("GM")

SPLINE_CODES = frozenset({"ASPLINE", "BSPLINE", "CSPLINE"})


def code_of(word: Word) -> str | None:
    """The code a word commands, or None for a word that carries a dimension, a value or a call.

    >>> code_of(Word("G", 1.0, "01")), code_of(Word("POLY")), code_of(Word("X", 5.0, "5")), code_of(Word("M", 6.0))
    ('G1', 'POLY', None, 'M6')
    """
    if word.address in CODE_ADDRESSES:
        number = word.number
        if number is None:
            return None
        return f"{word.address}{int(number)}" if number == int(number) else f"{word.address}{number:g}"
    if word.value is None and word.arguments is None and word.address in GROUP_OF:
        return word.address
    return None
