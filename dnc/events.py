"""Words for the state of a job and a link, and the events the sender reports; frozen values, standard library only."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class JobState(Enum):
    """Where the job stands; SENT means that the last byte left the host, not that the part is done."""

    EMPTY = "EMPTY"
    LOADED = "LOADED"
    ARMED = "ARMED"
    SENDING = "SENDING"
    HELD = "HELD"
    PAUSED = "PAUSED"
    DRAINING = "DRAINING"
    SENT = "SENT"
    ABORTED = "ABORTED"
    FAULTED = "FAULTED"


class LinkState(Enum):
    """Where the port stands."""

    CLOSED = "CLOSED"
    OPEN = "OPEN"
    LOCKED = "LOCKED"
    LOST = "LOST"


@dataclass(frozen=True, slots=True)
class Event:
    """Something at `time_s` on the monotonic clock, after `offset_bytes` of the tape had left."""

    time_s: float
    offset_bytes: int


@dataclass(frozen=True, slots=True)
class StateChanged(Event):
    """The job went from one state to another; `cause` is a sentence for the operator."""

    old: JobState
    new: JobState
    cause: str


@dataclass(frozen=True, slots=True)
class Held(Event):
    """XOFF heard; `inflight_bytes` may still reach the control. `is_masked` when it came as 0x93."""

    inflight_bytes: int
    is_masked: bool


@dataclass(frozen=True, slots=True)
class Resumed(Event):
    """XON heard after `held_s`."""

    held_s: float


@dataclass(frozen=True, slots=True)
class Noise(Event):
    """Bytes that mean nothing here; `data` is what arrived."""

    data: bytes


class Severity(Enum):
    """How soon the operator must look."""

    NOTE = "note"
    WARNING = "warning"
    ALARM = "alarm"


@dataclass(frozen=True, slots=True)
class Alarm(Event):
    """Something for the operator: a fixed id, what it means, what to do."""

    id: str
    severity: Severity
    text: str
    remedy: str
