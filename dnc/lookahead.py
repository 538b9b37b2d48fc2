"""Where execution may still stand when a control has read up to some byte: its look-ahead, counted in blocks that move.

Comments, blank lines and blocks that only set something take no place in a look-ahead, however many lie between two
moves. What may or may not move here is taken for one that does not: the window then is too wide, never too narrow.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from dnc.tape import Tape

_CHUNK_BYTES = 4096
_RUN_BYTES = 1_000_000
_ASIDE = re.compile(rb'"[^"]*"?|\([^()]*\)|[;(].*')
_AXIS = re.compile(rb"(?<![A-Z_$\[])[ABCIJKUVWXYZ]\s*[-+.=\d]|PO\[", re.IGNORECASE)
_CODE = re.compile(rb"(?<![A-Z_])(?:(?:[ABC]SPLINE|POLY|CIP|CT|INVCC?W)(?![A-Z\d])|G0*[0-3](?![\d.]))", re.IGNORECASE)
_STAYS = re.compile(rb"^\s*/|G0*(?:4|10|25|26|5\d|68|69|92)(?!\d)", re.IGNORECASE)
_WORD = re.compile(rb"[A-Z_$]{2,}", re.IGNORECASE)
_OF_MOVES = frozenset(
    b"AC AP AR ASPLINE BSPLINE CIP CR CSPLINE CT DR FMAX IC LN PL PO POLY PW RL RP RR SD TURN".split()
)


def first_unsure_line(tape: Tape, read_bytes: int, blocks: int) -> int:
    """The line of the last move but so many before the line of byte `read_bytes`; 1 if there are not so many.

    Within a run of splines the line where it begins: a control may read the run to its end before it moves. Lines count
    from 1. Reads backwards piece by piece, so that its time depends on the answer and on one megabyte before it alone.
    """
    begin = tape.lines.line_at(tape, read_bytes)
    first, limit = 0, 0
    for line, at, text in _lines_before(tape, begin):
        if not first:
            blocks -= moves(text)
            first, limit = (line, at - _RUN_BYTES) if blocks <= 0 else (0, 0)
        code = _CODE.findall(_ASIDE.sub(b"", text)) if first else []
        if code:
            return line if code[-1].upper().endswith(b"SPLINE") else first
        if at < limit:
            break
    return first or 1


def _lines_before(tape: Tape, line: int) -> Iterator[tuple[int, int, bytes]]:
    """The lines before this one, the last first: its number, where the piece read with it begins, text."""
    end, size = tape.lines.offset_of(tape, line), _CHUNK_BYTES
    while end > tape.leader_bytes:
        begin = max(tape.leader_bytes, end - size)
        texts = tape.peek(begin, end - begin).split(tape.lines.mark)
        head = texts.pop(0) if begin > tape.leader_bytes else b""
        if len(texts) < 2 and head:
            size *= 2  # a line longer than the piece
            continue
        for text in reversed(texts[:-1]):
            line -= 1
            yield line, begin, text
        end = begin + len(head) + len(tape.lines.mark) if head else begin


def moves(text: bytes) -> bool:
    """Whether this block moves an axis for certain.

    >>> [moves(text) for text in (b"N1 G1 X2", b"G1X-.5F100", b"PO[X]=(1,2) PO[Y]=(3)", b"X=R1 Y=AC(2)")]
    [True, True, True, True]
    >>> [moves(text) for text in (b"", b"; X1", b"(X1)", b"N2 M8", b"/N3 X4", b"TRANS X5", b"G4 X2", b'MSG("X1")')]
    [False, False, False, False, False, False, False, False]
    """
    text = _ASIDE.sub(b"", text)
    if _AXIS.search(text) is None or _STAYS.search(text) is not None:
        return False
    return all(word.upper() in _OF_MOVES for word in _WORD.findall(text))
