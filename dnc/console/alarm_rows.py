"""The alarms as rows of the screen: the most urgent first, as many as there is room for, the others counted. Pure."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence

from dnc.console.alarms import AlarmLine
from dnc.console.rows import Row, Span, Tone, row
from dnc.status.text import harmless

_RANKS = {"alarm": 0, "warning": 1}
_TONES = {"alarm": Tone.FAULT, "warning": Tone.ABNORMAL}


def urgent_first(alarms: Sequence[AlarmLine]) -> list[AlarmLine]:
    """What nobody has acknowledged goes first, alarms before warnings before notes; of equals the first out."""
    return sorted(alarms, key=lambda alarm: (alarm.is_acknowledged, _RANKS.get(alarm.severity, 2)))


def alarm_rows(alarms: Sequence[AlarmLine], columns: int, most: int) -> tuple[list[Row], int]:
    """Every alarm with meaning and remedy in at most so many rows, and how many alarms those show.

    The first is always told to its end.
    """
    rows, shown = _as_many(alarms, columns, most, _whole)
    return rows or [row(" alarms: none")], shown


def small_alarm_rows(alarms: Sequence[AlarmLine], columns: int, most: int) -> tuple[list[Row], int]:
    """The same below the size of the screen, where remedies are left out if that lets more alarms be seen."""
    rows, shown = _as_many(alarms, columns, most, _narrow)
    if shown == len(alarms) and len(rows) <= most:
        return rows, shown
    rows, shown = _as_many(alarms, columns, most, _bare)
    return rows[: max(0, most)], shown if len(rows) <= most else 0


def _as_many(
    alarms: Sequence[AlarmLine], columns: int, most: int, made: Callable[[AlarmLine, int], list[Row]]
) -> tuple[list[Row], int]:
    shown: list[Row] = []
    for place, alarm in enumerate(urgent_first(alarms)):
        rows = made(alarm, columns)
        hidden = len(alarms) - place
        if len(shown) + len(rows) + (hidden > 1) > most and shown:
            return [*shown, row(f"   and {hidden} more")], place
        shown += rows
    return shown, len(alarms)


def _whole(alarm: AlarmLine, columns: int) -> list[Row]:
    mark = " " if alarm.is_acknowledged else "!"
    name = Span(f"{mark} {alarm.severity.upper()} {alarm.id}", _TONES.get(alarm.severity, Tone.PLAIN))
    first, *rest = _wrapped(alarm.text, " " * (len(name.text) + 2), "      ", columns) or [""]
    remedy = _wrapped(alarm.remedy, "     -> ", "        ", columns)
    return [row(" ", name, f" {first.lstrip()}"), *(row(line) for line in (*rest, *remedy))]


def _narrow(alarm: AlarmLine, columns: int) -> list[Row]:
    return [*_bare(alarm, columns), *(row(line) for line in _wrapped(alarm.remedy, "-> ", "   ", columns + 1))]


def _bare(alarm: AlarmLine, columns: int) -> list[Row]:
    told = f"{alarm.severity.upper()} {alarm.id} {alarm.text}"
    tone = Tone.PLAIN if alarm.is_acknowledged else _TONES.get(alarm.severity, Tone.PLAIN)
    return [row(Span(line, tone)) for line in _wrapped(told, "", "", columns + 1)]


def _wrapped(text: str, first: str, rest: str, columns: int) -> list[str]:
    """Lines that end before the border, each with its indent; names of ports are not broken at hyphens."""
    width = max(len(first) + 1, len(rest) + 1, columns - 1)
    return textwrap.wrap(harmless(text), width, initial_indent=first, subsequent_indent=rest, break_on_hyphens=False)
