"""Expressions of the control's language as values: what stands after `=` or between brackets, not yet computed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Number:
    """A literal, with the text it was written as."""

    value: float
    text: str


@dataclass(frozen=True, slots=True)
class Text:
    """A string between double quotes, without them."""

    value: str


@dataclass(frozen=True, slots=True)
class Name:
    """A variable, parameter or axis name in upper case; `indices` when it stands before square brackets."""

    name: str
    indices: tuple[Expression, ...] | None = None


@dataclass(frozen=True, slots=True)
class Call:
    """A function of the language, such as SIN(R1) or AC(10); an argument left out is None."""

    name: str
    arguments: tuple[Expression | None, ...]


@dataclass(frozen=True, slots=True)
class Unary:
    """`-`, `+`, `NOT` or `B_NOT` before its operand."""

    operator: str
    operand: Expression


@dataclass(frozen=True, slots=True)
class Binary:
    """Two operands with an operator between them, such as `+`, `==`, `DIV`."""

    operator: str
    left: Expression
    right: Expression


Expression = Number | Text | Name | Call | Unary | Binary
