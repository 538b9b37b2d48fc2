"""Expressions and words from tokens, by descent with bounded depth."""

from __future__ import annotations

from planner.gcode.expression import Binary, Call, Expression, Name, Number, Text, Unary
from planner.gcode.lexer import SyntaxProblem, Token
from planner.gcode.words import Word

# The manual's order: arithmetic, bits, logic, joining of texts, and comparisons last (hence its parentheses).
_PRECEDENCE = {
    "*": 10, "/": 10, "DIV": 10, "MOD": 10,
    "+": 9, "-": 9,
    "B_AND": 8, "B_XOR": 7, "B_OR": 6,
    "AND": 5, "XOR": 4, "OR": 3,
    "<<": 2,
    "==": 1, "<>": 1, ">": 1, "<": 1, ">=": 1, "<=": 1,
}  # fmt: skip
_PREFIXES = frozenset({"-", "+", "NOT", "B_NOT"})
MAX_DEPTH = 40
FIXED_ADDRESSES = frozenset("NGL")


class TokenReader:
    """A cursor over the tokens of one block."""

    def __init__(self, tokens: list[Token], line: int) -> None:
        self._tokens, self._line, self._at, self._depth = tokens, line, 0, 0

    @property
    def token(self) -> Token:
        """The token under the cursor; `end` after the last."""
        return self._tokens[self._at]

    def ahead(self, count: int) -> Token:
        """The token `count` places on."""
        return self._tokens[min(self._at + count, len(self._tokens) - 1)]

    def take(self) -> Token:
        """The token under the cursor; the cursor moves on."""
        token = self.token
        if token.kind != "end":
            self._at += 1
        return token

    def is_at(self, *texts: str) -> bool:
        """Whether one of these operators or names stands here."""
        return self.token.kind in ("operator", "name") and self.token.text in texts

    def accept(self, text: str) -> bool:
        """Pass over `text` if it stands here."""
        if self.is_at(text):
            self._at += 1
            return True
        return False

    def require(self, text: str) -> None:
        """Pass over `text`; SyntaxProblem if something else stands here."""
        if not self.accept(text):
            raise self.problem(f"{self.shown()} stands here", text)

    def name(self, expected: str) -> str:
        """A name, a label or a variable with digits."""
        if self.token.kind != "name":
            raise self.problem(f"{self.shown()} stands here", expected)
        return self._joined_name()

    def shown(self) -> str:
        """The token under the cursor for a message."""
        return "the end of the block" if self.token.kind == "end" else self.token.text

    def problem(self, what: str, expected: str) -> SyntaxProblem:
        """A problem at the cursor."""
        return SyntaxProblem(self._line, self.token.column, what, expected)

    def expression(self, minimum: int = 1) -> Expression:
        """The longest expression from here, by precedence climbing."""
        left = self._operand()
        while self.token.kind in ("operator", "name"):
            rank = _PRECEDENCE.get(self.token.text, 0)
            if rank < minimum:
                break
            operator = self.take().text
            left = Binary(operator, left, self._deeper(rank + 1))
        return left

    def arguments(self, closing: str) -> tuple[Expression | None, ...]:
        """Expressions with commas between, up to the closing bracket; one left out is None."""
        found: list[Expression | None] = []
        if self.accept(closing):
            return ()
        while True:
            found.append(None if self.is_at(",", closing) else self.expression())
            if self.accept(closing):
                return tuple(found)
            if not self.accept(","):
                raise self.problem(f"{self.shown()} stands here", f", or {closing}")

    def indices(self) -> tuple[Expression, ...]:
        """What stands in square brackets, the opening one already passed; nothing left out."""
        start = self.token
        found = self.arguments("]")
        if any(index is None for index in found):
            raise SyntaxProblem(self._line, start.column, "an index is left out", "a value before each comma")
        return tuple(index for index in found if index is not None)

    def word(self) -> Word:
        """The word that starts here."""
        start = self.token
        if start.kind != "name":
            raise self._no_word()
        if start.text == "O" and self._follows_number():
            raise self.problem("the letter O stands in a number", "the digit 0")
        if start.text == "E" and self._follows_number():
            raise self.problem("the letter E stands in a number", "EX before an exponent")
        self.take()
        if len(start.text) == 1:
            number = self._plain_number(start)
            if number is not None:
                return number
        address = start.text
        if len(address) == 1 and self.token.kind == "number" and self.token.is_adjacent:
            address += self.take().text
        return self._named_word(address, start)

    def _no_word(self) -> SyntaxProblem:
        """What stands under the cursor starts no word; behind a number it is mostly a slip of the keys."""
        if self.is_at(",") and self._follows_number():
            return self.problem("a comma stands in a number", "a point, such as X10.5")
        if self.token.text.startswith(".") and self._follows_number():
            return self.problem("a number has two points", "one")
        return self.problem(f"{self.shown()} starts no word", "an address, a name or ;")

    def _follows_number(self) -> bool:
        return self._at > 0 and self._tokens[self._at - 1].kind == "number" and self.token.is_adjacent

    def _named_word(self, address: str, start: Token) -> Word:
        index = self.indices() if self.accept("[") else None
        if self.accept("="):
            if address in FIXED_ADDRESSES:
                raise self.problem(f"{address} takes no expression", f"a number right after {address}")
            return self._assigned(address, index, start)
        if self.accept("("):
            return Word(address, arguments=self.arguments(")"), index=index, column=start.column)
        if self.token.kind == "string":
            return Word(address, arguments=(Text(self.take().text),), index=index, column=start.column)
        if len(address) == 1 or index is not None:
            raise self.problem(f"{address} has no value", "a number or =")
        return Word(address, index=index, column=start.column)

    def _assigned(self, address: str, index: tuple[Expression, ...] | None, start: Token) -> Word:
        if address == "PO" and self.accept("("):
            values = self.arguments(")")
            return Word(address, arguments=values, index=index, column=start.column, is_assigned=True)
        value = self.expression()
        if isinstance(value, Number):
            return Word(address, value.value, value.text, None, index, start.column, is_assigned=True)
        if isinstance(value, Unary) and value.operator in "+-" and isinstance(value.operand, Number):
            signed = -value.operand.value if value.operator == "-" else value.operand.value
            text = value.operator + value.operand.text
            return Word(address, signed, text, None, index, start.column, is_assigned=True)
        return Word(address, value, "", None, index, start.column, is_assigned=True)

    def _plain_number(self, start: Token) -> Word | None:
        """The number right after a letter, unless it is the extension of an address (`I1=`)."""
        sign = ""
        is_extension = self.token.is_adjacent and self.token.text.isdigit() and self.ahead(1).text in ("=", "[")
        if self.is_at("-", "+") and self.ahead(1).kind == "number":
            sign = self.take().text
        elif self.token.kind != "number" or is_extension:
            return None
        token = self.take()
        value = -token.value if sign == "-" else token.value
        return Word(start.text, value, sign + token.text, None, None, start.column)

    def _joined_name(self) -> str:
        token = self.take()
        if (
            len(token.text) == 1
            and self.token.kind == "number"
            and self.token.is_adjacent
            and self.token.text.isdigit()
        ):
            return token.text + self.take().text
        return token.text

    def _deeper(self, minimum: int) -> Expression:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise self.problem("the expression is nested too deeply", f"at most {MAX_DEPTH} levels")
        found = self.expression(minimum)
        self._depth -= 1
        return found

    def _operand(self) -> Expression:
        token = self.token
        if self.is_at(*_PREFIXES):
            operator = self.take().text
            return Unary(operator, self._deeper(11))
        if self.accept("("):
            inner = self._deeper(1)
            self.require(")")
            return inner
        if token.kind in ("number", "literal"):
            self.take()
            return Number(token.value, token.text)
        if token.kind == "string":
            return Text(self.take().text)
        if token.kind == "name":
            return self._reference()
        raise self.problem(f"{self.shown()} stands here", "a value")

    def _reference(self) -> Expression:
        name = self._joined_name()
        if self.accept("["):
            return Name(name, self.indices())
        if self.is_at("("):
            self.take()
            self._depth += 1
            if self._depth > MAX_DEPTH:
                raise self.problem("the expression is nested too deeply", f"at most {MAX_DEPTH} levels")
            arguments = self.arguments(")")
            self._depth -= 1
            return Call(name, arguments)
        return Name(name)
