"""The lexis of SINUMERIK blocks: characters of one line to tokens with their columns.

Rules (programming manual, fundamentals): case does not matter outside strings; blank, tab, `&` and non-printing
characters separate; `;` starts a comment; a name has at least two letters or starts with `_` or `$`, so that a letter
before a digit is always an address.
"""

from __future__ import annotations

import re
from dataclasses import dataclass


class SyntaxProblem(Exception):
    """A block that cannot be read: where, what stands there, and what was expected."""

    def __init__(self, line: int, column: int, what: str, expected: str) -> None:
        self.line, self.column, self.what, self.expected = line, column, what, expected
        super().__init__(f"line {line}, column {column}: {what}; expected {expected}")


@dataclass(frozen=True, slots=True)
class Token:
    """`kind` is number, name, string, literal, operator or end; `text` in upper case except for strings."""

    kind: str
    text: str
    column: int
    is_adjacent: bool

    @property
    def value(self) -> float:
        """The value of a number or a hexadecimal or binary literal."""
        if self.kind == "literal":
            base = {"H": 16, "B": 2, "D": 10}[self.text[1]]
            return float(int(self.text[2:-1], base))
        mantissa, _, exponent = self.text.partition("EX")
        return float(f"{mantissa}e{exponent}") if exponent else float(mantissa)


_TOKEN = re.compile(
    r"""
    (?P<blank>[\x00-\x20&\x7f-\x9f\xa0]+)
  | (?P<comment>;.*)
  | (?P<number>(?:\d+\.?\d*|\.\d+)(?:EX[+-]?\d{1,3}(?!\d))?)
  | (?P<name>\$[A-Z_][A-Z0-9_]* | _[A-Z0-9_]* | [A-Z][A-Z_][A-Z0-9_]* | [A-Z])
  | (?P<string>"[^"]*")
  | (?P<literal>'(?:H[0-9A-F]{1,15}|B[01]{1,52}|D\d{1,15})')
  | (?P<operator>==|<>|>=|<=|<<|[-+*/()\[\],=<>:])
    """,
    re.VERBOSE | re.IGNORECASE | re.DOTALL,
)


def tokens_of(text: str, line: int) -> tuple[list[Token], str | None]:
    """The tokens of a line, ending in one of kind `end`, and its comment without the semicolon, or None.

    Raises SyntaxProblem at the first character that starts no token.
    """
    tokens: list[Token] = []
    place, previous_end, comment = 0, -1, None
    while place < len(text):
        match = _TOKEN.match(text, place)
        if match is None:
            raise _bad_character(text, place, line)
        kind = match.lastgroup or ""
        if kind == "comment":
            comment = match.group()[1:]
            break
        if kind != "blank":
            found = match.group()
            shown = found[1:-1] if kind == "string" else found.upper()
            tokens.append(Token(kind, shown, place + 1, place == previous_end))
            previous_end = match.end()
        place = match.end()
    tokens.append(Token("end", "", min(place, len(text)) + 1, False))
    return tokens, comment


def _bad_character(text: str, place: int, line: int) -> SyntaxProblem:
    character = text[place]
    if character == '"':
        return SyntaxProblem(line, place + 1, "a string is not closed", 'a second "')
    if character == "'":
        return SyntaxProblem(line, place + 1, "the literal is not valid", "'Hff', 'B101' or 'D10'")
    shown = character if character.isprintable() else f"0x{ord(character):02X}"
    return SyntaxProblem(line, place + 1, f"the character {shown} starts no word", "an address, a name or ;")
