"""Runs of plain blocks, checked as arrays: which of them a rule may have something to say about, and what the others
leave behind. A block in doubt goes the ordinary way, so the findings are those of block by block.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dnc.check import moves
from dnc.check.numbering import LARGEST_NUMBER, starts_over
from dnc.check.rate import run_times_ns
from dnc.check.track import Track
from sim.interpreter.bulk import plain_ends
from sim.interpreter.canon import LineRun, Vector
from sim.interpreter.plain import PlainLines
from sim.interpreter.run import Interpreter

SHORTEST_RUN = 16


def steady_lines(lines: PlainLines) -> NDArray[np.bool_]:
    """Which lines of a chunk hold plain blocks with a coordinate or a feed, (lines,)."""
    return lines.is_plain & ~np.isnan(lines.values[:, 2:]).all(axis=1)


def takes_runs(interpreter: Interpreter, track: Track) -> bool:
    """Whether nothing that came before makes the next plain block special to any rule."""
    return (
        interpreter.takes_runs
        and track.motion_code == "G1"
        and track.end_line is None
        and track.spindle_line is None
        and track.plunge is None
        and not track.is_lacking
        and track.direction is not None
        and track.is_height_known
        and track.cut_mm + track.air_mm > 0.0
    )


def stretches(is_doubtful: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Rows from and to: those without doubt between two doubtful ones, then one doubtful row at a time."""
    place = 0
    for row in np.flatnonzero(is_doubtful).tolist():
        if row > place:
            yield place, row
        yield row, row + 1
        place = row + 1
    if place < len(is_doubtful):
        yield place, len(is_doubtful)


def doubtful(
    values: NDArray[np.float64], interpreter: Interpreter, track: Track, slack: float = 1e-6
) -> NDArray[np.bool_]:
    """Which of these plain blocks (`PlainLines.values`) a rule may have something to say about, (n,).

    More may be named than a rule will find, never fewer: unit directions are compared with this much slack, since
    here they are summed in another order.
    """
    ends, _ = plain_ends(interpreter, values)
    before = np.vstack([interpreter.modal.position_mm, ends[:-1]])
    has_moved = (ends != before).any(axis=1)
    found: NDArray[np.bool_] = ~has_moved & ~np.isnan(values[:, 2:5]).all(axis=1)
    found |= _bad_numbers(values[:, 0], track)
    for axis, name in enumerate(("X", "Y", "Z")):
        least_mm, most_mm = track.limits.reach_mm(name, track.is_zero_shifted)
        found |= (ends[:, axis] < least_mm) | (ends[:, axis] > most_mm)
    rows = np.flatnonzero(has_moved)
    found[rows] |= _odd_feeds(values[:, 5], rows, interpreter.modal.feed, track)
    if len(rows) and track.direction is not None:
        found[rows] |= _turns(ends[rows] - before[rows], track.direction, slack)
    found[rows[1:]] |= _after_plunges(ends[rows], before[rows])
    return found


def _bad_numbers(numbers: NDArray[np.float64], track: Track) -> NDArray[np.bool_]:
    """Block numbers that descend, start over, stand twice in a round or are too large."""
    found = np.zeros(len(numbers), dtype=np.bool_)
    rows = np.flatnonzero(~np.isnan(numbers))
    if len(rows) == 0:
        return found
    here = numbers[rows].astype(np.int64)
    last = -1 if track.last_number is None else track.last_number
    before = np.concatenate([[last], here[:-1]])
    falls = here < before
    rounds = np.zeros(len(here), dtype=np.int64)
    for row in np.flatnonzero(falls).tolist():
        rounds[row] = starts_over(int(before[row]), int(here[row]))
    rounds = np.cumsum(rounds)
    found[rows] = falls | (here > LARGEST_NUMBER) | (track.numbers.holds(here) & (rounds == 0))
    if falls[1:].any() or (np.diff(here) == 0).any():
        _, firsts = np.unique(here + rounds * (LARGEST_NUMBER + 1), return_index=True)
        again = np.ones(len(here), dtype=np.bool_)
        again[firsts] = False
        found[rows[again]] = True
    return found


def _odd_feeds(
    feeds: NDArray[np.float64], rows: NDArray[np.intp], feed_before: float | None, track: Track
) -> NDArray[np.bool_]:
    """Which moves, in these rows, have an odd feed that the move before had not, or are the first behind one.

    `feeds` (n,) are the F words, NaN where there is none; F may stand in a block of its own.
    """
    if not len(rows):
        return np.zeros(0, dtype=np.bool_)
    filled = np.concatenate([[math.nan if feed_before is None else feed_before], feeds])
    held = np.maximum.accumulate(np.where(np.isnan(filled), 0, np.arange(len(filled))))
    here = filled[held[rows + 1]]
    slowest, fastest = track.limits.usual_feeds_mm_min
    is_odd = (here < slowest) | (here > fastest)
    told = track.told_feed_mm_min
    first = is_odd[0] if told is None else here[0] != told
    return np.concatenate([[first], (np.diff(here) != 0.0) & (is_odd[1:] | is_odd[:-1])])


def _turns(ways: NDArray[np.float64], before: Vector, slack: float) -> NDArray[np.bool_]:
    """Moves that set out against the one before, seen from above, as `moves.turns_back` has it or nearly so."""
    units = ways / np.sqrt((ways**2).sum(axis=1))[:, None]
    earlier = np.vstack([before, units[:-1]])
    flat = np.hypot(units[:, 0], units[:, 1]) * np.hypot(earlier[:, 0], earlier[:, 1])
    along = units[:, 0] * earlier[:, 0] + units[:, 1] * earlier[:, 1]
    turns: NDArray[np.bool_] = (flat > moves.TURN_FLAT - slack) & (along < (slack - moves.TURN_COSINE) * flat)
    return turns


def _after_plunges(ends: NDArray[np.float64], before: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Moves along X or Y that follow a plunge straight down, the first move left out."""
    moves_xy = (ends[:, :2] != before[:, :2]).any(axis=1)
    goes_down = ~moves_xy & (ends[:, 2] < before[:, 2])
    follows: NDArray[np.bool_] = goes_down[:-1] & moves_xy[1:]
    return follows


def cut_times_ns(run: LineRun) -> NDArray[np.int64]:
    """The least time of each cut, (n,) nanoseconds."""
    return run_times_ns(_lengths(run), run.feeds)


def cut_sizes_bytes(run: LineRun, line_sizes_bytes: NDArray[np.int64], first_line: int) -> NDArray[np.int64]:
    """Bytes of the lines up to each cut since the one before, (n,); the sizes are of the lines from `first_line` on."""
    sums = np.concatenate([[0], np.cumsum(line_sizes_bytes)])
    sizes: NDArray[np.int64] = np.diff(sums[run.lines - first_line + 1], prepend=0)
    return sizes


def _lengths(run: LineRun) -> NDArray[np.float64]:
    ways = np.diff(run.ends, axis=0, prepend=np.array([run.start]))
    lengths: NDArray[np.float64] = np.sqrt((ways**2).sum(axis=1))
    return lengths


def see_run(run: LineRun, track: Track) -> None:
    """Take a run of cuts without doubt into account, as `Track.see_command` does for each."""
    starts = np.vstack([run.start, run.ends[:-1]])
    lengths = _lengths(run)
    moves_xy = (run.ends[:, :2] != starts[:, :2]).any(axis=1)
    low, high = np.minimum(run.ends[:, 2], starts[:, 2]), np.maximum(run.ends[:, 2], starts[:, 2])
    is_air = (high >= track.clear_z_mm) & (~moves_xy | (low >= track.clear_z_mm))
    if is_air.any():
        track.air_mm += float(lengths[is_air].sum())
        track.air_moves += int(is_air.sum())
        track.idle_moves += int((is_air & (moves_xy | (run.ends[:, 2] >= starts[:, 2]))).sum())
        track.air_line = track.air_line or int(run.lines[is_air.argmax()])
    if not is_air.all():
        track.cut_mm += float(lengths[~is_air].sum())
        tops = np.where(moves_xy, high, starts[:, 2])
        track.cut_top_mm = max(track.cut_top_mm, float(tops[~is_air].max()))
    plunges = np.flatnonzero(~moves_xy & (run.ends[:, 2] < starts[:, 2]) & (run.ends[:, 2] < track.clear_z_mm))
    if len(plunges):
        track.hole = run.cut(int(plunges[-1])).end
        track.cut_top_mm = max(track.cut_top_mm, float(run.ends[plunges, 2].max()))
    track.is_backward = False
    last = run.last
    track.plunge = last if moves.is_plunge(last) else None
    track.direction = moves.end_direction(last)


def see_numbers(values: NDArray[np.float64], track: Track) -> None:
    """Take the numbers and codes of plain blocks without doubt into account, as `Track.see_plain` does for each."""
    numbers = values[:, 0][~np.isnan(values[:, 0])].astype(np.int64)
    if len(numbers):
        track.numbers.add_many(numbers)
        track.last_number = int(numbers[-1])
    track.blocks += len(values)
