"""Trust in what was read, on a clock of the test's own."""

from dnc.status.ledger import Ledger, Quality, Trust
from dnc.status.registers import VIRTUAL_MILL
from sim.control import Execution
from sim.panel import Panel, discrete_inputs, input_registers

TRUST = Trust(stale_s=0.9, lost_s=10.0, heartbeat_s=1.0)
PANEL = Panel(execution=Execution.ACTIVE, position_mm=(1.0, 2.0, 3.0))


def image(heartbeat: int, panel: Panel = PANEL) -> dict[tuple[int, int], int]:
    words = {(4, address): word for address, word in enumerate(input_registers(panel, heartbeat))}
    return words | {(2, address): int(bit) for address, bit in enumerate(discrete_inputs(panel))}


def ledger(first_s: float | None = 100.0) -> Ledger:
    book = Ledger(VIRTUAL_MILL, TRUST)
    if first_s is not None:
        book.answered(image(1), {}, first_s)
    return book


def test_nothing_is_guessed_before_the_first_answer() -> None:
    """(2.1)"""
    status = ledger(None).status(5.0)
    assert not status.is_available
    assert status.problem == "not connected yet"
    assert all(reading.value is None and reading.quality is Quality.STALE for reading in status.readings.values())


def test_a_value_has_age_and_quality() -> None:
    """(2.1)"""
    status = ledger().status(100.25)
    reading = status.readings["execution"]
    assert (reading.value, reading.age_s, reading.quality) == ("ACTIVE", 0.25, Quality.GOOD)
    assert status.is_available
    assert status.value("x_mm") == 1.0


def test_silence_makes_stale_and_then_unavailable_and_keeps_the_age() -> None:
    """(2.1, M1)"""
    book = ledger()
    book.failed("no answer from 127.0.0.1:5020")
    assert book.status(100.8).value("x_mm") == 1.0
    stale = book.status(101.5)
    assert stale.is_available
    assert "no answer" in stale.problem
    reading = stale.readings["x_mm"]
    assert (reading.value, reading.age_s, reading.quality) == (1.0, 1.5, Quality.STALE)
    lost = book.status(110.0)
    assert not lost.is_available
    assert lost.readings["x_mm"].value is None
    assert lost.readings["x_mm"].age_s == 10.0


def test_a_frozen_device_is_stale_although_it_answers() -> None:
    """(2.1, M6)"""
    book = ledger()
    for step in range(1, 9):
        book.answered(image(1), {}, 100.0 + 0.25 * step)
    status = book.status(102.0)
    assert "heartbeat stands still" in status.problem
    assert status.readings["x_mm"].quality is Quality.STALE
    assert status.value("execution") is None
    book.answered(image(2), {}, 102.25)
    assert book.status(102.25).readings["x_mm"].quality is Quality.GOOD


def test_another_map_is_named_and_nothing_of_it_is_shown() -> None:
    """(2.1, M4)"""
    book = Ledger(VIRTUAL_MILL, TRUST)
    shifted = {(function, address + 1): word for (function, address), word in image(1).items()} | {
        (4, 0): 77,
        (2, 0): 0,
    }
    book.answered(shifted, {}, 100.0)
    status = book.status(100.1)
    assert not status.is_available
    assert "map mismatch" in status.problem
    assert all(reading.value is None and reading.quality is Quality.BAD for reading in status.readings.values())


def test_one_garbled_value_is_bad_and_its_last_good_one_is_kept() -> None:
    """(2.1, M5)"""
    book = ledger()
    book.answered(image(2) | {(4, 10): 0x7FFF}, {}, 100.25)
    status = book.status(100.5)
    reading = status.readings["x_mm"]
    assert (reading.value, reading.age_s, reading.quality) == (1.0, 0.5, Quality.BAD)
    assert "outside" in reading.problem
    assert status.value("x_mm") is None
    assert status.value("y_mm") == 2.0


def test_what_the_device_refuses_is_bad_and_the_rest_is_read() -> None:
    """(2.1, M3)"""
    book = Ledger(VIRTUAL_MILL, TRUST)
    words = {place: word for place, word in image(1).items() if place[0] == 4}
    book.answered(words, {(2, address): "exception 2, illegal address" for address in range(12)}, 100.0)
    status = book.status(100.1)
    assert status.readings["door_closed"].quality is Quality.BAD
    assert status.readings["door_closed"].problem == "exception 2, illegal address"
    assert status.value("execution") == "ACTIVE"
