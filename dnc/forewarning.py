"""What must be said before the first byte leaves, or keeps it from leaving: a line or a tape that cannot be trusted."""

from __future__ import annotations

import math

from dnc.errors import SettingsRejected
from dnc.line_pace import pace_of
from dnc.port import Flow, Port
from dnc.priority import may_go_first
from dnc.profile import MachineProfile
from dnc.tape import Tape


def refuse_overrun(tape: Tape, profile: MachineProfile, port: Port, *, is_forced: bool) -> None:
    """Refuse a line on which nothing can stop us, when the program is larger than the control's buffer."""
    is_blind = profile.link.handshake == "none" or not port.is_bound_assured
    if not is_blind or is_forced or tape.size_bytes <= profile.control.receive_buffer_bytes:
        return
    why = "no handshake" if profile.link.handshake == "none" else "XOFF over a network comes at no bounded time"
    raise SettingsRejected(
        f"{why}, and the program has {tape.size_bytes} bytes where the control takes "
        f"{profile.control.receive_buffer_bytes}",
        remedy="use a handshake on a local port, or --force if the device server does the handshake itself",
    )


def line_warnings(profile: MachineProfile, port: Port) -> list[str]:
    """What must be said before the first byte leaves: no bound, or a bound beyond what the control forgives."""
    link, allowed = profile.link, profile.control.overrun_allowed_bytes
    if not port.is_bound_assured:
        return [f"bound not assured: {port.name} is behind a network, XOFF arrives at no bounded time"]
    if link.handshake != "xonxoff":
        return []
    pace, found = pace_of(profile), []
    if pace.char_delay_s > link.char_delay_s:
        what = f"the control stops us with {profile.control.xoff_free_bytes} bytes free, too few at {link.baud} baud"
        found.append(f"{what}: sending {1 / (pace.byte_s + pace.char_delay_s):.0f} bytes a second")
    overshoot = pace.inflight_max_bytes + math.ceil(link.adapter_latency_s / pace.byte_s)
    if overshoot > allowed:
        what = f"up to {overshoot} bytes may arrive after XOFF, this control forgives {allowed}"
        found.append(f"{what}; use --handshake driver (the chip obeys XOFF) or rtscts")
    return found


def tape_warnings(tape: Tape) -> list[str]:
    """What the tape lacks though it may be sent."""
    if tape.peek(tape.size_bytes - 1, 1) in (b"\n", b"\r", b"%", b"\0"):
        return []
    return ["the last block has no end of line: the control waits for it and never runs this block; add one"]


def haste_warnings(port: Port) -> list[str]:
    """What must be said where this process itself answers XOFF and nothing lets it go first."""
    if port.flow is not Flow.BYTES or may_go_first():
        return []
    what = "real-time priority is not allowed: while this computer is busy a stop is answered late"
    return [f"{what}; dnc doctor names the command that allows it"]
