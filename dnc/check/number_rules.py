"""Rules over block numbers: twice, too large, falling, starting over."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from dnc.check.finding import Finding, Severity
from dnc.check.numbering import LARGEST_NUMBER, starts_over
from dnc.check.track import Track
from planner.gcode import Block

BlockRule = Callable[[Block, Track], Iterator[Finding]]


def number_twice(block: Block, track: Track) -> Iterator[Finding]:
    """The same N again in one round of numbers."""
    if block.number is not None and block.number in track.numbers and not _is_new_round(block.number, track):
        yield Finding(
            "number-duplicate",
            Severity.WARNING,
            block.line,
            1,
            f"N{block.number} stands twice",
            "a block search or a restart may begin at the wrong one",
            "number the blocks again",
        )


def number_too_large(block: Block, track: Track) -> Iterator[Finding]:
    """N with more digits than the control reads."""
    del track
    if block.number is not None and block.number > LARGEST_NUMBER:
        yield Finding(
            "number-too-large",
            Severity.ERROR,
            block.line,
            1,
            f"N{str(block.number)[:12]} has more than {len(str(LARGEST_NUMBER))} digits",
            "the control does not read it",
            "number the blocks again",
        )


def number_descends(block: Block, track: Track) -> Iterator[Finding]:
    """N smaller than the one before, unless the numbers start over."""
    last = track.last_number
    if block.number is not None and last is not None and block.number < last and not starts_over(last, block.number):
        yield Finding(
            "number-descending",
            Severity.WARNING,
            block.line,
            1,
            f"N{block.number} comes after N{last}",
            "a block search may not find it",
            "number the blocks again",
        )


def numbers_start_over(block: Block, track: Track) -> Iterator[Finding]:
    """A new round of numbers, as CAM systems with four digits write them: one finding a round."""
    if block.number is not None and _is_new_round(block.number, track):
        yield Finding(
            "number-round",
            Severity.NOTE,
            block.line,
            1,
            f"the block numbers start over: N{block.number} comes after N{track.last_number}",
            "numbers stand for several blocks from here on; a jump or a block search takes the first it finds",
            "name lines in place of numbers, or number the blocks with more digits",
        )


def _is_new_round(number: int, track: Track) -> bool:
    return track.last_number is not None and starts_over(track.last_number, number)


NUMBER_RULES: tuple[BlockRule, ...] = (number_twice, number_too_large, number_descends, numbers_start_over)
