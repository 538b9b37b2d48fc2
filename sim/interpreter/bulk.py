"""The fast route: runs of plain blocks as arrays, everything else block by block; both give the same commands."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sim.interpreter.canon import Command, LineRun
from sim.interpreter.engine import Interpreter
from sim.interpreter.plain import PlainLines, plain_lines
from sim.interpreter.settings import Settings
from sim.interpreter.source import Data, Whole

_CHUNK_BYTES = 1 << 18
_SHORTEST_RUN = 8


class _Chunk:
    """Lines `first` to `last` of the program after triage; `breaks` gives for each line the next that is not plain."""

    def __init__(self, lines: PlainLines, first: int, offset: int) -> None:
        count = len(lines.is_plain)
        self.lines, self.first, self.last, self.offset = lines, first, first + count, offset
        places = np.where(lines.is_plain, count, np.arange(count))
        self.breaks = np.minimum.accumulate(places[::-1])[::-1] if count else places

    def holds(self, index: int) -> bool:
        return self.first <= index < self.last

    def run_end(self, index: int) -> int:
        """The first line from `index` on that is not plain."""
        return self.first + int(self.breaks[index - self.first])


def interpret_bulk(data: Data, settings: Settings | None = None) -> Iterator[Command | LineRun]:
    """The canonical commands of a whole program, straight cuts in a row as LineRun values."""
    source = Whole(data)
    interpreter = Interpreter(settings, source)
    chunk: _Chunk | None = None
    while (index := interpreter.next_line) is not None:
        if chunk is None or index == chunk.last:
            chunk = _next_chunk(data, source, index)
        if chunk is not None and chunk.holds(index) and interpreter.takes_runs:
            end = chunk.run_end(index)
            end = index + interpreter.plain_rows_within(chunk.lines.values[index - chunk.first : end - chunk.first])
            if end - index >= _SHORTEST_RUN:
                rows = slice(index - chunk.first, end - chunk.first)
                run = straight_run(interpreter, chunk.lines.values[rows], index + 1)
                source.place(end, chunk.offset + int(chunk.lines.starts[rows.stop]))
                if run is not None:
                    yield run
                continue
        if not interpreter.step():
            break
        yield from interpreter.drain()
    yield from interpreter.drain()
    yield from interpreter.finish()


def _next_chunk(data: Data, source: Whole, index: int) -> _Chunk | None:
    start = source.offset(index)
    if start is None:
        return None
    stop = data.rfind(b"\n", start, start + _CHUNK_BYTES) + 1
    if stop <= start:
        found = data.find(b"\n", start)
        stop = len(data) if found < 0 else found + 1
    return _Chunk(plain_lines(data[start:stop]), index, start)


def straight_run(interpreter: Interpreter, values: NDArray[np.float64], first_line: int) -> LineRun | None:
    """Plain blocks (`PlainLines.values`, from physical line `first_line` on) as one run; None where nothing moves.

    The interpreter, which must say `takes_runs`, takes them as executed.
    """
    ends, feeds = plain_ends(interpreter, values)
    start = interpreter.modal.position_mm
    before = np.vstack([start, ends[:-1]])
    moves = np.flatnonzero((ends != before).any(axis=1))
    feed = float(feeds[-1])
    if len(moves) == 0:
        interpreter.take_run(len(values), feed, None)
        return None
    blocks = np.where(np.isnan(values[:, 0]), -1.0, values[:, 0]).astype(np.int64)
    run = LineRun(first_line + moves, blocks[moves], start, ends[moves], feeds[moves])
    interpreter.take_run(len(values), feed, run.last)
    return run


def plain_ends(
    interpreter: Interpreter, values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the tool stands after each of these plain blocks, (n, 3) mm, and the feed in force, (n,) mm/min."""
    state = interpreter.modal
    start, shift = state.position_mm, interpreter.total_shift
    assert state.feed is not None
    ends = np.column_stack([_carried(values[:, 2 + axis] + shift[axis], start[axis]) for axis in range(3)])
    return ends, _carried(values[:, 5], state.feed)


def _carried(values: NDArray[np.float64], before: float) -> NDArray[np.float64]:
    """Each NaN replaced by the last number before it, `before` at the head."""
    places = np.where(np.isnan(values), -1, np.arange(len(values)))
    latest = np.maximum.accumulate(places)
    return np.where(latest < 0, before, values[np.maximum(latest, 0)])
