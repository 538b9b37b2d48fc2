"""Programs that the control punches out: finds where each begins and ends, and what it is called. No I/O.

A program ends with DC4, ETX or EOT, with the % that closes one begun by %, or after a silence. NUL, DC1 to DC4 and
other codes of the tape are no part of it; everything else is kept byte by byte.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from enum import Enum

_CODES = bytes([0x00, 0x01, 0x02, 0x11, 0x12, 0x13, 0x16, 0x17, 0x7F])
_ENDS = {0x14: "DC4", 0x03: "ETX", 0x04: "EOT"}
_NAMES = (
    re.compile(rb"^%_N_([A-Za-z0-9_]{1,28})_((?:MPF|SPF|WPD|INI|TEA|CMA))"),
    re.compile(rb"^\$([A-Za-z0-9_-]{1,28})\.(MIN|SUB|LIB)%?"),
    re.compile(rb"^%?\s*([O:]\d{1,8})"),
    re.compile(rb"^%\s*([A-Za-z0-9_-]{1,32})"),
)
_LAST_BLOCK = re.compile(rb"^%$|M0*(?:2|30|17|99)$|^(?:N\d+\s*)?RET$", re.IGNORECASE)
_LINE_END = re.compile(rb"\r\n|\n\r\r|\n\r|\n|\r")
_HEAD_BYTES = 400
_TAIL_BYTES = 64
_SURE_BYTES = 24


class End(Enum):
    """What ended a program."""

    CODE = "a code of the tape"
    PERCENT = "the closing %"
    LAST = "its last block"
    NEXT = "the header of the next program"
    SILENCE = "silence"
    OPEN = "silence behind a block that is no end of a program (M30, M2, M17, RET, %); make sure that it is whole"
    UNCLOSED = "silence, with neither the closing % nor M30, M2, M17 or RET"
    CUT = "silence in the middle of a block"
    EVEN = "the control, with even parity in every character; receive it with --format 7E1"
    ODD = "the control, with odd parity in every character; receive it with --format 7O1"
    FULL = "the size limit"
    BREAK = "a break in the middle"

    @property
    def is_whole(self) -> bool:
        """Whether the control can have said all it had to say."""
        return self not in (End.CUT, End.UNCLOSED, End.EVEN, End.ODD, End.FULL, End.BREAK)


@dataclass(frozen=True, slots=True)
class Received:
    """One whole program; `name` is safe as a file name."""

    name: str
    data: bytes
    end: End


class PunchIn:
    """Feed what arrives; get programs. `silence_s` ends a program, `limit_bytes` protects this computer."""

    def __init__(self, silence_s: float, limit_bytes: int, *, is_seven_bit: bool = False) -> None:
        self._silence_s, self._limit_bytes = silence_s, limit_bytes
        self._mask = bytes(code & 0x7F for code in range(256)) if is_seven_bit else None
        self._data = bytearray()
        self._heard_s = -math.inf

    @property
    def next_wake_s(self) -> float:
        """When silence will have ended the program that is under way."""
        is_under_way = bool(self._data) and not self._data.isspace()  # asked at every byte: nothing is copied
        return self._heard_s + self._silence_s if is_under_way else math.inf

    def hear(self, data: bytes, now_s: float) -> list[Received]:
        """The programs that these bytes complete."""
        self._heard_s = now_s
        done = []
        for code in data if self._mask is None else data.translate(self._mask):
            if code in _ENDS:
                done += self._finished(End.CODE)
            elif code not in _CODES:
                if code not in b"\r\n" and self._is_closed(least_bytes=1):
                    done += self._finished(End.PERCENT)
                self._data.append(code)
                if self._data.endswith(b"%_N_"):
                    done += self._before_header()
                if code in b"\r\n" and self._is_closed(self._line_end_bytes()):
                    done += self._finished(End.PERCENT)
                elif len(self._data) >= self._limit_bytes:
                    done += self._finished(End.FULL)
        return done

    def tick(self, now_s: float) -> list[Received]:
        """The program that silence has ended, if any."""
        if now_s < self.next_wake_s:
            return []
        if self._is_last_block():
            return self._finished(End.SILENCE)
        if not self._data.endswith((b"\r", b"\n")):
            return self._finished(End.CUT)
        return self._finished(End.UNCLOSED if self._is_open_tape() else End.OPEN)

    def break_off(self) -> list[Received]:
        """What has come of the program that is under way, if any: nobody listens any longer."""
        is_ended = self._is_last_block() and not self._is_open_tape()
        return self._finished(End.LAST if is_ended else End.BREAK)

    def _before_header(self) -> list[Received]:
        """The program that the header of another one ends, if the last thing that came begins one."""
        begin = len(self._data) - len(b"%_N_")
        before, header = self._data[:begin], self._data[begin:]
        if not before.endswith((b"\r", b"\n")) or not before.strip(b"%\r\n \t"):
            return []
        self._data = before
        done = self._finished(End.NEXT if self._is_last_block() else End.OPEN)
        self._data = header
        return done

    def _is_last_block(self) -> bool:
        """Whether the last thing that came can end a program."""
        lines = re.split(rb"[\r\n]+", bytes(self._data[-_HEAD_BYTES:]).rstrip())
        return _LAST_BLOCK.search(lines[-1].strip()) is not None

    def _is_open_tape(self) -> bool:
        """Whether a program begun by % alone still lacks the % that closes it."""
        text = bytes(self._data).strip()
        return text[:1] == b"%" and text[1:2] in (b"\r", b"\n") and not text.endswith((b"\n%", b"\r%"))

    def _is_closed(self, least_bytes: int) -> bool:
        """Whether a line of one %, with an end of so many bytes, follows a program that began with %."""
        if not self._data.endswith((b"\r", b"\n")):
            return False
        tail = bytes(self._data[-_TAIL_BYTES:])
        text = tail.rstrip(b"\r\n \t")
        is_alone = text.endswith((b"\n%", b"\r%")) and len(tail[len(text) :].strip(b" \t")) >= least_bytes
        return is_alone and self._data[:_HEAD_BYTES].lstrip(b"\r\n \t").startswith(b"%") and len(text) > 2

    def _line_end_bytes(self) -> int:
        """How long the end of the program's first line is: the closing % has one like it."""
        first = _LINE_END.search(self._data[:_HEAD_BYTES].lstrip(b"\r\n"))
        return 1 if first is None else len(first[0])

    def _finished(self, end: End) -> list[Received]:
        data = bytes(self._data).lstrip(b"\r\n")
        self._data.clear()
        end = (_with_parity(data) or end) if end.is_whole or end in (End.CUT, End.UNCLOSED) else end
        return [Received(program_name(data), data, end)] if data.strip(b"%\r\n \t") else []


def _with_parity(data: bytes) -> End | None:
    """EVEN or ODD if every character bears that parity in its eighth bit, and there are enough to be sure."""
    odd = {code.bit_count() & 1 for code in data}
    if len(data) < _SURE_BYTES or max(data) < 0x80 or len(odd) > 1:
        return None
    return End.ODD if odd == {1} else End.EVEN


def program_name(data: bytes) -> str:
    r"""The program's own name, in letters that are safe anywhere; `program` if it has none.

    >>> program_name(b"%_N_WAVE_MPF\nG0"), program_name(b"%\nO1234\n"), program_name(b"G0 X1")
    ('WAVE.MPF', 'O1234', 'program')
    """
    lines = [line.strip() for line in re.split(rb"[\r\n]+", data[:_HEAD_BYTES])]
    for line in [line for line in lines if line][:2]:
        for pattern in _NAMES:
            found = pattern.match(line)
            if found:
                return ".".join(part.decode("ascii").upper() for part in found.groups()).replace(":", "O")
    return "program"
