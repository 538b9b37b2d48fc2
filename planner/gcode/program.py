"""Blocks and programs: words in the order they were written, with where they stood."""

from __future__ import annotations

from dataclasses import dataclass

from planner.gcode.statement import Statement
from planner.gcode.words import Word


@dataclass(frozen=True, slots=True)
class Block:
    """One block.

    `line` is the physical line from 1, `number` the N word (or the number after `:`, then `is_main`), `skip_level` the
    level of a leading `/` (0 without digit), `label` the name before a colon, `comment` the text after `;`, `header`
    the name after a leading `%` (which stands alone). `text` is the line as read, without its end.
    """

    line: int = 0
    number: int | None = None
    words: tuple[Word, ...] = ()
    comment: str | None = None
    statement: Statement | None = None
    label: str | None = None
    skip_level: int | None = None
    is_main: bool = False
    header: str | None = None
    text: str = ""

    @property
    def is_empty(self) -> bool:
        """Whether nothing is commanded: blank, comment, number or header alone."""
        return not self.words and self.statement is None


@dataclass(frozen=True, slots=True)
class Program:
    """A program as its blocks; `name` is what the tape header or its absence gave."""

    name: str | None
    blocks: tuple[Block, ...]
