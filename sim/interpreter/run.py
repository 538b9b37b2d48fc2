"""The two doors of the interpreter: `Interpreter` takes blocks as they come, `interpret` a whole program."""

from __future__ import annotations

import re
from collections.abc import Iterator

from sim.interpreter import canon
from sim.interpreter.bulk import interpret_bulk
from sim.interpreter.engine import Interpreter
from sim.interpreter.settings import Settings
from sim.interpreter.source import Data

__all__ = ["Interpreter", "count_blocks", "holds_block", "interpret", "interpret_bulk"]

_BLOCK = re.compile(rb"^[\r\0 \t]*[^\r\n\0 \t%;]", re.MULTILINE)


def interpret(data: Data, settings: Settings | None = None) -> Iterator[canon.Command]:
    """The canonical commands of a whole program, one a move; `interpret_bulk` gives straight cuts as arrays."""
    for command in interpret_bulk(data, settings):
        if isinstance(command, canon.LineRun):
            yield from command.expand()
        else:
            yield command


def holds_block(line: bytes) -> bool:
    """Whether a line is a block: not empty, no comment alone, no header of the tape."""
    words = line.strip(b"\r\n\0 \t")
    return bool(words) and words[:1] not in b"%;"


def count_blocks(data: bytes, last_line: int = 0) -> int:
    """How many lines of a program are blocks, up to line `last_line` (0: all of them)."""
    return len(_BLOCK.findall(b"\n".join(data.split(b"\n")[: last_line or None])))
