"""How fast bytes leave on a machine's line, and how many of them may be beyond recall, by its profile."""

from __future__ import annotations

from dnc.pacing import (
    Pace,
    answer_delay_s,
    bits_per_byte,
    default_inflight_bytes,
    default_lag_s,
    default_slack,
)
from dnc.profile import MachineProfile


def pace_of(profile: MachineProfile) -> Pace:
    """The measure of this line."""
    link = profile.link
    inflight = link.inflight_max_bytes or default_inflight_bytes(
        link.baud, link.format, profile.control.xoff_free_bytes
    )
    byte_s = bits_per_byte(link.format) / link.baud
    lag_s, slack = default_lag_s(link.baud), default_slack(link.baud)
    char_delay_s = link.char_delay_s
    if link.handshake == "xonxoff":
        char_delay_s = max(char_delay_s, answer_delay_s(byte_s, profile.control.xoff_free_bytes))
    unseen_bytes = link.adapter_fifo_bytes if link.handshake == "driver" else 0
    return Pace(byte_s, inflight, lag_s, slack, char_delay_s, link.line_delay_s, unseen_bytes)
