"""Dialects: how each control spells the language (comments, numbers, ends of blocks)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Dialect:
    """The spelling of one family of controls.

    `comment_close` is empty where a comment runs to the end of the block. `has_expressions`: SINUMERIK's `=`,
    brackets and statements are read. `max_block_characters` counts the end of block; `max_block_number` has the digits
    that the control's own post-processor library writes.
    """

    name: str
    comment_open: str
    comment_close: str
    has_expressions: bool
    max_block_characters: int
    max_block_number: int
    end_of_block: str = "\n"

    def comment(self, text: str) -> str:
        """`text` as a comment of this dialect; characters that would close it are replaced.

        >>> SINUMERIK.comment(" ball R4"), FANUC.comment("BALL (R4)")
        ('; ball R4', '(BALL [R4])')
        """
        if self.comment_close:
            text = text.replace("(", "[").replace(")", "]")
        return f"{self.comment_open}{text}{self.comment_close}"


SINUMERIK = Dialect("sinumerik", ";", "", True, 512, 99_999_999)
FANUC = Dialect("fanuc", "(", ")", False, 256, 99_999)
LINUXCNC = Dialect("linuxcnc", "(", ")", False, 255, 99_999)
GENERIC = Dialect("generic", "(", ")", False, 128, 9_999)
HEIDENHAIN = Dialect("heidenhain", ";", "", False, 256, 999_999)

DIALECTS: dict[str, Dialect] = {dialect.name: dialect for dialect in (SINUMERIK, FANUC, LINUXCNC, GENERIC, HEIDENHAIN)}
