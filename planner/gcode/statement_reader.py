"""Statements from tokens: flow, definitions, heads of subprograms."""

from __future__ import annotations

from collections.abc import Callable

from planner.gcode.expression import Expression, Name
from planner.gcode.parser import TokenReader
from planner.gcode.statement import (
    Case,
    Define,
    Extern,
    For,
    If,
    Jump,
    Mark,
    Marker,
    Procedure,
    RepeatSection,
    Return,
    Statement,
    Until,
    Variable,
    While,
)

JUMPS = ("GOTOF", "GOTOB", "GOTO", "GOTOC")
TYPES = ("REAL", "INT", "BOOL", "CHAR", "STRING", "AXIS")


def is_statement_start(reader: TokenReader) -> bool:
    """Whether a statement, not a word, stands under the cursor."""
    return reader.token.kind == "name" and reader.token.text in _READERS and reader.ahead(1).text != "="


def read_statement(reader: TokenReader) -> Statement:
    """The statement that starts here; SyntaxProblem if it is not complete."""
    return _READERS[reader.token.text](reader)


def _jump(reader: TokenReader) -> Jump:
    keyword = reader.take().text
    return Jump(keyword, _target(reader))


def _target(reader: TokenReader) -> Expression:
    """A label, a block number (`N100`, `:100` or a plain number) or an expression that gives a text."""
    if reader.accept(":"):
        if reader.token.kind != "number":
            raise reader.problem(f"{reader.shown()} is no block number", "a whole number")
        return Name(f":{reader.take().text}")
    return reader.expression()


def _if(reader: TokenReader) -> If | Jump:
    reader.take()
    condition = reader.expression()
    if reader.is_at(*JUMPS):
        keyword = reader.take().text
        return Jump(keyword, _target(reader), condition)
    return If(condition)


def _while(reader: TokenReader) -> While:
    reader.take()
    return While(reader.expression())


def _until(reader: TokenReader) -> Until:
    reader.take()
    return Until(reader.expression())


def _for(reader: TokenReader) -> For:
    reader.take()
    variable = reader.name("the name of a variable")
    index = reader.indices() if reader.accept("[") else None
    reader.require("=")
    first = reader.expression()
    reader.require("TO")
    return For(variable, index, first, reader.expression())


def _mark(reader: TokenReader) -> Mark:
    return Mark(Marker(reader.take().text))


def _repeat(reader: TokenReader) -> Mark | RepeatSection:
    keyword = reader.take().text
    if reader.token.kind == "end" and keyword == "REPEAT":
        return Mark(Marker.REPEAT)
    start = reader.name("a label")
    end = reader.name("a label") if reader.token.kind == "name" and reader.token.text != "P" else None
    count: Expression | None = None
    if reader.is_at("P"):
        reader.take()
        reader.accept("=")
        count = reader.expression()
    return RepeatSection(start, end, count, keyword == "REPEATB")


def _case(reader: TokenReader) -> Case:
    reader.take()
    selector = reader.expression()
    reader.require("OF")
    branches: list[tuple[Expression, Jump]] = []
    default: Jump | None = None
    while reader.token.kind != "end" and default is None:
        if reader.accept("DEFAULT"):
            default = _branch(reader)
        else:
            value = reader.expression()
            branches.append((value, _branch(reader)))
    return Case(selector, tuple(branches), default)


def _branch(reader: TokenReader) -> Jump:
    if not reader.is_at(*JUMPS):
        raise reader.problem(f"{reader.shown()} stands here", "GOTOF, GOTOB, GOTO or GOTOC")
    return _jump(reader)


def _define(reader: TokenReader) -> Define:
    reader.take()
    for scope in ("NCK", "CHAN"):
        reader.accept(scope)
    type_name = _type(reader)
    found = [_variable(reader, type_name)]
    while reader.accept(","):
        found.append(_variable(reader, type_name))
    return Define(tuple(found))


def _type(reader: TokenReader) -> str:
    if not reader.is_at(*TYPES):
        raise reader.problem(f"{reader.shown()} is no type", ", ".join(TYPES))
    name = reader.take().text
    if name == "STRING" and reader.accept("["):
        reader.indices()
    return name


def _variable(reader: TokenReader, type_name: str) -> Variable:
    name = reader.name("a name")
    dimensions = reader.indices() if reader.accept("[") else ()
    if not reader.accept("="):
        return Variable(name, type_name, dimensions)
    if dimensions and (reader.accept("SET") or reader.is_at("(")):
        reader.require("(")
        return Variable(name, type_name, dimensions, initial_list=reader.arguments(")"))
    return Variable(name, type_name, dimensions, reader.expression())


def _procedure(reader: TokenReader) -> Procedure:
    reader.take()
    name = reader.name("the name of the subprogram")
    parameters: list[Variable] = []
    if reader.accept("(") and not reader.accept(")"):
        parameters.append(_parameter(reader))
        while reader.accept(","):
            parameters.append(_parameter(reader))
        reader.require(")")
    attributes: list[str] = []
    while reader.token.kind == "name":
        attributes.append(reader.take().text)
    return Procedure(name, tuple(parameters), tuple(attributes))


def _parameter(reader: TokenReader) -> Variable:
    is_reference = reader.accept("VAR")
    type_name = _type(reader)
    name = reader.name("the name of a parameter")
    initial = reader.expression() if reader.accept("=") else None
    return Variable(name, type_name, initial=initial, is_reference=is_reference)


def _extern(reader: TokenReader) -> Extern:
    reader.take()
    name = reader.name("the name of a subprogram")
    if reader.accept("(") and not reader.accept(")"):
        while True:
            reader.accept("VAR")
            _type(reader)
            if not reader.accept(","):
                break
        reader.require(")")
    return Extern(name)


def _return(reader: TokenReader) -> Return:
    reader.take()
    if reader.accept("("):
        reader.require(")")
    return Return()


_READERS: dict[str, Callable[[TokenReader], Statement]] = {
    **dict.fromkeys(JUMPS, _jump),
    **dict.fromkeys((marker.value for marker in Marker if marker is not Marker.REPEAT), _mark),
    "IF": _if,
    "WHILE": _while,
    "UNTIL": _until,
    "FOR": _for,
    "REPEAT": _repeat,
    "REPEATB": _repeat,
    "CASE": _case,
    "DEF": _define,
    "PROC": _procedure,
    "EXTERN": _extern,
    "RET": _return,
}
