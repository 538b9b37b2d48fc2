"""The port: pyserial opens and sets it, from then on only os.read, os.write and select touch it.

pyserial's own write spins while the line is held and forgets how much it had written; the kernel's XON/XOFF would hide
DC1 and DC3 from us. Every way in which a port can die ends as PortLost.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import select
import struct
import termios
import threading
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import serial

from dnc.device_names import device_of, identity_of, is_pty
from dnc.errors import PortLost, PortUnavailable
from dnc.locks import UucpLock, flock_holder
from dnc.port_settings import difference, parity_table, refused_settings, set_flow_characters
from dnc.profile import Link


class Flow(Enum):
    """How the control's hold becomes known."""

    BYTES = "XON and XOFF, read by us"
    MODEM = "a modem line, polled by us"
    DRIVER = "the driver or the chip obeys XOFF; a hold is inferred"
    NONE = "not at all"


class Port(Protocol):
    """What the stream needs of any port."""

    name: str
    identity: str
    flow: Flow
    is_simulated: bool
    is_bound_assured: bool

    def fileno(self) -> int:
        """For select."""

    def read(self) -> bytes:
        """What has arrived; call after select said so. Raises PortLost."""

    def write(self, data: bytes) -> int:
        """How many of these bytes the system accepted, 0 when it is full. Raises PortLost."""

    def queued_bytes(self) -> int:
        """Bytes known to wait below us; 0 where nobody can tell."""

    def may_send(self) -> bool:
        """The state of the modem line that serves as handshake; True where there is none. Raises PortLost."""

    def changed_settings(self) -> str:
        """What another program changed, or nothing. Raises PortLost."""

    def purge(self) -> None:
        """Throw away what the system has not sent yet."""

    def close(self) -> bool:
        """Let go of the port; False if it did not close in time."""


@dataclass(frozen=True, slots=True)
class _Modem:
    """The line that says go: CTS or DSR, and its bit."""

    name: str
    mask: int


FLOWS = {
    "xonxoff": Flow.BYTES,
    "driver": Flow.DRIVER,
    "rtscts": Flow.MODEM,
    "dtrdsr": Flow.MODEM,
    "none": Flow.NONE,
}
_CTS, _DSR = _Modem("CTS", termios.TIOCM_CTS), _Modem("DSR", termios.TIOCM_DSR)
_MODEM = {"rtscts": _CTS, "dtrdsr": _DSR}


class SerialPort:
    """A serial device or a pty, locked and set; see Port for the verbs."""

    is_bound_assured = True

    def __init__(self, name: str, link: Link) -> None:
        self.name = name
        self.device = device_of(name)
        self.is_simulated = is_pty(self.device)
        self.identity = identity_of(self.device)
        self.flow = FLOWS[link.handshake]
        self._link = link
        self._modem = _MODEM.get(link.handshake)
        self._parity = parity_table(link.format) if link.software_parity else None
        if self._modem is not None and self.is_simulated:
            raise PortUnavailable(_no_modem_lines(name, link))
        self._lock = UucpLock(self.device)
        holder = self._lock.acquire()
        if holder is not None:
            raise PortUnavailable(f"{name} is already in use by {holder}; end that first")
        try:
            self._serial = self._opened()
        except BaseException:
            self._lock.release()
            raise
        self._fd = self._serial.fileno()
        self._settings = termios.tcgetattr(self._fd)
        self._presence = _CTS if self._modem is _DSR else _DSR
        self._is_present = self._is_presence_shown()
        self._empty_reads = 0

    def fileno(self) -> int:
        """The descriptor, for select."""
        return self._fd

    def read(self) -> bytes:
        """What has arrived. An empty answer to a readable port is a hang-up."""
        try:
            data = os.read(self._fd, 4096)
        except BlockingIOError:
            return b""
        except OSError as problem:
            raise self._lost(problem) from None
        self._empty_reads = 0 if data else self._empty_reads + 1
        if not data and (self._empty_reads > 2 or self._is_hung_up()):
            raise PortLost(f"{self.name} was unplugged or its other end closed")
        return data

    def write(self, data: bytes) -> int:
        """How many bytes were accepted."""
        if self._parity is not None:
            data = data.translate(self._parity)
        try:
            return os.write(self._fd, data)
        except BlockingIOError:
            return 0
        except OSError as problem:
            raise self._lost(problem) from None

    def queued_bytes(self) -> int:
        """The kernel's own count; always 0 on a pty, where it means nothing."""
        if self.is_simulated:
            return 0
        try:
            (count,) = struct.unpack("I", fcntl.ioctl(self._fd, termios.TIOCOUTQ, b"\0\0\0\0"))
        except OSError as problem:
            raise self._lost(problem) from None
        return int(count)

    def may_send(self) -> bool:
        """CTS or DSR, read now."""
        if self._modem is None:
            return True
        try:
            return self._is_on(self._modem.mask)
        except OSError as problem:
            raise self._lost(problem) from None

    def changed_settings(self) -> str:
        """Which settings differ from those at opening; a pty reads back wrong, so it is never asked.

        A control whose DSR (CTS where DSR is the handshake) was on at the opening and is off now was switched off or
        unplugged: PortLost, or its next power-on would resume the job.
        """
        if self.is_simulated:
            return ""
        if self._is_present and not self._is_presence_shown():
            raise PortLost(self._absence())
        try:
            now = termios.tcgetattr(self._fd)
        except (OSError, termios.error) as problem:
            raise self._lost(problem) from None
        return difference(self._settings, now)

    def purge(self) -> None:
        """Throw away the output queue."""
        with contextlib.suppress(OSError, termios.error):
            termios.tcflush(self._fd, termios.TCOFLUSH)

    def close(self) -> bool:
        """Close with a deadline: a dead adapter may block. Nothing is purged: the last bytes may be on their way."""
        worker = threading.Thread(target=self._close_quietly, daemon=True)
        worker.start()
        worker.join(2.0)
        self._lock.release()
        return not worker.is_alive()

    def _opened(self) -> serial.Serial:
        link = self._link
        bits, parity = (8, "N") if link.software_parity else (int(link.format[0]), link.format[1])
        try:
            opened = serial.Serial(
                port=str(self.device),
                baudrate=link.baud,
                bytesize=bits,
                parity=parity,
                stopbits=float(link.format[2:]),
                timeout=0,
                xonxoff=link.handshake == "driver",
                rtscts=link.handshake == "rtscts",
            )
        except (serial.SerialException, OSError, ValueError, termios.error) as problem:
            raise PortUnavailable(_open_sentence(self.name, problem)) from None
        try:
            self._claim(opened)
        except BaseException:
            opened.close()
            raise
        return opened

    def _claim(self, opened: serial.Serial) -> None:
        """Lock the open device, forbid others to open it, set the characters, read the settings back."""
        fd = opened.fileno()
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise PortUnavailable(
                f"{self.name} is already in use by {flock_holder(self.device)}; end that first"
            ) from None
        if self._link.handshake == "driver":
            set_flow_characters(fd, self._link)
        if self.is_simulated:
            return
        with contextlib.suppress(OSError):
            fcntl.ioctl(fd, termios.TIOCEXCL)
        if self._modem is not None:
            self._require_modem_lines(fd)
        wrong = refused_settings(termios.tcgetattr(fd), self._link)
        if wrong:
            is_format = "handshake" not in wrong
            mend = "choose a format the adapter knows, or software_parity = true" if is_format else "use xonxoff"
            raise PortUnavailable(f"{self.name} does not accept {wrong}; {mend}")

    def _require_modem_lines(self, fd: int) -> None:
        try:
            fcntl.ioctl(fd, termios.TIOCMGET, b"\0\0\0\0")
        except OSError:
            raise PortUnavailable(_no_modem_lines(self.name, self._link)) from None

    def _is_presence_shown(self) -> bool:
        """Whether the control shows that it is there; False where the device has no such line."""
        with contextlib.suppress(OSError):
            return self._is_on(self._presence.mask)
        return False

    def _absence(self) -> str:
        line = self._presence.name
        text = f"{self.name}: {line} went off, the control was switched off or its cable was pulled"
        if self._modem is None:
            return text
        other = next(name for name, modem in _MODEM.items() if modem is self._presence)
        return f"{text}; if it drops {line} whenever it holds, use --handshake {other}, or xonxoff where it drops both"

    def _is_on(self, mask: int) -> bool:
        (lines,) = struct.unpack("I", fcntl.ioctl(self._fd, termios.TIOCMGET, b"\0\0\0\0"))
        return bool(lines & mask)

    def _is_hung_up(self) -> bool:
        poll = select.poll()
        poll.register(self._fd, select.POLLIN)
        return any(flags & (select.POLLHUP | select.POLLERR | select.POLLNVAL) for _, flags in poll.poll(0))

    def _close_quietly(self) -> None:
        with contextlib.suppress(OSError, termios.error, serial.SerialException):
            self._serial.close()

    def _lost(self, problem: Exception) -> PortLost:
        code = problem.args[0] if problem.args and isinstance(problem.args[0], int) else errno.EIO
        return PortLost(f"{self.name} was lost: {os.strerror(code)}")


def _no_modem_lines(name: str, link: Link) -> str:
    return f"{name} has no modem lines, {link.handshake} cannot work; use --handshake xonxoff"


def _open_sentence(name: str, problem: Exception) -> str:
    code = getattr(problem, "errno", None)
    text = str(problem)
    if code == errno.EACCES:
        return f"{name}: no permission; run: sudo usermod -aG dialout $USER, then log in again"
    if code == errno.EBUSY:
        return f"{name} is already in use by another program; end that first"
    if code is not None:
        return f"{name} cannot be opened: {os.strerror(code)}; see dnc ports"
    if "25" in text or "Inappropriate" in text:
        return f"{name} is not a serial port; see dnc ports"
    return f"{name} cannot be set up: {text.splitlines()[0]}; check baud rate and format"
