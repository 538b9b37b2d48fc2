"""What was read of the machine, when, and how far it can be trusted. Pure: times are passed in.

Trust goes down by itself, never up: a value is GOOD while it is fresh, STALE when three polls have passed without it
or the device's heartbeat stands still, BAD when the device answered with an error or outside the limits. The last good
value is kept with its age. Nothing is guessed: without a value there is none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from dnc.profile import Register
from dnc.status.registers import Decoded, Place, Value, decode


class Quality(Enum):
    """How far a value can be trusted."""

    GOOD = "GOOD"
    STALE = "STALE"
    BAD = "BAD"


@dataclass(frozen=True, slots=True)
class Reading:
    """One value: read at `read_s` (monotonic), `age_s` ago; `problem` says why it is not GOOD."""

    value: Value | None
    read_s: float | None
    age_s: float | None
    quality: Quality
    problem: str


@dataclass(frozen=True, slots=True)
class MachineStatus:
    """All values at one moment; `is_available` is False when nothing fresh has come for the time that means lost."""

    is_available: bool
    problem: str
    readings: Mapping[str, Reading]
    polls: int
    failures: int
    reconnects: int

    def value(self, name: str) -> Value | None:
        """A value that is GOOD, else None."""
        reading = self.readings.get(name)
        return reading.value if reading is not None and reading.quality is Quality.GOOD else None

    def report(self, read_at: Mapping[str, str]) -> dict[str, Any]:
        """The machine's part of a status report; `read_at` gives wall times by name."""
        return {
            "availability": "AVAILABLE" if self.is_available else "UNAVAILABLE",
            "problem": self.problem,
            "polls": self.polls,
            "failures": self.failures,
            "reconnects": self.reconnects,
            "values": {
                name: {
                    "value": reading.value,
                    "time": read_at.get(name),
                    "age_s": None if reading.age_s is None else round(reading.age_s, 3),
                    "source": "modbus",
                    "quality": reading.quality.value,
                    "problem": reading.problem,
                }
                for name, reading in self.readings.items()
            },
        }


@dataclass(frozen=True, slots=True)
class Trust:
    """When trust goes down; seconds."""

    stale_s: float
    lost_s: float
    heartbeat_s: float


class Ledger:
    """Keeps the last good value of every register and what has gone wrong since."""

    def __init__(self, registers: Mapping[str, Register], trust: Trust) -> None:
        self.registers = registers
        self.trust = trust
        self.polls = self.failures = self.reconnects = 0
        self._good: dict[str, tuple[Value, float]] = {}
        self._problems: dict[str, str] = {}
        self._link_problem = "not connected yet"
        self._answered_s: float | None = None
        self._heartbeat: tuple[Value, float] | None = None
        self._is_mismatch = False

    def answered(self, image: Mapping[Place, int], refused: Mapping[Place, str], now_s: float) -> None:
        """A poll came back: words by place, and places that the device refused with a reason."""
        self.polls += 1
        self._answered_s, self._link_problem = now_s, ""
        decoded = {
            name: self._refused(register, refused) or decode(name, register, image)
            for name, register in self.registers.items()
        }
        version = self.registers.get("map_version")
        is_version_read = version is not None and (version.function, version.address) in image
        self._is_mismatch = is_version_read and decoded["map_version"].value is None
        for name, one in decoded.items():
            self._problems[name] = one.problem
            if one.value is not None and not self._is_mismatch:
                self._good[name] = (one.value, now_s)
        self._note_heartbeat(now_s)

    def failed(self, problem: str) -> None:
        """A poll or a connection did not work."""
        self.failures += 1
        self._link_problem = problem

    def status(self, now_s: float) -> MachineStatus:
        """Everything as it stands now."""
        silence_s = None if self._answered_s is None else now_s - self._answered_s
        is_available = silence_s is not None and silence_s < self.trust.lost_s and not self._is_mismatch
        problem = self._problem(now_s, silence_s)
        readings = {name: self._reading(name, now_s, problem) for name in self.registers}
        if is_available and all(reading.quality is Quality.BAD for reading in readings.values()):
            is_available = False
            why = next((reading.problem for reading in readings.values()), "the profile names no register")
            problem = f"the device answers, but with no value that the profile names ({why})"
        return MachineStatus(is_available, problem, readings, self.polls, self.failures, self.reconnects)

    def _problem(self, now_s: float, silence_s: float | None) -> str:
        if self._is_mismatch:
            return "map mismatch: the device does not serve the register map of this profile"
        if silence_s is None or silence_s >= self.trust.stale_s:
            return self._link_problem or "the device does not answer"
        if self._heartbeat is not None and now_s - self._heartbeat[1] >= self.trust.heartbeat_s:
            return "the device answers, but its heartbeat stands still"
        return ""

    def _reading(self, name: str, now_s: float, problem: str) -> Reading:
        own = self._problems.get(name, "")
        value, read_s = self._good.get(name, (None, None))
        age_s = None if read_s is None else now_s - read_s
        if self._is_mismatch:
            return Reading(None, None, None, Quality.BAD, problem)
        if own:
            return Reading(value, read_s, age_s, Quality.BAD, own)
        if problem or age_s is None or age_s >= self.trust.stale_s:
            shown = None if age_s is None or age_s >= self.trust.lost_s else value
            return Reading(shown, read_s, age_s, Quality.STALE, problem)
        return Reading(value, read_s, age_s, Quality.GOOD, "")

    @staticmethod
    def _refused(register: Register, refused: Mapping[Place, str]) -> Decoded | None:
        reason = refused.get((register.function, register.address))
        return None if reason is None else Decoded(None, reason)

    def _note_heartbeat(self, now_s: float) -> None:
        beat = self._good.get("heartbeat")
        if beat is not None and (self._heartbeat is None or self._heartbeat[0] != beat[0]):
            self._heartbeat = beat[0], now_s
