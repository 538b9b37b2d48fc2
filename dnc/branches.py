"""What of a tape must be known to say from its bytes where execution may stand: which blocks run, what moves.

Behind the first jump, branch or loop nobody can tell which blocks run. Under G91 a word of 0 moves nothing; under G41
and G42 a move waits for the next in the plane.
"""

from __future__ import annotations

import re

ASIDE = re.compile(rb'"[^"]*"?|\([^()]*\)|[;(].*')
"""Texts and comments within a line."""
_WORDS = (b"IF", b"GOTO", b"CASE", b"FOR", b"WHILE", b"LOOP", b"REPEAT", b"UNTIL")
_BRANCH = re.compile(rb"(?<![A-Z_$])(?:IF|GOTO[BCFS]?|CASE|FOR|WHILE|LOOP|REPEATB?|UNTIL)(?![A-Z_])", re.IGNORECASE)
_COMPENSATED = (b"G41", b"G42", b"G041", b"G042", b" RL", b" RR")
_INCREMENTAL = (b"G91", b"G091")
_OTHER_PLANE = (b"G18", b"G19", b"G018", b"G019")
_LONGEST_CODE_BYTES = 4
_LONGEST_LINE_BYTES = 1 << 16


class Branches:
    """Fed with the tape in order; `first_at` is where the line of the first branch begins, None while there is none."""

    def __init__(self, mark: bytes, offset_bytes: int) -> None:
        self._mark = mark
        self._at, self._torn = offset_bytes, b""
        self.first_at: int | None = None

    def feed(self, chunk: bytes) -> None:
        """The next bytes; a line longer than 64 kB is looked at in pieces."""
        if self.first_at is not None:
            return
        text = self._torn + chunk
        whole = text.rfind(self._mark) + len(self._mark) if self._mark in text else 0
        if not whole and len(text) > _LONGEST_LINE_BYTES:
            whole = len(text)
        self._look(text[:whole])
        self._at += whole
        self._torn = text[whole:]

    def close(self) -> None:
        """The last line may have no end."""
        if self.first_at is None:
            self._look(self._torn)

    def _look(self, text: bytes) -> None:
        capital = text.upper()  # searched for words tenfold as fast as by the expression
        if not any(word in capital for word in _WORDS):
            return
        at = self._at
        for line in text.split(self._mark):
            if _BRANCH.search(ASIDE.sub(b"", line)):
                self.first_at = at
                return
            at += len(line) + len(self._mark)


class Codes:
    """Fed with the tape in order: whether it compensates tool radii, moves by increments, leaves the plane of X and Y.

    What looks alike or stands in a comment counts too: it makes the window of doubt wider.
    """

    def __init__(self) -> None:
        self._torn = b""
        self.is_compensated = self.is_incremental = self.has_other_plane = False

    def feed(self, chunk: bytes) -> None:
        """The next bytes."""
        text = (self._torn + chunk).upper()
        self.is_compensated = self.is_compensated or _holds(text, _COMPENSATED)
        self.is_incremental = self.is_incremental or _holds(text, _INCREMENTAL)
        self.has_other_plane = self.has_other_plane or _holds(text, _OTHER_PLANE)
        self._torn = text[1 - _LONGEST_CODE_BYTES :]


def _holds(text: bytes, codes: tuple[bytes, ...]) -> bool:
    return any(code in text for code in codes)
