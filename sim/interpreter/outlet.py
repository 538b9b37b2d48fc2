"""The order of canonical commands while some of them wait: a slot keeps the place of spans not yet determined."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from sim.interpreter.canon import Command


@dataclass(slots=True)
class Slot:
    """A place in the order; `commands` is None until it is filled."""

    commands: Sequence[Command] | None = None


class Outlet:
    """Commands in the order of their blocks; nothing overtakes a slot that is still empty."""

    def __init__(self) -> None:
        self._waiting: deque[Command | Slot] = deque()

    @property
    def is_empty(self) -> bool:
        """Whether nothing waits."""
        return not self._waiting

    def put(self, command: Command) -> None:
        """Add a command that is complete."""
        self._waiting.append(command)

    def reserve(self) -> Slot:
        """Keep a place; set the slot's commands when they are known, to an empty list if there are none."""
        slot = Slot()
        self._waiting.append(slot)
        return slot

    @property
    def count(self) -> int:
        """Commands and empty slots that wait, for `withdraw`."""
        return len(self._waiting)

    def withdraw(self, count: int) -> None:
        """Take back all but the first `count` that wait: their block has been refused."""
        while len(self._waiting) > count:
            self._waiting.pop()

    def abandon(self) -> None:
        """Nothing will fill the empty slots any more."""
        for waiting in self._waiting:
            if isinstance(waiting, Slot) and waiting.commands is None:
                waiting.commands = []

    def drain(self) -> list[Command]:
        """All commands before the first empty slot, which leave the outlet."""
        ready: list[Command] = []
        waiting = self._waiting
        while waiting:
            first = waiting[0]
            if isinstance(first, Slot):
                if first.commands is None:
                    break
                ready.extend(first.commands)
            else:
                ready.append(first)
            waiting.popleft()
        return ready
