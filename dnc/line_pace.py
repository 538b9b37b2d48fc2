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

NETWORK_BYTES = 1 << 17
"""What two ends of a TCP connection take while nobody reads: 64 kB of window and what they count against it."""


def pace_of(profile: MachineProfile, *, is_networked: bool = False) -> Pace:
    """The measure of this line; behind a network a device server may hold bytes back, and the connection to it more."""
    link = profile.link
    inflight = link.inflight_max_bytes or default_inflight_bytes(
        link.baud, link.format, profile.control.xoff_free_bytes
    )
    byte_s = bits_per_byte(link.format) / link.baud
    lag_s, slack = default_lag_s(link.baud), default_slack(link.baud)
    char_delay_s = link.char_delay_s
    if link.handshake == "xonxoff":
        char_delay_s = max(char_delay_s, answer_delay_s(byte_s, profile.control.xoff_free_bytes))
    unseen_bytes = link.adapter_fifo_bytes if link.handshake == "driver" or is_networked else 0
    unseen_bytes += NETWORK_BYTES if is_networked else 0
    return Pace(byte_s, inflight, lag_s, slack, char_delay_s, link.line_delay_s, unseen_bytes)
