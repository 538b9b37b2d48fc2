"""The handshake: who may talk when. All job states and all causes that change them stand in TABLE, and nowhere else.

A pair that is missing in the table changes nothing. No cause but RESUME, an act of the operator, leads from PAUSED to
SENDING, and none at all leads out of ABORTED or FAULTED except loading a program anew. PROTOCOL.md prints this table.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

from dnc.events import JobState

_LOW_SEVEN_BITS = 0x7F
SYN = 0x16
NAK = 0x15


class Cause(Enum):
    """Everything that can change the state of a job, as a sentence for the operator."""

    LOAD = "a program was loaded"
    START = "the operator started the job"
    START_AND_WAIT = "the operator started the job; the control must send the first XON"
    START_TIMEOUT = "the control did not send the first XON in time"
    XON = "the control sent XON"
    XOFF = "the control sent XOFF"
    PAUSE_REACHED = "the block ended after a pause was asked for"
    RESUME = "the operator resumed"
    RESUME_HELD = "the operator resumed while the control holds"
    ALL_TAKEN = "the last byte left the program"
    DRAINED = "the last byte left the host"
    TRAILER_LEFT = "the control stopped reading after the end of the program"
    HOLD_TIMEOUT = "the control held longer than --hold-timeout"
    DISTURBED = "the line or the host was disturbed"
    ABORT = "the operator aborted the job"
    CONTROL_RESET = "the control was reset"
    CONTROL_ALARM = "the control raised an alarm"
    FAULT = "the line cannot be trusted"
    LOST = "the port was lost"


_S = JobState
_STOPS: dict[Cause, JobState] = {
    Cause.ABORT: _S.ABORTED,
    Cause.CONTROL_RESET: _S.ABORTED,
    Cause.CONTROL_ALARM: _S.FAULTED,
    Cause.FAULT: _S.FAULTED,
    Cause.LOST: _S.FAULTED,
}
_OF_STATE: dict[JobState, dict[Cause, JobState]] = {
    _S.EMPTY: {Cause.LOAD: _S.LOADED},
    _S.LOADED: {Cause.LOAD: _S.LOADED, Cause.START: _S.SENDING, Cause.START_AND_WAIT: _S.ARMED, **_STOPS},
    _S.ARMED: {Cause.XON: _S.SENDING, Cause.START_TIMEOUT: _S.LOADED, **_STOPS},
    _S.SENDING: {
        Cause.XOFF: _S.HELD,
        Cause.PAUSE_REACHED: _S.PAUSED,
        Cause.DISTURBED: _S.PAUSED,
        Cause.ALL_TAKEN: _S.DRAINING,
        **_STOPS,
    },
    _S.HELD: {
        Cause.XON: _S.SENDING,
        Cause.PAUSE_REACHED: _S.PAUSED,
        Cause.DISTURBED: _S.PAUSED,
        Cause.TRAILER_LEFT: _S.SENT,
        Cause.HOLD_TIMEOUT: _S.FAULTED,
        **_STOPS,
    },
    _S.PAUSED: {Cause.RESUME: _S.SENDING, Cause.RESUME_HELD: _S.HELD, **_STOPS},
    _S.DRAINING: {Cause.DRAINED: _S.SENT, Cause.HOLD_TIMEOUT: _S.FAULTED, **_STOPS},
    _S.SENT: {Cause.LOAD: _S.LOADED},
    _S.ABORTED: {Cause.LOAD: _S.LOADED},
    _S.FAULTED: {Cause.LOAD: _S.LOADED},
}
TABLE: dict[tuple[JobState, Cause], JobState] = {
    (state, cause): after for state, row in _OF_STATE.items() for cause, after in row.items()
}


def table_markdown() -> str:
    """The table as PROTOCOL.md prints it: one row a state, its causes and what follows."""
    rows = ["| in state | because | goes to |", "|---|---|---|"]
    rows += [f"| {state.value} | {cause.value} | {after.value} |" for (state, cause), after in TABLE.items()]
    return "\n".join(rows) + "\n"


class Signal(Enum):
    """What a byte from the control means."""

    XON = "XON"
    XOFF = "XOFF"
    RESET = "reset (SYN after XOFF)"
    ALARM = "alarm (NAK after XOFF)"
    NOISE = "no meaning here"


@dataclass(frozen=True, slots=True)
class Heard:
    """One signal, or a run of bytes without meaning; `is_masked` when XOFF or XON came with another bit 7."""

    signal: Signal
    is_masked: bool = False
    data: bytes = b""


def signal_behind_xoff(byte: int) -> Signal | None:
    """What a byte says that follows XOFF directly: SYN a reset, NAK an alarm, others nothing."""
    return {SYN: Signal.RESET, NAK: Signal.ALARM}.get(byte & _LOW_SEVEN_BITS)


class Listener:
    """Turns bytes from the control into signals, keeping only what the last signal was.

    XON and XOFF are compared on the low 7 bits (DC3 leaves a control with even parity as 0x93), unless the two
    characters agree there. SYN and NAK count only directly behind XOFF, as FANUC's remote buffer sends them.
    """

    def __init__(self, xon: int, xoff: int) -> None:
        self._xon, self._xoff = xon, xoff
        self._mask = 0xFF if (xon ^ xoff) & _LOW_SEVEN_BITS == 0 else _LOW_SEVEN_BITS
        self._last = Signal.XON

    def hear(self, data: bytes) -> Iterator[Heard]:
        """The signals in these bytes, in order; neighbouring bytes without meaning come as one."""
        noise = bytearray()
        for byte in data:
            heard = self._meaning(byte)
            self._last = heard.signal
            if heard.signal is Signal.NOISE:
                noise.append(byte)
                continue
            if noise:
                yield Heard(Signal.NOISE, data=bytes(noise))
                noise.clear()
            yield heard
        if noise:
            yield Heard(Signal.NOISE, data=bytes(noise))

    def _meaning(self, byte: int) -> Heard:
        if (byte ^ self._xoff) & self._mask == 0:
            return Heard(Signal.XOFF, is_masked=byte != self._xoff)
        if (byte ^ self._xon) & self._mask == 0:
            return Heard(Signal.XON, is_masked=byte != self._xon)
        told = signal_behind_xoff(byte) if self._last is Signal.XOFF else None
        return Heard(told or Signal.NOISE)
