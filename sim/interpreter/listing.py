"""Canonical commands as text, one a line with fixed decimals: what golden files hold and `dnc check` can show."""

from __future__ import annotations

import math
from enum import Enum

from sim.interpreter.canon import Command


def listed(command: Command, decimals: int = 6) -> str:
    """One command: line, block, name, then its values in order; no `-0`.

    >>> from sim.interpreter.canon import Line
    >>> listed(Line(3, 10, (0.0, 0.0, 0.0), (1.5, -1e-9, 2.0), 250.0))
    '3 N10 Line (0 0 0) (1.5 0 2) 250'
    """
    number = "-" if command.block is None else f"N{command.block}"
    names = [name for name in command.__struct_fields__ if name not in ("line", "block", "is_machine")]
    values = " ".join(_shown(getattr(command, name), decimals) for name in names)
    return f"{command.line} {number} {type(command).__name__} {values}".rstrip()


def _shown(value: object, decimals: int) -> str:
    if isinstance(value, tuple):
        return "(" + " ".join(_shown(one, decimals) for one in value) + ")"
    if isinstance(value, float) and math.isfinite(value):
        text = f"{value:.{decimals}f}".rstrip("0").rstrip(".")
        return "0" if text == "-0" else text
    if isinstance(value, Enum):
        return str(value.value)
    return f'"{value}"' if isinstance(value, str) else str(value)
