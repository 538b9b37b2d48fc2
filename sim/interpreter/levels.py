"""One running program: where it stands, what is open, what it looks for, and how passed blocks change that.

Blocks that are passed over are not executed, but they open and close structures all the same.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from planner.gcode.statement import Jump, Mark, Marker, Statement
from sim.interpreter.source import Source
from sim.interpreter.structures import closes, opens, second_else


@dataclass(frozen=True, slots=True)
class Opened:
    """A structure whose end has not come: what, and index and line of its first block."""

    kind: str
    index: int
    statement: Statement
    line: int


@dataclass(slots=True)
class Section:
    """Blocks from `start` up to `stop` that run `left` more times before the program goes on at `resume`."""

    start: int
    stop: int
    left: int
    resume: int


@dataclass(frozen=True, slots=True)
class Search:
    """Blocks are passed over until the label (or block number) comes, or the branch ends.

    `kind` is "label", "else" (ELSE or the end counts) or the structure whose end is looked for; `jump` is the jump of
    a search for a label, `origin` the index after the block that began the search and `line` that block's line.
    """

    kind: str
    target: str = ""
    jump: Jump | None = None
    origin: int = 0
    line: int = 0


@dataclass(slots=True)
class Level:
    """One running program: its source, the index of the next block, and what is open.

    Blocks before `furthest` have run already; all have where the program `is_repeat`.
    """

    source: Source
    at: int = 0
    opened: list[Opened] = field(default_factory=list)
    sections: list[Section] = field(default_factory=list)
    search: Search | None = None
    depth: int = 0
    is_main: bool = True
    furthest: int = 0
    is_repeat: bool = False


def keep_track(level: Level, index: int, statement: Statement | None) -> None:
    """A jump forward may leave structures: their ends, passed over, close them."""
    opened, closed = opens(statement), closes(statement)
    if opened is not None and statement is not None:
        level.opened.append(Opened(opened, index, statement, level.source.line(index)))
    elif closed is not None and level.opened and level.opened[-1].kind == closed:
        level.opened.pop()


def skip(level: Level, index: int, statement: Statement | None, kind: str) -> None:
    """Pass over a branch; what is nested in it is counted."""
    wanted = "IF" if kind == "else" else kind
    if opens(statement) == wanted:
        level.depth += 1
    elif closes(statement) == wanted:
        if level.depth == 0:
            level.search = None
        level.depth -= 1
    elif wanted == "IF" and level.depth == 0 and statement == Mark(Marker.ELSE):
        if kind == "IF":
            raise second_else()
        level.search = None
        level.opened.append(Opened("IF", index, Mark(Marker.ELSE), level.source.line(index)))
