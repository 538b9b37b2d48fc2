"""Dialects: how each control spells the language (comments, numbers, ends of blocks)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Dialect:
    """The spelling of one family of controls.

    `comment_close` is empty where a comment runs to the end of the block. `needs_point`: a number without a decimal
    point would be read as least increments. `has_expressions`: SINUMERIK's `=`, brackets and statements are read.
    `max_block_characters` counts the end of block.
    """

    name: str
    comment_open: str
    comment_close: str
    needs_point: bool
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


SINUMERIK = Dialect("sinumerik", ";", "", False, True, 512, 99_999_999)
FANUC = Dialect("fanuc", "(", ")", True, False, 256, 99_999)
LINUXCNC = Dialect("linuxcnc", "(", ")", False, False, 255, 99_999)
GENERIC = Dialect("generic", "(", ")", True, False, 128, 9_999)
HEIDENHAIN = Dialect("heidenhain", ";", "", False, False, 256, 999_999)

DIALECTS: dict[str, Dialect] = {dialect.name: dialect for dialect in (SINUMERIK, FANUC, LINUXCNC, GENERIC, HEIDENHAIN)}
