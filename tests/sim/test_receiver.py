"""The receive ring: marks, overshoot, overrun."""

import math

import pytest

from sim.line import Run
from sim.receiver import Cycle, Marks, Receiver, Word

MARKS = Marks(size_bytes=100, xoff_free_bytes=20, xon_fill_bytes=40)


class Ears:
    """Hears what the receiver says and begins to send it after a delay."""

    def __init__(self, delay_s: float = 0.0) -> None:
        self.heard: list[tuple[Word, float]] = []
        self.delay_s = delay_s

    def __call__(self, word: Word, now_s: float) -> float:
        self.heard.append((word, now_s))
        return now_s + self.delay_s


def run(count: int, first_s: float) -> Run:
    return Run(first_s, 1.0, bytes(count))


def test_dc3_goes_out_at_the_byte_that_reaches_the_mark_and_dc1_when_drained() -> None:
    """(1.4)"""
    ears = Ears()
    ring = Receiver(MARKS, ears)
    ring.arrive(run(79, 1.0))
    assert ears.heard == []
    assert ring.until_xoff_bytes == 1
    ring.arrive(run(3, 80.0))
    assert ears.heard == [(Word.XOFF, 80.0)]
    ring.take(41, 90.0)
    assert ring.is_held
    ring.take(1, 91.0)
    assert ears.heard[-1] == (Word.XON, 91.0)
    assert ring.cycles == [
        Cycle(xoff_s=80.0, overshoot_bytes=2, overrun_bytes=0, xon_s=91.0, run_bytes=82, utilisation=None)
    ]


def test_a_run_is_used_from_dc1_at_the_host_until_its_last_byte() -> None:
    """(5.2) DC1 said at 91 is there at 92; 10 idle byte times, then 40 bytes until DC3 and 2 more: 42 of 52."""
    ring = Receiver(MARKS, Ears())
    ring.arrive(run(80, 1.0))
    ring.take(40, 91.0)
    ring.arrive(run(42, 103.0))
    ring.take(42, 150.0)
    assert [cycle.utilisation for cycle in ring.cycles] == [None, 42 / 52]


def test_a_run_lasts_until_dc3_is_there_though_no_byte_came() -> None:
    """(5.2) A host that falls silent early has not used the line: 40 bytes, 8 idle byte times before a stop by hand."""
    ring = Receiver(MARKS, Ears())
    ring.arrive(run(80, 1.0))
    ring.take(79, 91.0)
    ring.arrive(run(40, 93.0))
    ring.hold(139.0)
    ring.take(41, 150.0)
    assert ring.cycles[-1].utilisation == 40 / 48


def test_bytes_that_come_before_dc3_begins_are_not_overshoot() -> None:
    """(5.2, 5.8)"""
    ring = Receiver(MARKS, Ears(delay_s=2.5))
    ring.arrive(run(84, 1.0))
    assert ring.overshoot_bytes == 2
    ring.arrive(run(1, 85.0))
    assert ring.overshoot_bytes == 3


def test_a_full_ring_loses_bytes_and_counts_them() -> None:
    """(1.4)"""
    ring = Receiver(MARKS, Ears())
    ring.arrive(Run(1.0, 1.0, bytes(range(105))))
    assert (ring.overrun_bytes, ring.received_bytes, ring.fill_bytes) == (5, 100, 100)
    assert ring.fetch() == bytes(range(100))


def test_a_dc3_that_never_leaves_has_no_overshoot_but_overruns() -> None:
    """(5.8, L3)"""
    ring = Receiver(MARKS, lambda word, now_s: math.inf)
    ring.arrive(run(130, 1.0))
    assert (ring.overshoot_bytes, ring.overrun_bytes) == (0, 30)


def test_a_reset_forgets_the_ring() -> None:
    """(5.8)"""
    ring = Receiver(MARKS, Ears())
    ring.arrive(run(90, 1.0))
    ring.clear(95.0)
    ring.take(12, 95.0)
    assert (ring.fill_bytes, ring.is_held, ring.fetch()) == (0, False, b"")
    assert ring.cycles == [
        Cycle(xoff_s=80.0, overshoot_bytes=10, overrun_bytes=0, xon_s=95.0, run_bytes=90, utilisation=None)
    ]


@pytest.mark.parametrize("size", [1, 7, 80, 200])
def test_how_the_bytes_are_cut_into_runs_changes_nothing(size: int) -> None:
    """(5.8)"""
    ears = Ears(delay_s=1.5)
    ring = Receiver(MARKS, ears)
    for first in range(0, 200, size):
        ring.arrive(Run(1.0 + first, 1.0, bytes(min(size, 200 - first))))
    assert ears.heard == [(Word.XOFF, 80.0)]
    assert (ring.overshoot_bytes, ring.overrun_bytes, ring.received_bytes) == (119, 100, 100)
