"""The switchboard: everything the mill can be told to do wrong, or to do as an operator would; `--fault NAME=VALUE`.

One frozen value holds all switches. A moment is `12.5` (machine seconds) or `4000b` (bytes received) and may last:
`12.5+2` or `4000b+2`. An ordinal such as `2` or `1,3` or `all` names which DC1 or DC3 a switch means.
"""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any

from planner.errors import SettingsRejected


class StartRule(Enum):
    """What the control says when its operator has pressed cycle start."""

    IMMEDIATE = "immediate"
    XON = "xon"
    REPEATED_XON = "repeat-xon"


class ReplyParity(Enum):
    """What the eighth bit of the control's own bytes is: nothing, or even parity over the lower seven."""

    NONE = "none"
    EVEN = "even"


@dataclass(frozen=True, slots=True)
class Moment:
    """A machine time or a count of received bytes, and how long what begins there lasts (None: for good)."""

    at_s: float | None
    at_bytes: int | None
    for_s: float | None

    def has_come(self, now_s: float, received_bytes: int) -> bool:
        """The moment is now or was earlier."""
        if self.at_bytes is not None:
            return received_bytes >= self.at_bytes
        return self.at_s is not None and now_s >= self.at_s


@dataclass(frozen=True, slots=True)
class Ordinals:
    """Which of a sequence (from 1); `every` means all."""

    numbers: frozenset[int] = frozenset()
    every: bool = False

    def names(self, number: int) -> bool:
        """This one is meant."""
        return self.every or number in self.numbers


@dataclass(frozen=True, slots=True)
class Faults:
    """Every switch at its harmless position."""

    fifo: int = 16
    """bytes that the adapter at the host's end holds"""
    reaction: float = 0.0
    """s from the byte that fills the buffer to the mark until DC3 begins to leave"""
    start: StartRule | None = None
    """what the control says at cycle start; unless set, what its profile has the sending side wait for"""
    cycle_start: float = 0.0
    """s after which the operator presses cycle start"""
    xon_delay: float = 0.0
    """s by which every DC1 is late"""
    xoff_delay: float = 0.0
    """s by which every DC3 is late"""
    lose_xon: Ordinals = Ordinals()
    """these DC1 never leave"""
    lose_xoff: Ordinals = Ordinals()
    """these DC3 never leave"""
    double_xon: Ordinals = Ordinals()
    """these DC1 leave twice"""
    double_xoff: Ordinals = Ordinals()
    """these DC3 leave twice"""
    noise: float = 0.0
    """random bytes per second that reach the host"""
    drop: float = 0.0
    """probability that a byte to the control is lost"""
    flip: float = 0.0
    """probability that one bit of a byte to the control is turned"""
    parity: ReplyParity = ReplyParity.NONE
    """parity of the control's bytes: with even parity DC3 leaves as 0x93"""
    silence: Moment | None = None
    """from here on the control says nothing"""
    unplug: Moment | None = None
    """the adapter is pulled out"""
    slow_drain: float = 1.0
    """factor on the time that the control takes for each block"""
    end_stops_reading: bool = False
    """M30 leaves the control with DC3 said and deaf"""
    stop_answer: float = 1.0
    """s until the operator presses cycle start at M0, M1, single block"""
    optional_stop: bool = False
    """M1 stops"""
    single_block: Moment | None = None
    """single block is on"""
    override: float = 100.0
    """feed override in per cent"""
    feed_hold: Moment | None = None
    """feed hold is pressed, and cycle start after the time it lasts"""
    reset: Moment | None = None
    """reset is pressed: DC3 SYN"""
    alarm: Moment | None = None
    """the control alarms by itself: DC3 NAK"""
    power_cycle: Moment | None = None
    """the control is switched off, and on again after the time this lasts"""


def parse_faults(words: Iterable[str]) -> Faults:
    """The switches set by words `NAME=VALUE`; raises SettingsRejected with the nearest name or the form wanted."""
    fields = {field.name.replace("_", "-"): field for field in dataclasses.fields(Faults)}
    chosen: dict[str, Any] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if name not in fields:
            near = difflib.get_close_matches(name, fields, n=1)
            remedy = f"did you mean {near[0]}?" if near else f"known: {', '.join(fields)}"
            raise SettingsRejected(f"--fault {word}: there is no fault {name!r}", remedy=remedy)
        read, form = _READERS[str(fields[name].type)]
        try:
            if not equals:
                raise ValueError
            chosen[fields[name].name] = read(text)
        except ValueError:
            raise SettingsRejected(f"--fault {word}: {text!r} does not fit", remedy=f"write {name}={form}") from None
    return Faults(**chosen)


def _moment(text: str) -> Moment:
    place, plus, lasts = text.partition("+")
    for_s = _not_negative(lasts) if plus else None
    if place.endswith("b"):
        return Moment(at_s=None, at_bytes=_count(place[:-1]), for_s=for_s)
    return Moment(at_s=_not_negative(place), at_bytes=None, for_s=for_s)


def _ordinals(text: str) -> Ordinals:
    if text == "all":
        return Ordinals(every=True)
    return Ordinals(frozenset(_count(part) for part in text.split(",")))


def _count(text: str) -> int:
    number = int(text)
    if number < 1:
        raise ValueError
    return number


def _not_negative(text: str) -> float:
    number = float(text)
    if not 0.0 <= number < 1e9:
        raise ValueError
    return number


def _switch(text: str) -> bool:
    if text not in ("yes", "no"):
        raise ValueError
    return text == "yes"


_READERS: dict[str, tuple[Callable[[str], object], str]] = {
    "int": (_count, "a count from 1"),
    "float": (_not_negative, "a number from 0"),
    "bool": (_switch, "yes or no"),
    "StartRule | None": (StartRule, "immediate, xon or repeat-xon"),
    "ReplyParity": (ReplyParity, "none or even"),
    "Ordinals": (_ordinals, "2, or 1,3, or all"),
    "Moment | None": (_moment, "12.5 (seconds) or 4000b (bytes), with +2 if it lasts 2 s"),
}
