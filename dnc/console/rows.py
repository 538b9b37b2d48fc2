"""Text with meaning: rows of spans, each with a tone that the screen turns into colour; pure.

Normal is quiet. A colour says what a lamp on a mill says: green runs, yellow is abnormal, red needs action now, blue
asks for an act of the operator. The words always say the same, so that monochrome loses nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from dnc.status.text import harmless


class Tone(Enum):
    """What a span means."""

    PLAIN = "plain"
    QUIET = "quiet"
    STRONG = "strong"
    RUNS = "runs"
    ABNORMAL = "abnormal"
    FAULT = "fault"
    ASKS = "asks"
    SIMULATED = "simulated"


@dataclass(frozen=True, slots=True)
class Span:
    """Some text in one tone; text from outside is made harmless here."""

    text: str
    tone: Tone = Tone.PLAIN

    def __post_init__(self) -> None:
        object.__setattr__(self, "text", harmless(self.text))


Row = tuple[Span, ...]


def row(*parts: str | Span) -> Row:
    """A row of spans; a plain string is a plain span."""
    return tuple(part if isinstance(part, Span) else Span(part) for part in parts)


def length(spans: Row) -> int:
    """Columns that the row takes."""
    return sum(len(span.text) for span in spans)


def fitted(spans: Row, width: int) -> Row:
    """The row cut or filled with blanks to exactly this many columns.

    >>> [span.text for span in fitted(row("abc", "def"), 4)]
    ['abc', 'd']
    """
    out: list[Span] = []
    left = width
    for span in spans:
        if left <= 0:
            break
        out.append(Span(span.text[:left], span.tone))
        left -= len(span.text)
    return (*out, Span(" " * left)) if left > 0 else tuple(out)


def beside(left: Row, right: Row, width: int) -> Row:
    """Two rows, the second at the right border; the first gives way."""
    return (*fitted(left, max(0, width - length(right))), *right)


def text_of(rows: list[Row]) -> str:
    """The rows as plain text."""
    return "\n".join("".join(span.text for span in spans).rstrip() for spans in rows)
