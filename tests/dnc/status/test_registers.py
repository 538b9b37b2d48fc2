"""The Modbus map as the host reads it, against the map as the mill writes it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnc.profile import Register
from dnc.status.registers import CONTROLLER_MODE, EXECUTION, VIRTUAL_MILL, Request, decode, requests
from sim.control import Execution, Mode
from sim.panel import Panel, discrete_inputs, input_registers


def image(panel: Panel, heartbeat: int = 7) -> dict[tuple[int, int], int]:
    words = {(4, address): word for address, word in enumerate(input_registers(panel, heartbeat))}
    return words | {(2, address): int(bit) for address, bit in enumerate(discrete_inputs(panel))}


def value(name: str, panel: Panel) -> object:
    decoded = decode(name, VIRTUAL_MILL[name], image(panel))
    assert decoded.problem == ""
    return decoded.value


coordinates = st.tuples(*[st.integers(-2_000_000, 2_000_000).map(lambda um: um / 1000.0)] * 3)


@given(coordinates, coordinates, st.integers(0, 2**32 - 1), st.integers(0, 9_000_000), st.integers(-50_000, 50_000))
def test_what_the_mill_writes_the_host_reads(
    position: tuple[float, float, float], to_go: tuple[float, float, float], block: int, feed: int, spindle: int
) -> None:
    """(2.1)"""
    panel = Panel(
        position_mm=position, distance_to_go_mm=to_go, block=block, feed_mm_min=feed / 10, spindle_rpm=float(spindle)
    )
    for axis, mm, left in zip("xyz", position, to_go, strict=True):
        assert value(f"{axis}_mm", panel) == pytest.approx(mm, abs=1e-9)
        assert value(f"to_go_{axis}_mm", panel) == pytest.approx(left, abs=1e-9)
    assert value("block", panel) == block
    assert value("feed_mm_min", panel) == pytest.approx(feed / 10)
    assert value("spindle_rpm", panel) == spindle


def test_states_and_modes_are_the_words_of_mtconnect_at_both_ends() -> None:
    """(2.1)"""
    assert [one.name for one in Execution] == list(EXECUTION)
    assert [one.name for one in Mode] == list(CONTROLLER_MODE)
    for execution in Execution:
        assert value("execution", Panel(execution=execution)) == execution.name
    assert value("controller_mode", Panel(mode=Mode.SEMI_AUTOMATIC)) == "SEMI_AUTOMATIC"


def test_one_panel_in_all_its_places() -> None:
    """(2.1): addresses as the interface page numbers them, counted by hand."""
    panel = Panel(
        uptime_s=70_000.9, execution=Execution.FEED_HOLD, mode=Mode.SEMI_AUTOMATIC, alarm_number=12470,
        feed_override_percent=85.0, spindle_override_percent=90.0, block=65_536 + 3, position_mm=(-0.001, 1.0, 70.0),
        distance_to_go_mm=(0.0, 0.0, -1.5), feed_mm_min=250.0, spindle_rpm=-1000.0, tool=2, is_coolant_on=True,
        is_optional_stop=True, buffer_fill_percent=99.6, overrun_bytes=65_537, program="5000",
    )  # fmt: skip
    words = input_registers(panel, 65_537)
    assert words[:10] == [1, 1, 3, 3, 12470, 85, 85, 90, 1, 3]
    assert words[10:16] == [65_535, 65_535, 0, 1000, 1, 4464]
    assert words[16:26] == [0, 2500, 65_535, 64_536, 2, 100, 1, 1, 1, 4464]
    assert words[26:32] == [0, 0, 0, 0, 65_535, 64_036]
    assert words[32:48] == [0x3530, 0x3030, *[0] * 14]
    assert words[48:] == [0] * 16
    bits = discrete_inputs(panel)
    assert bits == [True, False, True, True, True, True, True, True, True, True, False, True]


def test_the_whole_map_is_two_reads() -> None:
    """(2.1): 32-bit values cannot be torn (M8)."""
    assert requests(VIRTUAL_MILL.values()) == [Request(2, 0, 12), Request(4, 0, 48)]


def test_a_foreign_map_is_read_in_legal_pieces() -> None:
    far = [Register(function=4, address=address, type="u32") for address in (0, 100, 124, 300)]
    assert requests(far) == [Request(4, 0, 2), Request(4, 100, 2), Request(4, 124, 2), Request(4, 300, 2)]
    long = [Register(function=3, address=address, type="u32") for address in range(0, 260, 2)]
    assert [request.count for request in requests(long)] == [124, 124, 12]


@pytest.mark.parametrize(
    ("name", "place", "word", "problem"),
    [
        ("execution", 2, 10, "10 is no word of execution"),
        ("x_mm", 10, 0x7000, "outside -20000 to 20000"),
        ("map_version", 0, 2, "2 is outside 1 to 1"),
        ("program", 32, 0x1B5B, "bytes that are not text"),
    ],
)
def test_values_outside_their_limits_are_not_shown(name: str, place: int, word: int, problem: str) -> None:
    """(2.1, M4, M5)"""
    words = image(Panel()) | {(4, place): word}
    decoded = decode(name, VIRTUAL_MILL[name], words)
    assert decoded.value is None
    assert problem in decoded.problem


def test_a_register_that_was_not_read_has_no_value() -> None:
    words = image(Panel())
    del words[4, 17]
    assert decode("feed_mm_min", VIRTUAL_MILL["feed_mm_min"], words).problem == "not read"
