"""The subprograms that a program may call, by their names, and what may come first behind a call or a branch."""

from __future__ import annotations

import re
from collections.abc import Iterator

from planner.gcode import GROUP_OF, Block
from sim.interpreter.library import Library
from sim.interpreter.settings import Settings
from sim.interpreter.vocabulary import ACTED_ADDRESSES, IGNORED_ADDRESSES

TEXTS = re.compile(rb'"[^"\n]*"|;.*')
"""Texts and comments."""
_NUMBERED = re.compile(r"L0*(\d+)$")
_CALLS = frozenset({"L", "CALL", "EXTCALL"})
_OWN = (ACTED_ADDRESSES | IGNORED_ADDRESSES.keys() | GROUP_OF.keys() | {"G", "M"}) - _CALLS
_PARAMETER = re.compile(r"R\d*$")
_LEANING = re.compile(rb"(?<![A-Z_])(?:CT|[AC]SPLINE)(?![A-Z\d_])", re.IGNORECASE)


def leads_away(block: Block) -> bool:
    """Whether what runs behind this block may be other than the block that stands behind it: a branch, a call.

    >>> from planner.gcode import read_block
    >>> [leads_away(read_block(text)) for text in ("IF R1==2", "GOTOF END", "L10 P2", "POCKET(3)", 'CALL "A"')]
    [True, True, True, True, True]
    >>> [leads_away(read_block(text)) for text in ("G1 X=R1 F3", 'MSG("A")', "R1=2 M8 H5", "N7", "T2 D1 M6")]
    [False, False, False, False, False]
    """
    if block.statement is not None:
        return True
    return any(word.address not in _OWN and _PARAMETER.match(word.address) is None for word in block.words)


def may_lean(data: bytes, settings: Settings | None) -> bool:
    """Whether a curve that takes its direction from the move before stands in this text, or in what it may call."""
    try:
        return any(_LEANING.search(TEXTS.sub(b"", text)) for text in (data, *named_programs(data, settings)))
    except OSError:
        return True


def named_programs(data: bytes, settings: Settings | None) -> Iterator[bytes]:
    """The subprograms whose names stand in this program, or in one of those; raises OSError."""
    library = Library(None if settings is None else settings.subprogram_folder)
    left, waiting = set(library.names), [data]
    while waiting:
        text = waiting.pop()
        for name in [one for one in left if _is_named(one, text)]:
            left.remove(name)
            found = library.program(name)
            if found is not None:
                waiting.append(found)
                yield found


def _is_named(name: str, text: bytes) -> bool:
    """Whether a program's name stands in a text; its last digits may end a word or be followed by another."""
    number = _NUMBERED.match(name)
    spelled = rb"L0*%s" % number[1].encode() if number else re.escape(name.encode("latin-1", "replace"))
    before = rb"(?<![A-Z])" if name[:1].isalpha() else rb"(?<![A-Z\d.])"
    behind = rb"(?!\d)" if name[-1:].isdigit() else rb"(?![A-Z\d])"
    return re.search(before + spelled + behind, text, re.IGNORECASE) is not None
