"""The byte clock of one direction of the line."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.line import Line, Run


def test_a_byte_has_arrived_when_its_stop_bit_has() -> None:
    """(1.4)"""
    line = Line(byte_time_s=0.001, fifo_bytes=16)
    assert line.write(b"ab", 5.0) == 5.0
    assert line.carried(5.000_9) == []
    assert [run.data for run in line.carried(5.001)] == [b"a"]
    assert line.next_arrival_s == pytest.approx(5.002)
    assert [run.data for run in line.carried(5.5)] == [b"b"]
    assert line.next_arrival_s == math.inf


def test_a_later_write_queues_behind_an_earlier_one() -> None:
    """(1.4)"""
    line = Line(byte_time_s=0.001, fifo_bytes=16)
    line.write(b"abc", 0.0)
    assert line.write(b"d", 0.001) == pytest.approx(0.003)
    assert line.arrival_s(4) == pytest.approx(0.004)
    assert line.arrival_s(5) == math.inf


def test_the_fifo_and_the_shift_register_bound_what_is_in_flight() -> None:
    """(5.2)"""
    line = Line(byte_time_s=0.001, fifo_bytes=4)
    line.write(b"abcde", 0.0)
    assert line.room_bytes == 0
    line.carried(0.002)
    assert line.room_bytes == 2


def test_bytes_at_a_moment_are_not_after_it() -> None:
    run = Run(first_s=0.3, byte_time_s=0.1, data=b"abcd")
    assert run.count_after(0.1 + 0.2) == 3
    assert run.count_after(0.29) == 4
    assert run.count_after(0.6) == 0
    assert run.count_after(9.0) == 0


@given(
    writes=st.lists(st.tuples(st.binary(min_size=1, max_size=9), st.floats(0.0, 0.02)), max_size=20),
    looks=st.lists(st.floats(0.0, 0.5), max_size=20),
)
def test_every_byte_arrives_once_in_order_and_never_faster_than_the_clock(
    writes: list[tuple[bytes, float]], looks: list[float]
) -> None:
    """(1.4)"""
    line = Line(byte_time_s=0.001, fifo_bytes=16)
    now_s, sent = 0.0, b""
    for data, gap_s in writes:
        now_s += gap_s
        line.write(data, now_s)
        sent += data
    arrived: list[tuple[float, int]] = []
    for look_s in [*sorted(looks), math.inf]:
        for run in line.carried(look_s):
            arrived += [(run.first_s + index * run.byte_time_s, byte) for index, byte in enumerate(run.data)]
            assert run.last_s <= look_s + 1e-9
    assert bytes(byte for _, byte in arrived) == sent
    assert all(b - a >= 0.001 - 1e-9 for (a, _), (b, _) in itertools.pairwise(arrived))
    assert line.waiting_bytes == 0
