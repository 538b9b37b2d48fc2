"""Numbers of the command line: finite, within what the command can work with, refused in one sentence otherwise."""

from __future__ import annotations

import math
from typing import Any

import click


class Number(click.FloatRange):
    """A number from `min` to `max`; NaN lies in no range, though every comparison with it fails."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number; click's BadParameter for any other text."""
        number = float(super().convert(value, param, ctx))
        if math.isnan(number):
            self.fail(f"{value} is no number", param, ctx)
        return number


class Whole(click.IntRange):
    """A whole number from `min` to `max`, called so where a text is none."""

    name = "whole number"


LONGEST_S = 31_536_000
"""The longest wait that can be asked for: a year, in s."""
