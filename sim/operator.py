"""The operator of the virtual mill: cycle start, the keys that `--fault` names, cycle start again after a stop.

I/O-free; times in machine seconds. What a key does is the mill's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from sim.faults import Faults, Moment

Press = Callable[[float], None]


@dataclass(frozen=True, slots=True)
class Key:
    """What pressing does at a machine time, and what ends it when its moment lasts; None: nothing does."""

    press: Press
    release: Press | None = None


class Operator:
    """Presses each key once, at the moment that its fault names; `keys` by the names of `Faults`."""

    def __init__(self, faults: Faults, start: Press, go_on: Press, keys: Mapping[str, Key]) -> None:
        self._faults = faults
        self._start = start
        self._go_on = go_on
        self._is_started = False
        self._answer_s: float | None = None
        moments: dict[str, Moment | None] = {name: getattr(faults, name) for name in keys}
        self._waiting = [(moment, keys[name]) for name, moment in moments.items() if moment is not None]
        self._held: list[tuple[float, Press]] = []

    def sees_stop(self, now_s: float) -> None:
        """The program waits for cycle start, which comes after the time the operator takes."""
        self._answer_s = now_s + self._faults.stop_answer

    def act(self, now_s: float, received_bytes: int) -> None:
        """Do what is due."""
        if not self._is_started and now_s >= self._faults.cycle_start:
            self._is_started = True
            self._start(now_s)
        if self._answer_s is not None and now_s >= self._answer_s:
            self._answer_s = None
            self._go_on(now_s)
        for moment, key in [*self._waiting]:
            if moment.has_come(now_s, received_bytes):
                self._waiting.remove((moment, key))
                key.press(now_s)
                if key.release is not None and moment.for_s is not None:
                    self._held.append((now_s + moment.for_s, key.release))
        for until_s, release in [*self._held]:
            if now_s >= until_s:
                self._held.remove((until_s, release))
                release(now_s)
