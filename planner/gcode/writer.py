"""Text from words and blocks: the spelling a dialect wants, in as few characters as it allows."""

from __future__ import annotations

from collections.abc import Iterable

from planner.gcode.dialect import SINUMERIK, Dialect
from planner.gcode.expression import Binary, Call, Expression, Name, Number, Text, Unary
from planner.gcode.program import Block
from planner.gcode.words import Word


def write_word(word: Word) -> str:
    """One word as text.

    >>> write_word(Word("X", 1.5, "1.5")), write_word(Word("CR", 5.0, "5")), write_word(Word("POLY"))
    ('X1.5', 'CR=5', 'POLY')
    """
    index = "" if word.index is None else "[" + ",".join(map(write_expression, word.index)) + "]"
    equals = "=" if word.is_assigned or (word.value is not None and word.needs_equals) else ""
    if word.arguments is not None:
        return f"{word.address}{index}{equals}({_listed(word.arguments)})"
    if word.value is None:
        return word.address + index
    value = (word.text or f"{word.value:.15g}") if isinstance(word.value, float) else write_expression(word.value)
    return f"{word.address}{index}{equals}{value}"


def write_words(words: Iterable[Word], *, separator: str = " ") -> str:
    """Words as one block's text; with separator "" a blank is kept only where two words would run together.

    >>> write_words([Word("G", 1.0, "1"), Word("X", 2.0, "2"), Word("POLY"), Word("Y", 3.0, "3")], separator="")
    'G1X2 POLY Y3'
    """
    text = ""
    for word in words:
        written = write_word(word)
        needs_blank = bool(text) and (
            len(word.address) > 1 or text[-1].isalpha() or text[-1] == "_" or written[0] == "E"
        )
        text += (separator or (" " if needs_blank else "") if text else "") + written
    return text


def write_block(block: Block, dialect: Dialect = SINUMERIK, *, separator: str = " ") -> str:
    """A block as text without its end; skip level, number, words, comment in this order.

    Raises ValueError for a block with a statement or a label: only programs made here are written.
    """
    if block.statement is not None or block.label is not None:
        raise ValueError("blocks with statements or labels are not written")
    if block.header is not None:
        return f"%{block.header}"
    head: list[Word] = []
    if block.number is not None:
        head.append(Word(":" if block.is_main else "N", float(block.number), str(block.number)))
    text = write_words((*head, *block.words), separator=separator)
    if block.skip_level is not None:
        text = f"/{block.skip_level or ''}{' ' if block.skip_level else ''}{text}"
    if block.comment is None:
        return text
    return f"{text} {dialect.comment(block.comment)}" if text else dialect.comment(block.comment)


def write_expression(expression: Expression) -> str:
    """An expression as text; every operation inside another stands in parentheses."""
    match expression:
        case Number(_, text):
            return text
        case Text(value):
            return f'"{value}"'
        case Name(name, None):
            return name
        case Name(name, indices):
            return f"{name}[{_listed(indices or ())}]"
        case Call(name, arguments):
            return f"{name}({_listed(arguments)})"
        case Unary(operator, operand):
            return f"{operator}{' ' if operator[-1].isalpha() else ''}{_inner(operand)}"
        case Binary(operator, left, right):
            blank = " " if operator[0].isalpha() else ""
            return f"{_inner(left)}{blank}{operator}{blank}{_inner(right)}"


def _inner(expression: Expression) -> str:
    text = write_expression(expression)
    return f"({text})" if isinstance(expression, Binary | Unary) else text


def _listed(expressions: Iterable[Expression | None]) -> str:
    return ",".join("" if expression is None else write_expression(expression) for expression in expressions)
