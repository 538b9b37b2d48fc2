"""Words: an address with its value, and numbers written in the fewest digits.

A number is a float for arithmetic beside the text it was read as or is written as; writers start from an integer count
of the last digit, so that the number written is exactly the number that was budgeted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from planner.gcode.expression import Expression, Number


@dataclass(frozen=True, slots=True)
class Word:
    """One word of a block: `X10`, `CR=5`, `PO[X]=(1,2,3)`, `MSG("text")`, `POLY`, `R1=R2*2`.

    `address` is in upper case, digits of an extension included (`I1`, `R5`). At most one of `value` and `arguments` is
    set: a plain number is a float with its `text`, anything else after `=` an Expression; a list in round brackets,
    after `=` or not, is `arguments` (an argument left out is None). `index` is what stands in square brackets.
    `column` counts from 1, 0 for a word that was never read.
    """

    address: str
    value: float | Expression | None = None
    text: str = ""
    arguments: tuple[Expression | None, ...] | None = None
    index: tuple[Expression, ...] | None = None
    column: int = 0
    is_assigned: bool = False

    @property
    def number(self) -> float | None:
        """The value where it is a plain number."""
        return self.value if isinstance(self.value, float) else None

    @property
    def needs_equals(self) -> bool:
        """Whether the language wants `=` between address and value (more than one character, or an expression)."""
        return len(self.address) > 1 or not isinstance(self.value, float)


def decimal_text(units: int, decimals: int, *, keeps_point: bool = False, keeps_zero: bool = False) -> str:
    """`units` of the last of `decimals` digits, in the fewest characters the language allows; never `-0`.

    >>> decimal_text(12500, 3), decimal_text(-500, 3), decimal_text(0, 3), decimal_text(10000, 3)
    ('12.5', '-.5', '0', '10')
    >>> decimal_text(10000, 3, keeps_point=True), decimal_text(-500, 3, keeps_zero=True)
    ('10.', '-0.5')

    Raises ValueError when `decimals` is negative.
    """
    if decimals < 0:
        raise ValueError("decimals must not be negative")
    digits = str(abs(units)).rjust(decimals + 1, "0")
    whole, fraction = digits[: len(digits) - decimals], digits[len(digits) - decimals :].rstrip("0")
    sign = "-" if units < 0 else ""
    if not fraction:
        return f"{sign}{whole}." if keeps_point else f"{sign}{whole}"
    return f"{sign}{'' if whole == '0' and not keeps_zero else whole}.{fraction}"


def rounded_units(value: float, decimals: int) -> int:
    """The integer of last digits nearest to `value`.

    >>> rounded_units(1.2345, 3), rounded_units(-0.0004, 3)
    (1234, 0)
    """
    return round(value * 10.0**decimals)


def units_above(value_mm: float, unit_mm: float, decimals: int) -> int:
    """The smallest integer of last digits, of a unit, that is not below `value_mm` as it is written in decimals.

    >>> units_above(50.0, 25.4, 4), units_above(10.16, 25.4, 4), units_above(-2.00001, 1.0, 4)
    (19686, 4000, -20000)
    """
    return math.ceil(Fraction(str(value_mm)) / Fraction(str(unit_mm)) * Fraction(10**decimals))


def value_text(value: float) -> str:
    """A number to be calculated with, in twelve significant digits however small or large it is.

    >>> value_text(2.5), value_text(-1 / 3), value_text(2.5e-7), value_text(-4.0)
    ('2.5', '-0.333333333333', '2.5EX-7', '-4')
    """
    mantissa, _, exponent = f"{value:.12g}".partition("e")
    return f"{mantissa}EX{int(exponent)}" if exponent else mantissa


def number_word(address: str, value: float, decimals: int, *, keeps_point: bool = False) -> Word:
    """A word with `value` rounded to `decimals` digits; its `.value` is the number as written.

    >>> number_word("X", 12.50004, 3)
    Word(address='X', value=12.5, text='12.5', arguments=None, index=None, column=0, is_assigned=False)
    """
    text = decimal_text(rounded_units(value, decimals), decimals, keeps_point=keeps_point)
    return Word(address, float(text), text)


def list_word(address: str, index: Sequence[Expression], values: Sequence[float], decimals: int) -> Word:
    """An indexed word with a list of rounded numbers, such as `PO[X]=(1.5,2)`; trailing zeros of the list are kept."""
    texts = [decimal_text(rounded_units(value, decimals), decimals) for value in values]
    numbers = tuple(Number(float(text), text) for text in texts)
    return Word(address, arguments=numbers, index=tuple(index), is_assigned=True)
