"""The control's serial interface: both directions, and the faults of the wire."""

import dataclasses

import pytest

from sim.faults import parse_faults
from sim.messages import Began, BrokeOff, Power, StopReading, Took
from sim.profile import AxisLimits, MillProfile
from sim.uart import Uart

AXIS = AxisLimits(-500.0, 500.0, 300.0, 2000.0, 20000.0)
PROFILE = MillProfile(
    baud=9600, format="8N1", xon=0x11, xoff=0x13, says_xon_at_start=False, dialect="sinumerik",
    knot_rule="nx", poly_degree=5, g28="iso", backward_jump_alarm=14000, has_tool_changer=True, is_inch=False,
    resolution_mm=0.001, tool_length_reference="tip", receive_buffer_bytes=100, xoff_free_bytes=20, xon_fill_bytes=40,
    block_cycle_s=0.004,
    lookahead_blocks=100, axes=(AXIS, AXIS, AXIS),
)  # fmt: skip
BYTE_S = 10 / 9600


def uart(*faults: str, seed: int = 1, profile: MillProfile = PROFILE) -> Uart:
    return Uart(profile, parse_faults(faults), seed)


def pour(end: Uart, count: int, until_s: float) -> bytes:
    """A host that stuffs the adapter and never listens; what it could have heard."""
    heard, now_s = b"", 0.0
    while now_s < until_s:
        size = min(count, end.room_bytes)
        end.host_wrote(bytes(size), now_s)
        count -= size
        heard += end.to_host(now_s)
        now_s += BYTE_S / 4
    return heard


def test_dc3_reaches_the_host_one_byte_time_after_the_mark() -> None:
    """(1.4, 5.2)"""
    end = uart("fifo=200")
    end.host_wrote(bytes(90), 0.0)
    mark_s = 80 * BYTE_S
    assert end.next_wake_s == pytest.approx(mark_s)
    end.advance(mark_s + 1e-9)
    assert end.next_wake_s == pytest.approx(mark_s + BYTE_S)
    assert end.to_host(mark_s + 0.99 * BYTE_S) == b""
    assert end.to_host(mark_s + 1.01 * BYTE_S) == b"\x13"
    end.advance(1.0)
    assert end.receiver.overshoot_bytes == 10


def test_the_reaction_delay_holds_dc3_back() -> None:
    """(5.8)"""
    end = uart("fifo=200", "reaction=0.01")
    end.host_wrote(bytes(100), 0.0)
    end.advance(80 * BYTE_S)
    assert end.next_wake_s == pytest.approx(81 * BYTE_S + 0.01)


def test_even_parity_makes_dc3_0x93_and_leaves_dc1() -> None:
    """(5.8, L6)"""
    end = uart("parity=even")
    assert pour(end, 90, 0.2) == b"\x93"
    end.obey(Took(90), 0.3)
    assert end.to_host(0.4) == b"\x11"


@pytest.mark.parametrize(
    ("fault", "heard"),
    [
        ("lose-xoff=1", b"\x11"),
        ("lose-xon=1", b"\x13"),
        ("double-xoff=1", b"\x13\x13\x11"),
        ("double-xon=all", b"\x13\x11\x11"),
        ("silence=0", b""),
        ("silence=85b", b"\x13"),
        ("start=immediate", b"\x13\x11"),
    ],
)
def test_words_are_lost_and_doubled_by_number(fault: str, heard: bytes) -> None:
    """(5.8, L1-L5)"""
    end = uart(fault)
    first = pour(end, 90, 0.2)
    end.obey(Took(80), 0.3)
    assert first + end.to_host(0.5) == heard


def test_late_words_are_late() -> None:
    """(5.8)"""
    end = uart("xoff-delay=0.05", "xon-delay=0.5")
    assert pour(end, 90, 0.10) == b""
    assert end.to_host(0.14) == b"\x13"
    end.obey(Took(90), 0.2)
    assert end.to_host(0.69) == b""
    assert end.to_host(0.72) == b"\x11"


def test_start_rules() -> None:
    """(5.8, C3)"""
    silent, once, again = uart(), uart("start=xon"), uart("start=repeat-xon")
    for end in (silent, once, again):
        end.obey(Began(), 1.0)
    assert silent.to_host(5.5) == b""
    assert once.to_host(5.5) == b"\x11"
    assert again.to_host(5.5) == b"\x11" * 5
    again.host_wrote(b"N1\n", 5.5)
    assert again.to_host(9.5) == b""


def test_unless_told_otherwise_the_mill_starts_as_its_profile_says() -> None:
    """(5.4, 5.8) A sender that waits for the first XON hears one, in a rehearsal too."""
    waited_for = dataclasses.replace(PROFILE, says_xon_at_start=True)
    for fault, heard in (((), b"\x11" * 5), (("start=immediate",), b"")):
        end = uart(*fault, profile=waited_for)
        end.obey(Began(), 1.0)
        assert end.to_host(5.5) == heard


def test_same_seed_same_bytes() -> None:
    """(5.8)"""

    def heard(seed: int) -> tuple[bytes, bytes]:
        end = uart("noise=50", "drop=0.1", "flip=0.1", seed=seed)
        said = pour(end, 75, 1.0)
        return said, end.fetch()

    assert heard(3) == heard(3)
    assert heard(3) != heard(4)
    assert 20 < len(heard(3)[0]) < 100
    assert len(heard(3)[1]) < 75


def test_reset_and_alarm_are_dc3_and_their_mark() -> None:
    """(5.8, C1, C2)"""
    end = uart()
    end.host_wrote(b"N10 G1", 0.0)
    end.advance(0.1)
    end.obey(BrokeOff(b"\x16"), 0.1)
    assert end.to_host(0.2) == b"\x13\x16"
    assert end.receiver.fill_bytes == 0
    assert end.fetch() == b""


def test_a_control_without_power_is_deaf_and_dumb() -> None:
    """(5.8, C9)"""
    end = uart()
    end.obey(Power(is_on=False), 0.0)
    assert pour(end, 200, 1.0) == b""
    assert end.receiver.received_bytes == 0
    end.obey(Power(is_on=True), 1.0)
    assert end.to_host(1.1) == b"\x11"


def test_after_the_end_it_may_stop_reading() -> None:
    """(5.8, C5)"""
    end = uart()
    end.obey(StopReading(), 0.0)
    assert end.to_host(0.1) == b"\x13"
    end.obey(StopReading(), 0.2)
    assert end.to_host(0.3) == b""


def test_a_seven_bit_control_sees_seven_bits() -> None:
    """(5.8)"""
    end = uart(profile=dataclasses.replace(PROFILE, format="7E1"))
    end.host_wrote(b"\xcen", 0.0)
    end.advance(0.1)
    assert end.fetch() == b"Nn"


def test_the_adapter_is_pulled_at_its_moment() -> None:
    """(5.8, A1)"""
    end = uart("unplug=5b")
    end.host_wrote(b"12345", 0.0)
    assert not end.is_unplugged
    end.advance(0.1)
    assert end.is_unplugged
