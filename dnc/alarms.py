"""Every alarm of the line: a fixed id, what it means, what to do. The ids are those of docs/faults.md."""

from __future__ import annotations

from dataclasses import dataclass

from dnc.events import Alarm, Severity

RESTART = "dnc send --resume, or from its start where no sidecar of dnc plan lies beside the program"


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of alarm; `at` makes the event."""

    id: str
    severity: Severity
    text: str
    remedy: str

    def at(self, now_s: float, offset_bytes: int, detail: str = "") -> Alarm:
        """This alarm, now; `detail` goes behind the text in brackets."""
        text = f"{self.text} ({detail})" if detail else self.text
        return Alarm(now_s, offset_bytes, self.id, self.severity, text, self.remedy)


LONG_HOLD = Kind(
    "DNC-L1",
    Severity.WARNING,
    "the control has held the line for long",
    "look at the control: feed override, feed hold, M0, tool change; if its buffer is empty the XON was lost",
)
HOLD_TIMEOUT = Kind(
    "DNC-L1T",
    Severity.ALARM,
    "the control held the line longer than --hold-timeout",
    f"reset the control, then {RESTART}",
)
UNASKED_XON = Kind(
    "DNC-L4",
    Severity.WARNING,
    "several XON without an XOFF before",
    "check the cable's screen and the parity setting",
)
MASKED_XOFF = Kind(
    "DNC-L6",
    Severity.WARNING,
    "XOFF came with bit 7 set (0x93): the control sends even parity, the profile does not; it was obeyed",
    "set format to 7E1 or 7E2 as at the control",
)
DEAF_DRIVER = Kind(
    "DNC-L6P",
    Severity.ALARM,
    "the control sends XOFF and the driver does not obey it",
    "abort this job (Ctrl-C); set format as at the control (7E1 if XOFF came as 0x93) or use --handshake xonxoff, "
    f"then {RESTART}",
)
LOOPBACK = Kind(
    "DNC-L12",
    Severity.ALARM,
    "our own bytes come back",
    "remove the loopback plug or switch off the control's echo",
)
BREAK = Kind("DNC-L13", Severity.ALARM, "the line is broken or held low", "check plug and cable, then resume")
NOISE = Kind(
    "DNC-L14",
    Severity.WARNING,
    "bytes without meaning arrive",
    "check baud rate, format, screen and earth of the cable",
)
TOO_NOISY = Kind(
    "DNC-L14P",
    Severity.ALARM,
    "so many bytes without meaning that the line cannot be trusted",
    "check the screen and the earth of the cable, then resume or restart",
)
PORT_LOST = Kind(
    "DNC-A1",
    Severity.ALARM,
    "the port was lost",
    "plug the adapter in again, or see to the network and its device server, reset the control, "
    f"then {RESTART}; nothing restarts by itself",
)
FOREIGN_SETTINGS = Kind(
    "DNC-A5",
    Severity.ALARM,
    "another program changed the settings of the port",
    "end that program; resume at the console, or abort this job (Ctrl-C) and restart it",
)
CLOSE_STUCK = Kind("DNC-A10", Severity.WARNING, "the port did not close in time", "unplug the adapter once")
CONTROL_RESET = Kind("DNC-C1", Severity.ALARM, "the control was reset", f"once the control is ready, {RESTART}")
CONTROL_ALARM = Kind(
    "DNC-C2",
    Severity.ALARM,
    "the control raised an alarm",
    f"read the alarm at the control, then {RESTART}",
)
BROKEN_OFF = Kind(
    "DNC-C1P",
    Severity.ALARM,
    "the control holds, and before that it sent SYN or NAK: it may have been reset or have raised an alarm",
    f"look at the control: if so, abort this job (Ctrl-C), reset the control, then {RESTART}; if not, resume",
)
NO_FIRST_XON = Kind(
    "DNC-C3",
    Severity.ALARM,
    "the control did not send its first XON",
    "press cycle start at the control; if it never sends one (840D default), use --start immediate",
)
NO_JOURNAL = Kind(
    "DNC-H2",
    Severity.WARNING,
    "the journal cannot be written: after a power cut nobody could say what was sent",
    "free space in the state folder, or make it writable",
)
UNWATCHED = Kind(
    "DNC-H2P",
    Severity.WARNING,
    "no console can see or pause this job: its socket cannot be made",
    "Ctrl-C aborts it; before the next job make the folder in XDG_RUNTIME_DIR writable",
)
SLEPT = Kind(
    "DNC-H5",
    Severity.ALARM,
    "the computer slept while sending",
    "look at the part, forbid sleep, then resume or restart",
)
