"""What the serial interface and the control of the mill tell each other, and how it crosses between their processes.

The interface must never wait while the control thinks, as a UART does not wait for a block to be prepared; so the two
run as two processes joined by a socket pair. In tests the same values pass by plain calls.
"""

from __future__ import annotations

import socket

import msgspec


class Start(msgspec.Struct, frozen=True, tag=True):
    """To the control: machine time is zero at this monotonic time, s."""

    begun_wall_s: float


class Heard(msgspec.Struct, frozen=True, tag=True):
    """To the control: bytes that are in the ring, how many ever arrived, how many were lost because it was full."""

    data: bytes
    received_bytes: int
    overrun_bytes: int


class Finish(msgspec.Struct, frozen=True, tag=True):
    """To the control: end the work and send the result."""


class Took(msgspec.Struct, frozen=True, tag=True):
    """From the control: it has read this many bytes out of the ring."""

    count: int


class Began(msgspec.Struct, frozen=True, tag=True):
    """From the control: cycle start was pressed on the program from outside."""


class StopReading(msgspec.Struct, frozen=True, tag=True):
    """From the control: it will read no more."""


class BrokeOff(msgspec.Struct, frozen=True, tag=True):
    """From the control: reset or alarm; DC3 and this mark go out."""

    mark: bytes


class Power(msgspec.Struct, frozen=True, tag=True):
    """From the control: it was switched off or on."""

    is_on: bool


class Completed(msgspec.Struct, frozen=True, tag=True):
    """From the control: the program has ended and the axes stand still."""


class Ready(msgspec.Struct, frozen=True, tag=True):
    """From the control: it is warm; where its status is served."""

    modbus: str


class Failed(msgspec.Struct, frozen=True, tag=True):
    """From the control's process: it cannot start; one sentence."""

    sentence: str
    exit_code: int


class Result(msgspec.Struct, frozen=True, tag=True):
    """From the control: its part of the report, as JSON."""

    report: str


Order = Took | Began | StopReading | BrokeOff | Power | Completed
Message = Start | Heard | Finish | Took | Began | StopReading | BrokeOff | Power | Completed | Ready | Failed | Result


class Wire:
    """One end of the socket pair: whole messages out and in; neither direction ever waits."""

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self._end = end
        self._unsent = bytearray()
        self._unread = bytearray()
        self.is_closed = False

    def fileno(self) -> int:
        """For select."""
        return self._end.fileno()

    @property
    def has_unsent(self) -> bool:
        """Something waits for the other end to read."""
        return bool(self._unsent)

    def send(self, message: Message) -> None:
        """Queue a message and hand over what the socket takes."""
        body = msgspec.msgpack.encode(message)
        self._unsent += len(body).to_bytes(4, "big") + body
        self.flush()

    def flush(self) -> None:
        """Hand over what the socket takes."""
        try:
            while self._unsent:
                del self._unsent[: self._end.send(self._unsent)]
        except BlockingIOError:
            return
        except OSError:
            self.is_closed = True
            self._unsent.clear()

    def receive(self) -> list[Message]:
        """The whole messages that have come; `is_closed` says that no more will."""
        try:
            while data := self._end.recv(1 << 16):
                self._unread += data
            self.is_closed = True
        except BlockingIOError:
            pass
        except OSError:
            self.is_closed = True
        messages: list[Message] = []
        while len(self._unread) >= 4 and len(self._unread) >= (size := 4 + int.from_bytes(self._unread[:4], "big")):
            messages.append(msgspec.msgpack.decode(bytes(self._unread[4:size]), type=Message))
            del self._unread[:size]
        return messages
