"""Where execution may still stand when a control has read up to some byte: its look-ahead, counted in blocks that move.

Comments, blank lines, blocks that only set something and blocks that lead where the axes stand already take no place in
a look-ahead, however many lie between two moves; of a run of splines it holds the spans, which are fewer than its
blocks. What may or may not move here is taken for one that does not: the window is too wide, never too narrow.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

from dnc.branches import ASIDE
from dnc.tape import Tape, Traits

_CHUNK_BYTES = 4096
_RUN_BYTES = 1_000_000
_RUN_LEAD = 2
"""A B-spline of degree 3 has so many spans fewer than blocks; blocks with PL=0 are none either."""
_BEHIND_RUN = 2
_CONTOUR_BLOCKS = 10
"""Under G41 and G42 a move ends where the next ones let it: so many a control may hold back beside its look-ahead."""
_WAITING_BLOCKS = 1000
_AXIS = re.compile(rb"(?<![A-Z_$\[])[ABCIJKUVWXYZ]\s*[-+.=\d]|PO\[", re.IGNORECASE)
_AXIS_WORD = re.compile(rb"(?<![A-Z_$\[])([ABCUVWXYZ])\s*(=[^\sA-Z]+|=[A-Z]+\([^()]*\)|[-+]?[.\d]+)", re.IGNORECASE)
_CERTAIN = re.compile(rb"(?<![A-Z_$\[])[IJK]\d?\s*[-+.=\d]|PO\[", re.IGNORECASE)
_NO_SPAN = re.compile(rb"(?<![A-Z_])PL\s*=\s*0*\.?0*(?![.\d])", re.IGNORECASE)
_CODE = re.compile(rb"(?<![A-Z_])(?:(?:[ABC]SPLINE|POLY|CIP|CT|INVCC?W)(?![A-Z\d])|G0*[0-3](?![\d.]))", re.IGNORECASE)
_STAYS = re.compile(rb"^\s*/|G0*(?:4|10|25|26|5\d|68|69|92)(?!\d)", re.IGNORECASE)
_ELSEWHERE = re.compile(
    rb"G0*(?:1[56]|2[018]|30|4[3-9]|5[0-9]|5\d\d|6[89]|7[0145]|7[01]0|92)(?!\d)"
    rb"|(?<![A-Z_])(?:M0*6|M9[89]|[DHLT]\d|[UVW]\s*[-+.=\d]|AP|RP|[ABCXYZ]\s*=\s*(?:[A-Z$]|$|\s))",
    re.IGNORECASE,
)
"""Codes behind which the same number may be another place, calls, axes that lead others, places by expressions."""
_DIMENSION = re.compile(rb"G0*9[01](?!\d)", re.IGNORECASE)
_WORD = re.compile(rb"[A-Z_$]{2,}", re.IGNORECASE)
_OF_MOVES = frozenset(
    b"AC AP AR ASPLINE BSPLINE CIP CR CSPLINE CT DR FMAX IC LN PL PO POLY PW RL RP RR SD TURN".split()
)
_HARMLESS = _OF_MOVES | frozenset(b"ADIS BRISK CFC COMPCAD COMPOF CTOL FGROUP FFWOF FFWON MSG SOFT STOPRE".split())


def first_unsure_line(tape: Tape, read_bytes: int, blocks: int) -> int:
    """The line of the last move but so many before the line of byte `read_bytes`; 1 if there are not so many.

    Within a run of splines the line where it begins: a control may read the run to its end before it moves. So a run
    takes no place in its look-ahead until a move behind the one that ends it is read too. Behind the first jump or
    branch no block surely ran, so that only moves before it fill the look-ahead. Lines count from 1. Reads
    backwards piece by piece, so that its time depends on the answer and on one megabyte before it alone.
    """
    if tape.traits.branch_at is not None:
        read_bytes = min(read_bytes, tape.traits.branch_at)
    if tape.traits.is_compensated:
        blocks += _CONTOUR_BLOCKS
    line, behind_blocks = tape.lines.line_at(tape, read_bytes), 0
    while True:
        run = _run_before(tape, line, blocks)
        if not run.begin:
            return run.enough_from or 1
        counted = run.blocks
        if run.is_spline:
            counted = max(0, counted - max(_RUN_LEAD, run.zero_blocks)) if behind_blocks >= _BEHIND_RUN else 0
        if counted >= blocks:
            return run.begin if run.is_spline else run.enough_from
        blocks -= counted
        behind_blocks += run.blocks
        line = run.begin


@dataclass(slots=True)
class _Run:
    """The blocks down to the one with a code of motion, in line `begin` (0: not found); where so many are enough.

    Of a run that holds far more than enough, not all are counted.
    """

    blocks: int = 0
    zero_blocks: int = 0
    enough_from: int = 0
    begin: int = 0
    is_spline: bool = False


def _run_before(tape: Tape, line: int, enough: int) -> _Run:
    run = _Run()
    for block in _blocks_before(tape, line):
        run.blocks += bool(block.is_move)
        run.zero_blocks += block.is_move is not None and _NO_SPAN.search(block.text) is not None
        if not run.enough_from and run.blocks >= enough:
            run.enough_from = block.line
        if _noted(run, block.line, block.text):
            return run
        if run.blocks >= enough + max(_RUN_LEAD, run.zero_blocks):
            limit = block.at - _RUN_BYTES
            for number, at, text in _lines_before(tape, block.line):
                if _noted(run, number, ASIDE.sub(b"", text)) or at < limit:
                    return run
            return run
    return run


def _noted(run: _Run, line: int, text: bytes) -> bool:
    """Whether a code of motion stands in this block: the run begins here."""
    code = _CODE.findall(text)
    if code:
        run.begin, run.is_spline = line, code[-1].upper().endswith(b"SPLINE")
    return bool(code)


@dataclass(slots=True)
class _Block:
    """A line, where the piece that was read with it begins, its words without comments and texts.

    `is_move` is None where nothing moves by its words; else whether it is known to move. `sure_axes` are known to go
    elsewhere than they were, which waits for the words of `unknown_axes` in blocks before.
    """

    line: int
    at: int
    text: bytes
    is_move: bool | None = None
    values: dict[bytes, float | bytes] = field(default_factory=dict)
    sure_axes: set[bytes] = field(default_factory=set)
    unknown_axes: int = 0


def _blocks_before(tape: Tape, line: int) -> Iterator[_Block]:
    """The blocks before this line, the last first; a block that leads where the axes stand already is no move."""
    waiting: deque[_Block] = deque()
    newest: dict[bytes, _Block] = {}
    for number, at, text in _lines_before(tape, line):
        block = _Block(number, at, ASIDE.sub(b"", text))
        if moves(text):
            block.is_move = _CERTAIN.search(block.text) is not None
        if _leads_elsewhere(block.text, is_incremental=tape.traits.is_incremental):
            for later in newest.values():
                later.unknown_axes -= 1
            newest.clear()
        elif block.is_move is not None:
            block.values = {axis.upper(): _value(value) for axis, value in _AXIS_WORD.findall(block.text)}
            block.unknown_axes = len(block.values)
            for axis in block.values:
                if axis in newest:
                    _compare(newest[axis], axis, block, tape.traits)
                newest[axis] = block
        waiting.append(block)
        while waiting and (waiting[0].is_move or not waiting[0].unknown_axes or len(waiting) > _WAITING_BLOCKS):
            yield waiting.popleft()
    yield from waiting


def _compare(later: _Block, axis: bytes, before: _Block, traits: Traits) -> None:
    """Whether an axis surely goes elsewhere in the later of two blocks; what an expression gives nobody knows.

    Under G91 a word of 0 moves nothing. Where radii are compensated a move out of the plane lets nothing before it end.
    """
    later.unknown_axes -= 1
    value, value_before = later.values[axis], before.values[axis]
    is_known = isinstance(value, float) and isinstance(value_before, float) and value != value_before
    if not is_known or (traits.is_incremental and not value):
        return
    later.sure_axes.add(axis)
    if not traits.is_compensated:
        later.is_move = True
    elif traits.has_other_plane:
        later.is_move = later.is_move or len(later.sure_axes) > 1
    else:
        later.is_move = later.is_move or axis in (b"X", b"Y")


def _leads_elsewhere(text: bytes, *, is_incremental: bool) -> bool:
    """Whether the same number may be another place behind this block, or within it."""
    if any(word.upper() not in _HARMLESS for word in _WORD.findall(text)):
        return True
    if _ELSEWHERE.search(text) is not None:
        return True
    return is_incremental and _DIMENSION.search(text) is not None


def _value(text: bytes) -> float | bytes:
    """What an axis word says, to be compared with another."""
    try:
        return float(text.replace(b"=", b""))
    except ValueError:
        return text


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
    text = ASIDE.sub(b"", text)
    if _AXIS.search(text) is None or _STAYS.search(text) is not None:
        return False
    return all(word.upper() in _OF_MOVES for word in _WORD.findall(text))
