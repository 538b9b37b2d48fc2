"""Blocks from text: one line at a time, or a whole program as bytes; syntax only, no meaning."""

from __future__ import annotations

import re
from collections.abc import Iterator

from planner.gcode.dialect import SINUMERIK, Dialect
from planner.gcode.expression import Expression, Name, Number, Unary
from planner.gcode.lexer import SyntaxProblem, tokens_of
from planner.gcode.parser import TokenReader
from planner.gcode.program import Block, Program
from planner.gcode.statement import Statement
from planner.gcode.statement_reader import JUMPS, is_statement_start, read_statement
from planner.gcode.words import Word

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
_PLAIN_WORD = re.compile(
    rf"[ \t]*(?:([A-Za-z])({_NUMBER})(?![\d.=\[eE])"
    rf"|(PO)\[([XYZ]?)\]=\(((?:{_NUMBER},)*{_NUMBER})\)"
    rf"|(PL|PW)=({_NUMBER})(?![\d.\[eE])"
    rf"|(POLY|BSPLINE)(?![A-Z0-9_=(\[:]))[ \t]*",
    re.IGNORECASE,
)
_ISO_WORD = re.compile(r"\s*([A-Za-z])\s*([+-]?(?:\d+\.?\d*|\.\d+))\s*")
_ISO_COMMENT = re.compile(r"\s*\(([^()]*)\)\s*")
_PATH_HEADER = re.compile(r";\s*\$PATH=")


def read_block(text: str, line: int = 1, dialect: Dialect = SINUMERIK) -> Block:
    """The block in one line (its end of block may be attached).

    Raises SyntaxProblem with line, column, what stands there and what was expected.
    """
    text = text.rstrip("\r\n")
    if len(text) >= dialect.max_block_characters:
        limit = dialect.max_block_characters
        raise SyntaxProblem(line, limit, f"the block has {len(text) + 1} characters", f"at most {limit}")
    if not dialect.has_expressions:
        return _iso_block(text, line)
    return _plain_block(text, line) or _full_block(text, line)


def read_blocks(data: bytes, dialect: Dialect = SINUMERIK) -> Iterator[Block | SyntaxProblem]:
    """Every line of a program in order; a line that cannot be read gives its problem and reading goes on."""
    start, line = 0, 0
    while start < len(data):
        line += 1
        stop = data.find(b"\n", start)
        stop = len(data) if stop < 0 else stop
        try:
            yield read_block(data[start:stop].decode("latin-1"), line, dialect)
        except SyntaxProblem as problem:
            yield problem
        start = stop + 1


def read_program(data: bytes, dialect: Dialect = SINUMERIK) -> Program:
    """The whole program; raises the first SyntaxProblem. A header `%NAME`, also behind `;`, gives the name."""
    blocks: list[Block] = []
    name: str | None = None
    for found in read_blocks(data, dialect):
        if isinstance(found, SyntaxProblem):
            raise found
        if name is None:
            name = header_name(found)
        blocks.append(found)
    return Program(name, tuple(blocks))


def header_name(block: Block) -> str | None:
    """The name in a tape header `%_N_NAME_MPF`, with or without a leading `;`, or None.

    >>> header_name(read_block(";%_N_HSM_LIN_TARGET_PIT"))
    '_N_HSM_LIN_TARGET_PIT'
    """
    if block.header:
        return block.header
    comment = (block.comment or "").strip()
    return comment[1:].strip() or None if comment.startswith("%") else None


def directory_of(block: Block) -> str | None:
    """The directory that the line after a tape header names, `;$PATH=/_N_MPF_DIR`, or None.

    >>> directory_of(read_block(";$PATH=/_N_PIT_DIR"))
    '/_N_PIT_DIR'
    """
    match = _PATH_HEADER.match(block.text)
    return block.text[match.end() :].strip() if match else None


def _plain_block(text: str, line: int) -> Block | None:
    """A block of letters with numbers and the plain words of POLY and BSPLINE, perhaps a comment; else None."""
    place = 0
    words: list[Word] = []
    number: int | None = None
    stop = len(text)
    while place < stop:
        match = _PLAIN_WORD.match(text, place)
        if match is None:
            if text[place] == ";":
                break
            return None
        letter, digits = match[1], match[2]
        if letter is None:
            words.append(_curve_word(match))
        elif letter in "Nn":
            if place or not digits.isdigit():
                return None
            number = int(digits)
        elif letter in "Oo":
            return None
        else:
            words.append(Word(letter.upper(), float(digits), digits, None, None, match.start(1) + 1))
        place = match.end()
    if place == 0:
        return None
    comment = text[place + 1 :] if place < stop else None
    return Block(line, number, tuple(words), comment, text=text)


def _curve_word(match: re.Match[str]) -> Word:
    """PO[X]=(...), PL=..., PW=..., POLY or BSPLINE, as the full parser would read it."""
    _, _, polynomial, axis, values, interval, digits, code = match.groups()
    if code is not None:
        return Word(code.upper(), column=match.start(8) + 1)
    if interval is not None:
        return Word(interval.upper(), float(digits), digits, None, None, match.start(6) + 1, True)
    arguments = tuple(_signed(text) for text in values.split(","))
    index = (Name(axis.upper()),) if axis else ()
    return Word(polynomial.upper(), None, "", arguments, index, match.start(3) + 1, True)


def _signed(text: str) -> Expression:
    if text[0] in "+-":
        return Unary(text[0], Number(float(text[1:]), text[1:]))
    return Number(float(text), text)


def _full_block(text: str, line: int) -> Block:
    if text.lstrip().startswith("%"):
        return Block(line, header=text.strip()[1:].strip(), text=text)
    tokens, comment = tokens_of(text, line)
    reader = TokenReader(tokens, line)
    skip_level = _skip_level(reader)
    number, is_main = _block_number(reader)
    if skip_level is None:
        skip_level = _skip_level(reader)
    label = _label(reader)
    statement: Statement | None = None
    words: list[Word] = []
    if is_statement_start(reader):
        statement = read_statement(reader)
        if reader.token.kind != "end":
            raise reader.problem(f"{reader.shown()} stands after the statement", "the end of the block")
    while reader.token.kind != "end":
        words.append(reader.word())
    return Block(line, number, tuple(words), comment, statement, label, skip_level, is_main, text=text)


def _skip_level(reader: TokenReader) -> int | None:
    if not reader.accept("/"):
        return None
    digit = reader.token
    if digit.kind == "number" and digit.is_adjacent:
        if len(digit.text) != 1:
            raise reader.problem(f"the skip level {digit.text} does not exist", "/ or /1 to /9")
        return int(reader.take().text)
    return 0


def _block_number(reader: TokenReader) -> tuple[int | None, bool]:
    is_main = reader.is_at(":")
    if not is_main and not (reader.is_at("N") and reader.ahead(1).kind == "number"):
        return None, False
    reader.take()
    if reader.token.kind != "number" or not reader.token.text.isdigit():
        raise reader.problem(f"{reader.shown()} is no block number", "a whole number without sign")
    if len(reader.token.text) > 9:
        raise reader.problem("the block number is too long", "at most 9 digits")
    return int(reader.take().text), is_main


def _label(reader: TokenReader) -> str | None:
    """A name before a colon, unless it is a jump to a main block; a letter with digits is one there too."""
    if reader.is_at(*JUMPS):
        return None
    digits = reader.ahead(1)
    is_split = len(reader.token.text) == 1 and digits.text.isdigit() and digits.is_adjacent
    colon = reader.ahead(2 if is_split else 1)
    if reader.token.kind != "name" or colon.kind != "operator" or colon.text != ":":
        return None
    label = reader.name("a label")
    reader.require(":")
    return label


def _iso_block(text: str, line: int) -> Block:
    """A block of an ISO 6983 control: letters with numbers, comments in round brackets."""
    if text.lstrip().startswith("%"):
        return Block(line, header=text.strip()[1:].strip(), text=text)
    place, comments = 0, list[str]()
    words: list[Word] = []
    number: int | None = None
    skip_level: int | None = None
    if text.lstrip().startswith("/"):
        skip_level, place = 0, text.index("/") + 1
    stop = len(text.rstrip())
    while place < stop:
        comment = _ISO_COMMENT.match(text, place)
        if comment is not None:
            comments.append(comment.group(1))
            place = comment.end()
            continue
        match = _ISO_WORD.match(text, place)
        if match is None:
            raise SyntaxProblem(line, place + 1, f"{text[place]} starts no word", "a letter with a number")
        letter, digits = match.group(1).upper(), match.group(2)
        if letter == "N" and number is None and not words and digits.isdigit():
            number = int(digits)
        else:
            words.append(Word(letter, float(digits), digits, column=match.start(1) + 1))
        place = match.end()
    return Block(line, number, tuple(words), " ".join(comments) or None, skip_level=skip_level, text=text)
